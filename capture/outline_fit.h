#pragma once

#include "capture/outline_picture.h"
#include "capture/outline_vote.h"

#include <Eigen/Core>
#include <glm/glm.hpp>

#include <cstdint>
#include <optional>
#include <vector>

namespace insitu::detail {

/// An ellipse near a circle: half axes r (1 + e) and r (1 - e), `stretch` = e (cos 2a, sin 2a) for
/// a longer axis at angle a. The five numbers are independent and harmless at e = 0.
struct Outline {
    glm::dvec2 center{0.0};
    double radius = 0.0;
    glm::dvec2 stretch{0.0};

    /// Distance from the centre to the curve in direction `angle`.
    [[nodiscard]] double radiusAt(double angle) const;
};

/// A place on a ray from a centre.
struct RimPoint {
    glm::dvec2 place{0.0};
    double weight = 0.0;  ///< > 0
};
/// What one ray shows: nothing, one or several places.
using RimRay = std::vector<RimPoint>;

/// Values along rays, `samples` places `step` pixels apart with the outline in the middle: a row
/// for each place, a column for each frame and channel, in standard deviations of noise. Rays are
/// averaged over neighbours within `average_radians` (the noise stays 1: they are sums over the
/// root of their number). Empty where the outline is outside the picture.
[[nodiscard]] std::vector<Eigen::MatrixXf> rayProfiles(const OutlinePicture& picture,
                                                       const Outline& outline,
                                                       int rays,
                                                       int samples,
                                                       double step,
                                                       double average_radians);

/// Edges along `rays` rays from the outline's centre, `half_window` to both sides of the outline:
/// local maxima of the radial derivative smoothed by `sigma` pixels, all frames and channels
/// joined, neighbouring rays averaged. Weights in (0, 1). Rays that leave the picture are empty.
[[nodiscard]] std::vector<RimRay> scanEdges(const OutlinePicture& picture,
                                            const Outline& outline,
                                            int rays,
                                            double half_window,
                                            double sigma);

/// The same from edges already found: those that lie within `half_window` of the outline and face
/// its centre, sorted into `rays` sectors.
[[nodiscard]] std::vector<RimRay> sortEdges(const std::vector<Edge>& edges,
                                            const Outline& outline,
                                            int rays,
                                            double half_window);

/// The circle on which most rays have an edge within `tolerance`; nothing without three rays that
/// show edges. Centre and radius stay within `reach` of the given ones. Fixed seed [FisBol81].
[[nodiscard]] std::optional<Outline> consensusCircle(const std::vector<RimRay>& rays,
                                                     const Outline& near,
                                                     double reach,
                                                     double tolerance);

struct OutlineFit {
    Outline outline;
    double center_sigma = 0.0;  ///< pixels, worse axis
    double radius_sigma = 0.0;  ///< pixels
    int inliers = 0;            ///< rays with a place within the tolerance
    double support = 0.0;       ///< sum of their weights
};
/// Places farther from the curve than this, pixels, do not count.
struct Tolerance {
    double inside = 0.0;
    double outside = 0.0;
};
/// Least squares through each ray's place nearest to the curve, Tukey's weights with each side's
/// tolerance. Nothing when too few rays are left to determine the curve.
[[nodiscard]] std::optional<OutlineFit> fitOutline(const std::vector<RimRay>& rays,
                                                   const Outline& start,
                                                   bool ellipse,
                                                   Tolerance tolerance);

/// Direction of ray i of n.
[[nodiscard]] glm::dvec2 rayDirection(int ray, int rays);

}  // namespace insitu::detail
