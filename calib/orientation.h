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

/// Whether ends of segments of different axes that were marked at the same point are one point.
enum class Corners { Shared, Separate };

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
    /// Sum of squared residuals over their variances, without the prior.
    double chi_squared = 0.0;
    double freedom = 0.0;  ///< expected chi_squared when sigma_px is true
    /// The focal length ran into the limits of what a lens can be: the lines hold no real one.
    bool focal_at_limit = false;

    [[nodiscard]] double focalSigma() const;     ///< of ln(focal)
    [[nodiscard]] double rotationSigma() const;  ///< root mean square angle of the error, radians
};

/// Maximum likelihood: end points have independent errors of `sigma_px` in each coordinate.
///
/// Where a line lies is unknown and uses up one of the two errors across it; what is left is the
/// distance c of the ends from the line through the middle m and the vanishing point
/// v = (f d.x, f d.y, d.z): with half = (to − from)/2 and t = v.xy − m v.z, c = (t × half) / |t|.
/// No division by v.z: nothing happens at infinity. The c have the covariance B Σ Bᵀ, B their
/// derivative by the end points. A corner that several segments share is one point, known better
/// (σ²/ends), and correlates their c; that is worth 30 % of the rotation's error in a room seen
/// by its corners. Solved from many starts by Levenberg–Marquardt over rotation (3) and ln f (1),
/// the covariance taken at the last solution (Gauss–Helmert).
///
/// Nothing when no two axes have segments, no axis has two, or no start converges.
/// Source: [GibCha03] section 3 for the vanishing points, [LieZis98] section 3.1 for the
/// maximum-likelihood vanishing point with midpoints, [FoeWro16] section 4.8 for Gauss–Helmert.
[[nodiscard]] std::optional<OrientationEstimate> solveOrientation(
    const LineSet& lines,
    glm::dvec2 principal_px,
    double sigma_px,
    const std::optional<FocalPrior>& prior,
    Corners corners = Corners::Shared);

}  // namespace insitu
