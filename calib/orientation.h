#pragma once

#include "calib/line_segments.h"

#include <glm/glm.hpp>

#include <array>
#include <optional>
#include <vector>

namespace insitu {

/// Rotation and focal length of a camera from lines along the room's axes, principal point known.
///
/// Common rules: `camera_from_world` has the room's axes in the camera's frame (x right, y down,
/// z forward) as its columns. Their signs are free here, up to right-handedness, since lines have
/// no direction. Deterministic.

/// A focal length known from elsewhere, with a relative standard deviation.
struct FocalPrior {
    double focal_px = 0.0;
    double sigma = 0.03;  ///< of ln(focal), > 0
};

struct OrientationEstimate {
    glm::dmat3 camera_from_world{1.0};
    double focal_px = 0.0;
    /// Covariance of (rotation vector in the camera's frame, radians; ln focal). Infinite entries
    /// on the diagonal when the lines and the prior leave something open.
    std::array<std::array<double, 4>, 4> covariance{};
    /// Standard deviation of ln(focal) by the lines alone, whatever the prior; may be infinite.
    double lines_focal_sigma = 0.0;
    /// One per segment: distance of its ends from the line through its middle and the vanishing
    /// point, pixels, unsigned.
    std::vector<double> distances_px;
    /// Σ over segments of 2·distance²/σ². Expected: segments − parameters determined by them.
    double chi_squared = 0.0;
    /// The focal length ran into the limits of what a lens can be: the lines hold no real one.
    bool focal_at_limit = false;

    [[nodiscard]] double focalSigma() const;     ///< of ln(focal)
    [[nodiscard]] double rotationSigma() const;  ///< root mean square angle of the error, radians
};

/// Maximum likelihood: end points have independent errors of `sigma_px` in each coordinate.
///
/// A segment's line has two errors; its offset is used up by the line's own unknown place, and
/// what is left is the distance d of the ends from the line through the middle m and the
/// vanishing point v = (f d.x, f d.y, d.z): with half = (to − from)/2 and t = v.xy − m v.z,
/// d = |t × half| / |t|, whose standard deviation is σ/√2. No division by v.z: nothing happens at
/// infinity. Solved from many starts by Levenberg–Marquardt over rotation (3) and ln f (1).
///
/// Nothing when no two axes have segments, no axis has two, or no start converges.
/// Source: [GibCha03] section 3 for the vanishing points, [LieZis98] section 3.1 for the
/// maximum-likelihood vanishing point with midpoints.
[[nodiscard]] std::optional<OrientationEstimate> solveOrientation(
    const LineSet& lines,
    glm::dvec2 principal_px,
    double sigma_px,
    const std::optional<FocalPrior>& prior);

}  // namespace insitu
