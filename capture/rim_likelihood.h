#pragma once

#include "capture/outline_fit.h"
#include "capture/outline_picture.h"

#include <vector>

namespace insitu::detail {

/// How unlikely each ray's profile is (minus the logarithm of its density, up to a constant), by
/// where the rim is taken to be.
struct RimCosts {
    double first = 0.0;  ///< first place, pixels outwards from the outline
    double step = 0.0;   ///< between places, pixels
    /// By ray, then place, the least of each ray 0. A ray is empty where the outline is outside the
    /// picture.
    std::vector<std::vector<double>> rays;
    double least = 0.0;  ///< sum of the rays' least costs: lower where the blur fits better
};

/// Rays looked along, 3 degrees each.
inline constexpr int kRimRays = 120;

/// Costs for places within `reach` pixels of the outline.
///
/// A profile along a ray is taken for two walks that meet at the rim. Outside, values wander from
/// one pixel to the next by the background's own roughness. Inside, at s pixels from the rim of a
/// ball of radius R, the mirror turns the ray 2 sqrt(2 s / R) away from straight on, and values
/// wander with that angle, so ever faster towards the rim: that, more than any step, gives the rim
/// of a perfect mirror away, which continues what is behind it. A step at the rim itself is allowed
/// as well. All of it is blurred by a Gaussian of `blur` pixels and carries the picture's noise, so
/// that a profile is a normal vector of known covariance [RasWil06, eq. 2.30]. The roughness
/// of both sides is taken from a few, in proportions that each frame and channel shows itself.
[[nodiscard]] RimCosts rimCosts(const OutlinePicture& picture,
                                const Outline& outline,
                                double reach,
                                double blur);

}  // namespace insitu::detail
