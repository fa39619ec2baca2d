#include "capture/outline_refine.h"

#include "capture/outline_joint.h"
#include "capture/rim_likelihood.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace insitu::detail {

using std::numbers::pi;

namespace {

constexpr int kFewestRays = 180;
constexpr int kMostRays = 480;
/// An ellipse of axes 1.1 : 1 leaves its circle by 4.5 % of the radius, and its first fit needs
/// room.
constexpr double kEllipseBand = 0.045;

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

namespace {

/// What the rim's likelihood looks at in the end, pixels, and first, as a share of the radius.
constexpr double kLastReach = 3.0;
constexpr double kFirstReach = 0.04;
constexpr double kReachStep = 0.25;
/// Standard deviations of blur tried: pixel and bilinear look-up alone, up to out of focus.
constexpr std::array<double, 4> kBlurs = {0.5, 0.8, 1.3, 2.1};
/// The blur of whatever is not known better, and of a far reach, whose samples are farther apart.
constexpr double kUsualBlur = 0.8;
constexpr double kBlurShare = 1.0 / 24.0;
/// Answers from other sectors that give the standard deviation.
constexpr int kDraws = 100;
constexpr int kEllipseRounds = 2;
/// ... times this, since what lies beside the rim goes on over more than a sector; and what no
/// scatter shows: pixels, of the model's shape. Both so that two standard deviations hold 95 % of
/// the errors of bench/probe_accuracy.
constexpr double kDrawnFactor = 1.5;
constexpr double kModelSigma = 0.15;
/// Share of the rays that show a rim somewhere within reach and do so at the outline by chance.
constexpr double kChance = 0.2;

double aboveChance(double share)
{
    return std::max((share - kChance) / (1.0 - kChance), 0.0);
}

BallOutline ballFrom(const OutlinePicture& picture, const JointFit& fit)
{
    BallOutline ball;
    ball.center_px = fit.outline.center;
    ball.radius_px = fit.outline.radius;
    const double e = glm::length(fit.outline.stretch);
    ball.axis_ratio = (1.0 - e) / (1.0 + e);
    ball.axis_angle = 0.5 * std::atan2(fit.outline.stretch.y, fit.outline.stretch.x);
    if (ball.axis_angle < 0.0) ball.axis_angle += pi;
    ball.center_sigma = std::hypot(kDrawnFactor * fit.center_sigma, kModelSigma);
    ball.radius_sigma = std::hypot(kDrawnFactor * fit.radius_sigma, kModelSigma);
    ball.visible_share = visibleShare(picture, fit.outline);
    ball.inlier_share = aboveChance(fit.share);
    return ball;
}

}  // namespace

BallOutline withShares(const OutlinePicture& picture, BallOutline ball)
{
    const Outline outline = outlineOf(ball);
    ball.visible_share = visibleShare(picture, outline);
    const RimCosts costs = rimCosts(picture, outline, kLastReach, kUsualBlur);
    ball.inlier_share = aboveChance(shareOfRim(costs, outline, kLastReach));
    return ball;
}

std::optional<BallOutline> approachOutline(const OutlinePicture& picture,
                                           Outline outline,
                                           double window,
                                           bool ellipse)
{
    const glm::dvec2 shape = outline.stretch;
    const bool shape_known = shape != glm::dvec2(0.0);
    for (;; window *= 0.4) {
        const std::optional<OutlineFit> fit =
            searchNear(picture, outline, outlineRays(outline.radius), window, ellipse);
        if (!fit) return std::nullopt;
        outline = fit->outline;
        if (shape_known) outline.stretch = shape;
        if (window <= 5.0 || window <= 0.02 * outline.radius) break;
    }
    // Two more numbers to find need more room to find them in.
    double reach = std::max((ellipse ? 2.0 : 1.0) * kFirstReach * outline.radius, kLastReach);
    for (;; reach = std::max(kReachStep * reach, kLastReach)) {
        const double blur = std::max(reach * kBlurShare, kUsualBlur);
        const RimCosts costs = rimCosts(picture, outline, reach, blur);
        const std::optional<JointFit> fit =
            fitJointly(costs, outline, ellipse && !shape_known, reach, 0);
        if (!fit) return std::nullopt;
        outline = fit->outline;
        if (reach <= kLastReach) return ballFrom(picture, *fit);
    }
}

std::optional<BallOutline> refineOutline(const OutlinePicture& picture,
                                         const BallOutline& near,
                                         bool ellipse)
{
    const Outline outline = outlineOf(near);
    double blur = kUsualBlur;
    double least = std::numeric_limits<double>::infinity();
    RimCosts best;
    for (const double tried : kBlurs) {
        RimCosts costs = rimCosts(picture, outline, kLastReach, tried);
        if (costs.least >= least) continue;
        least = costs.least;
        blur = tried;
        best = std::move(costs);
    }
    std::optional<JointFit> fit = fitJointly(best, outline, ellipse, kLastReach, 0);
    if (!fit) return std::nullopt;
    // Once more about the answer, whose own profiles are averaged along the outline itself; an
    // ellipse takes longer to settle.
    for (int i = 0; i < kEllipseRounds && fit && ellipse; ++i)
        fit = fitJointly(rimCosts(picture, fit->outline, kLastReach, blur),
                         Outline(fit->outline),
                         ellipse,
                         kLastReach,
                         0);
    if (!fit) return std::nullopt;
    const Outline again = fit->outline;
    fit =
        fitJointly(rimCosts(picture, again, kLastReach, blur), again, ellipse, kLastReach, kDraws);
    if (!fit) return std::nullopt;
    return ballFrom(picture, *fit);
}

}  // namespace insitu::detail
