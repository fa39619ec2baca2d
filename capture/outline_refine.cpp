#include "capture/outline_refine.h"

#include "capture/outline_rim.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu::detail {

using std::numbers::pi;

namespace {

constexpr int kFewestRays = 180;
constexpr int kMostRays = 480;
/// An ellipse of axes 1.1 : 1 leaves its circle by 4.5 % of the radius, and its first fit needs
/// room.
constexpr double kEllipseBand = 0.045;
constexpr double kEllipseTolerance = 0.02;
/// Rays are searched so many tolerances to both sides.
constexpr double kReachTolerances = 4.0;
/// What is mirrored beside the rim shows inside it, never outside: places inside count only within
/// this share of the tolerance.
constexpr double kInsideShare = 0.4;
/// The tolerance shrinks to this, pixels, as long as this share of the inliers stays.
constexpr double kFinestTolerance = 0.4;
constexpr double kKeptShare = 0.5;
/// The outer edge is taken when at least this share of the rays that spoke for the fit before it
/// still does.
constexpr double kOuterEdgeShare = 0.72;

/// Of the outline, the share inside the picture.
double visibleShare(const OutlinePicture& picture, const Outline& outline)
{
    int inside = 0;
    for (int i = 0; i < kMostRays; ++i) {
        const double radius = outline.radiusAt(2.0 * pi * i / kMostRays);
        inside += picture.contains(outline.center + radius * rayDirection(i, kMostRays));
    }
    return static_cast<double>(inside) / kMostRays;
}

/// Places on a real ball's outline scatter about so far: it is not quite round, nor the lens quite
/// straight. Pixels.
double toleranceFor(double radius)
{
    return std::clamp(0.006 * radius, 0.6, 4.0);
}

/// Of the visible rays, the share that shows the rim at the outline rather than somewhere else. A
/// ray without a rim has its best place anywhere within reach, by chance within the tolerance.
double shareOfRim(int inliers, int rays, double visible)
{
    const double share = std::min(inliers / std::max(visible * rays, 1.0), 1.0);
    const double chance = 1.0 / kReachTolerances;
    return std::max((share - chance) / (1.0 - chance), 0.0);
}

/// The consensus of an ellipse of the given shape: that of a circle where the ellipse is made one.
std::optional<Outline> consensusOfShape(std::vector<RimRay> rays,
                                        const Outline& near,
                                        double reach,
                                        double tolerance)
{
    const double e = glm::length(near.stretch);
    const double half_angle = 0.5 * std::atan2(near.stretch.y, near.stretch.x);
    const glm::dvec2 axis(std::cos(half_angle), std::sin(half_angle));
    const glm::dvec2 other(-axis.y, axis.x);
    const auto scaled = [&](glm::dvec2 arm, double along, double across) {
        return glm::dot(arm, axis) * along * axis + glm::dot(arm, other) * across * other;
    };
    for (RimRay& ray : rays)
        for (RimPoint& point : ray)
            point.place =
                near.center + scaled(point.place - near.center, 1.0 / (1.0 + e), 1.0 / (1.0 - e));
    std::optional<Outline> found = consensusCircle(rays, near, reach, tolerance);
    if (!found) return std::nullopt;
    found->center = near.center + scaled(found->center - near.center, 1.0 + e, 1.0 - e);
    found->stretch = near.stretch;
    return found;
}

}  // namespace

int outlineRays(double radius)
{
    return std::clamp(static_cast<int>(2.0 * pi * radius), kFewestRays, kMostRays);
}

Outline outlineOf(const BallOutline& ball)
{
    const double e = (1.0 - ball.axis_ratio) / (1.0 + ball.axis_ratio);
    return {ball.center_px,
            ball.radius_px,
            e * glm::dvec2(std::cos(2.0 * ball.axis_angle), std::sin(2.0 * ball.axis_angle))};
}

std::optional<OutlineFit> searchNear(
    const OutlinePicture& picture, const Outline& near, int rays, double window, bool ellipse)
{
    const double sigma = std::max(window / 10.0, 1.0);
    const std::vector<RimRay> edges = scanEdges(picture, near, rays, window, sigma);
    const double fine = 2.0 * sigma;
    if (!ellipse) {
        const std::optional<Outline> circle = consensusCircle(edges, near, window, 1.5 * sigma);
        if (!circle) return std::nullopt;
        return fitOutline(edges, *circle, false, {fine, fine});
    }
    const double band = std::max(fine, kEllipseBand * near.radius);
    const std::optional<Outline> circle = near.stretch == glm::dvec2(0.0)
                                              ? consensusCircle(edges, near, window, band)
                                              : consensusOfShape(edges, near, window, 1.5 * sigma);
    if (!circle) return std::nullopt;
    const std::optional<OutlineFit> wide = fitOutline(edges, *circle, true, {band, band});
    if (!wide) return std::nullopt;
    return fitOutline(edges, wide->outline, true, {fine, fine});
}

BallOutline withShares(const OutlinePicture& picture, BallOutline ball)
{
    const Outline outline = outlineOf(ball);
    const int rays = outlineRays(ball.radius_px);
    const double tolerance = toleranceFor(ball.radius_px);
    const double reach = kReachTolerances * tolerance;
    int inliers = 0;
    for (const RimRay& ray : locateRim(picture, outline, rays, reach)) {
        for (const RimPoint& point : ray) {
            const glm::dvec2 arm = point.place - outline.center;
            const double off = glm::length(arm) - outline.radiusAt(std::atan2(arm.y, arm.x));
            inliers += std::abs(off) < tolerance;
        }
    }
    ball.visible_share = visibleShare(picture, outline);
    ball.inlier_share = shareOfRim(inliers, rays, ball.visible_share);
    return ball;
}

namespace {

/// A fit to the places of the rim; `inside_share` of the tolerance counts inside the curve.
std::optional<OutlineFit> fitRim(const OutlinePicture& picture,
                                 const Outline& near,
                                 bool ellipse,
                                 double tolerance,
                                 double inside_share)
{
    const std::vector<RimRay> rim =
        locateRim(picture, near, outlineRays(near.radius), kReachTolerances * tolerance);
    const std::optional<OutlineFit> fit =
        fitOutline(rim, near, ellipse, {2.0 * tolerance, 2.0 * tolerance});
    if (!fit) return std::nullopt;
    return fitOutline(rim, fit->outline, ellipse, {inside_share * tolerance, tolerance});
}

BallOutline ballFrom(const OutlinePicture& picture, const OutlineFit& fit)
{
    BallOutline ball;
    ball.center_px = fit.outline.center;
    ball.radius_px = fit.outline.radius;
    const double e = glm::length(fit.outline.stretch);
    ball.axis_ratio = (1.0 - e) / (1.0 + e);
    ball.axis_angle = 0.5 * std::atan2(fit.outline.stretch.y, fit.outline.stretch.x);
    if (ball.axis_angle < 0.0) ball.axis_angle += pi;
    ball.center_sigma = fit.center_sigma;
    ball.radius_sigma = fit.radius_sigma;
    return withShares(picture, ball);
}

/// From a fit whose places lie on both sides to one whose places inside hardly count, with a
/// tolerance that shrinks as long as most stay. Before a plain wall a rim shows little, and what is
/// mirrored beside it pulls a fit inwards.
OutlineFit fitOuterEdge(const OutlinePicture& picture,
                        const OutlineFit& both_sides,
                        bool ellipse,
                        double tolerance)
{
    OutlineFit best = both_sides;
    for (bool first = true;; first = false, tolerance *= 0.5) {
        const std::optional<OutlineFit> next =
            fitRim(picture, best.outline, ellipse, tolerance, kInsideShare);
        if (!next || (!first && next->inliers < kKeptShare * best.inliers)) return best;
        best = *next;
        if (tolerance <= kFinestTolerance) return best;
    }
}

}  // namespace

std::optional<BallOutline> refineOutline(const OutlinePicture& picture,
                                         Outline outline,
                                         double window,
                                         bool ellipse)
{
    for (;; window *= 0.4) {
        const std::optional<OutlineFit> fit =
            searchNear(picture, outline, outlineRays(outline.radius), window, ellipse);
        if (!fit) return std::nullopt;
        outline = fit->outline;
        if (window <= 5.0 || window <= 0.02 * outline.radius) break;
    }
    const double tolerance = toleranceFor(outline.radius);
    // Two more numbers to find need more room to find them in.
    const double first =
        ellipse ? std::max(tolerance, kEllipseTolerance * outline.radius) : tolerance;
    std::optional<OutlineFit> fit = fitRim(picture, outline, ellipse, first, 1.0);
    if (fit) fit = fitRim(picture, fit->outline, ellipse, tolerance, 1.0);
    if (!fit) return std::nullopt;
    const BallOutline middle = ballFrom(picture, *fit);
    const BallOutline outer = ballFrom(picture, fitOuterEdge(picture, *fit, ellipse, tolerance));
    BallOutline ball = outer.inlier_share >= kOuterEdgeShare * middle.inlier_share ? outer : middle;
    // What the scatter does not show: where both speak for themselves, how much the answer depends
    // on the choice.
    if (middle.inlier_share < kOuterEdgeShare * outer.inlier_share) return ball;
    ball.center_sigma =
        std::hypot(ball.center_sigma, 0.5 * glm::length(outer.center_px - middle.center_px));
    ball.radius_sigma = std::hypot(ball.radius_sigma, 0.5 * (outer.radius_px - middle.radius_px));
    return ball;
}

}  // namespace insitu::detail
