#pragma once

#include "calib/line_segments.h"

#include <glm/glm.hpp>

#include <optional>

namespace insitu {

/// A focal length known from elsewhere, with a relative standard deviation.
struct FocalPrior {
    double focal_px = 0.0;
    double sigma = 0.03;  ///< of ln(focal), > 0
};

/// Rotation and focal length of a camera. `camera_from_world` has the room's axes in the camera's
/// frame (x right, y down, z forward) as its columns.
struct Orientation {
    glm::dmat3 camera_from_world{1.0};
    double focal_px = 0.0;
    /// Sum of the robust losses of the segments in units of σ², the prior's square included.
    double loss = 0.0;
    /// First-order standard deviations: root mean square angle of the rotation's error (radians),
    /// and of ln(focal). Infinite when open.
    double rotation_sigma = 0.0;
    double focal_sigma = 0.0;
    /// The focal length ran into the limits of what a lens can be: the lines hold no real one.
    bool focal_at_limit = false;
};

/// Focal lengths beyond these multiples of the picture's long side are no lens (170° and 2°).
inline constexpr double kShortestFocal = 0.05;
inline constexpr double kLongestFocal = 30.0;

/// A start for calibrateCamera: rotation and focal length near the truth even when up to a third of
/// an axis' segments run elsewhere. The columns' signs are free, up to right-handedness, since
/// lines have no direction.
///
/// straight      its points must be straight already (calib/lens_distortion.h)
/// principal_px  taken as known
/// sigma_px      standard deviation of each coordinate of an end point
///
/// Each axis gets the vanishing point that most segments agree on, from pairs of them; pairs of
/// axes and a range of focal lengths give rotations; the best are refined by Gauss–Newton with
/// weights for Cauchy's loss. Nothing when no two axes have segments or no axis has two.
/// Deterministic. Source: [GibCha03] section 3 for rotation and focal length from vanishing points,
/// [HolWel77] for the weights.
[[nodiscard]] std::optional<Orientation> findOrientation(const LineSet& straight,
                                                         glm::dvec2 principal_px,
                                                         double sigma_px,
                                                         const std::optional<FocalPrior>& prior);

}  // namespace insitu
