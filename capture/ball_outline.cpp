#include "capture/ball_outline.h"

#include "capture/outline_fit.h"
#include "capture/outline_picture.h"
#include "capture/outline_rim.h"
#include "capture/outline_vote.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

using detail::Circle;
using detail::Outline;
using detail::OutlineFit;
using detail::OutlinePicture;
using detail::RimRay;

/// The whole picture is searched at this longer side.
constexpr int kCoarseSide = 640;
constexpr double kSmallestCoarseRadius = 8.0;
constexpr double kSmallestRadius = 12.0;
constexpr std::size_t kCandidates = 40;
constexpr int kCoarseRays = 180;
constexpr int kFewestRays = 180;
constexpr int kMostRays = 720;
/// In the reduced picture: distance of an edge from its circle, circles looked at closely, and the
/// power of the radius that circles gain by being large.
constexpr double kCoarseTolerance = 1.5;
constexpr std::size_t kFinalists = 8;
constexpr double kSizeBonus = 0.2;
/// A circle around another one needs only this share of its score.
constexpr double kOuterShare = 0.93;
constexpr double kOuterGrowth = 1.2;
/// How far a given start may be off, share of the radius.
constexpr double kStartReach = 0.12;
/// A circle with fewer edges is no ball; one with fewer than the second is doubtful.
constexpr double kFoundShare = 0.2;
constexpr double kFirmShare = 0.4;
/// Less of the outline than this in the picture is doubtful.
constexpr double kFirmVisible = 0.6;
/// Standard deviation, share of the radius, from which on the outline is doubtful.
constexpr double kFirmSigma = 0.01;

/// Of the outline, the share inside the picture.
double visibleShare(const OutlinePicture& picture, const Outline& outline)
{
    int inside = 0;
    for (int i = 0; i < kMostRays; ++i) {
        const double radius = outline.radiusAt(2.0 * pi * i / kMostRays);
        inside += picture.contains(outline.center + radius * detail::rayDirection(i, kMostRays));
    }
    return static_cast<double>(inside) / kMostRays;
}

int raysFor(double radius)
{
    return std::clamp(static_cast<int>(2.0 * pi * radius), kFewestRays, kMostRays);
}

/// Places on a real ball's outline scatter about so far: it is not quite round, nor the lens quite
/// straight. Pixels.
double toleranceFor(double radius)
{
    return std::clamp(0.004 * radius, 1.0, 4.0);
}

/// Of the visible rays, the share that shows the rim at the outline rather than somewhere else. A
/// ray without a rim has its best place anywhere within `reach`, by chance within the tolerance.
double shareOfRim(int inliers, int rays, double visible, double tolerance, double reach)
{
    const double share = std::min(inliers / std::max(visible * rays, 1.0), 1.0);
    const double chance = tolerance / reach;
    return std::max((share - chance) / (1.0 - chance), 0.0);
}

/// Edges in a window about the outline, joined by consensus, then fitted as a circle.
std::optional<OutlineFit> searchNear(const OutlinePicture& picture,
                                     const Outline& near,
                                     int rays,
                                     double window)
{
    const double sigma = std::max(window / 10.0, 1.0);
    const std::vector<RimRay> edges = detail::scanEdges(picture, near, rays, window, sigma);
    const std::optional<Outline> circle = detail::consensusCircle(edges, near, window, 1.5 * sigma);
    if (!circle) return std::nullopt;
    return detail::fitOutline(edges, *circle, false, 2.0 * sigma);
}

/// A circle of the reduced picture, and how well its edges speak for it.
struct Candidate {
    Outline outline;
    double score = 0.0;
};

/// Of circles with about as many edges the larger one is rarer by chance.
double scoreOf(const OutlinePicture& picture, const OutlineFit& fit, int rays)
{
    if (!picture.contains(fit.outline.center)) return 0.0;
    return fit.support / rays * std::pow(fit.outline.radius, kSizeBonus);
}

/// Whether `outer` is a little larger and holds `inner`. What a ball mirrors runs along its rim, so
/// circles of edges are to be expected inside it, but not around it.
bool encloses(const Outline& outer, const Outline& inner)
{
    return outer.radius > inner.radius && outer.radius < kOuterGrowth * inner.radius &&
           glm::length(outer.center - inner.center) < outer.radius - inner.radius + 2.0;
}

/// The best of the circles that the reduced picture's edges vote for, in its pixels: first by
/// edges alone, then by what long arcs show.
std::optional<Outline> searchEverywhere(const OutlinePicture& coarse, double smallest)
{
    const std::vector<detail::Edge> edges = detail::thinEdges(coarse);
    std::vector<Candidate> candidates;
    for (const Circle& circle :
         detail::voteForCircles(edges, {coarse.width(), coarse.height()}, smallest, kCandidates)) {
        const Outline near{circle.center, circle.radius, glm::dvec2(0.0)};
        const double window = 0.06 * circle.radius + 2.0;
        const std::vector<RimRay> rays = detail::sortEdges(edges, near, kCoarseRays, window);
        const std::optional<Outline> joined =
            detail::consensusCircle(rays, near, window, kCoarseTolerance);
        if (!joined) continue;
        const std::optional<OutlineFit> fit =
            detail::fitOutline(rays, *joined, false, kCoarseTolerance);
        if (fit) candidates.push_back({fit->outline, scoreOf(coarse, *fit, kCoarseRays)});
    }
    std::ranges::stable_sort(candidates, std::greater<>(), &Candidate::score);
    if (candidates.size() > kFinalists) candidates.resize(kFinalists);

    Candidate best;
    for (const Candidate& candidate : candidates) {
        const double radius = candidate.outline.radius;
        const int rays = raysFor(radius);
        const std::optional<OutlineFit> fit =
            searchNear(coarse, candidate.outline, rays, 0.06 * radius + 3.0);
        if (!fit) continue;
        const double score = scoreOf(coarse, *fit, rays);
        const double wanted =
            best.score * (encloses(fit->outline, best.outline)   ? kOuterShare
                          : encloses(best.outline, fit->outline) ? 1.0 / kOuterShare
                                                                 : 1.0);
        if (score > wanted) best = {fit->outline, score};
    }
    if (best.score == 0.0) return std::nullopt;
    return best.outline;
}

/// Full resolution: consensus in windows that shrink, then the rim's model.
std::optional<BallOutline> refineOutline(const OutlinePicture& picture,
                                         Outline outline,
                                         double window,
                                         bool ellipse)
{
    const int rays = raysFor(outline.radius);
    for (;; window *= 0.4) {
        const std::optional<OutlineFit> fit = searchNear(picture, outline, rays, window);
        if (!fit) return std::nullopt;
        outline = fit->outline;
        if (window <= 5.0 || window <= 0.02 * outline.radius) break;
    }
    const double tolerance = toleranceFor(outline.radius);
    const double reach = 4.0 * tolerance;
    const std::vector<RimRay> rim = detail::locateRim(picture, outline, rays, reach);
    std::optional<OutlineFit> fit = detail::fitOutline(rim, outline, ellipse, 0.75 * reach);
    if (fit) fit = detail::fitOutline(rim, fit->outline, ellipse, tolerance);
    if (!fit) return std::nullopt;
    const std::vector<RimRay> close = detail::locateRim(picture, fit->outline, rays, reach);
    fit = detail::fitOutline(close, fit->outline, ellipse, tolerance);
    if (!fit) return std::nullopt;

    BallOutline ball;
    ball.center_px = fit->outline.center;
    ball.radius_px = fit->outline.radius;
    const double e = glm::length(fit->outline.stretch);
    ball.axis_ratio = (1.0 - e) / (1.0 + e);
    ball.axis_angle = 0.5 * std::atan2(fit->outline.stretch.y, fit->outline.stretch.x);
    if (ball.axis_angle < 0.0) ball.axis_angle += pi;
    ball.center_sigma = fit->center_sigma;
    ball.radius_sigma = fit->radius_sigma;
    ball.visible_share = visibleShare(picture, fit->outline);
    ball.inlier_share = shareOfRim(fit->inliers, rays, ball.visible_share, tolerance, reach);
    return ball;
}

Outline outlineOf(const BallOutline& ball)
{
    const double e = (1.0 - ball.axis_ratio) / (1.0 + ball.axis_ratio);
    return {ball.center_px,
            ball.radius_px,
            e * glm::dvec2(std::cos(2.0 * ball.axis_angle), std::sin(2.0 * ball.axis_angle))};
}

/// The given outline, with what the picture says about it.
BallOutline measureGiven(const OutlinePicture& picture, BallOutline ball)
{
    const Outline outline = outlineOf(ball);
    const int rays = raysFor(ball.radius_px);
    const double tolerance = toleranceFor(ball.radius_px);
    const double reach = 4.0 * tolerance;
    int inliers = 0;
    for (const RimRay& ray : detail::locateRim(picture, outline, rays, reach)) {
        for (const detail::RimPoint& point : ray) {
            const glm::dvec2 arm = point.place - outline.center;
            const double off = glm::length(arm) - outline.radiusAt(std::atan2(arm.y, arm.x));
            inliers += std::abs(off) < tolerance;
        }
    }
    ball.visible_share = visibleShare(picture, outline);
    ball.inlier_share = shareOfRim(inliers, rays, ball.visible_share, tolerance, reach);
    return ball;
}

void reportWeak(const BallOutline& ball, Findings& findings)
{
    const double sigma = std::max(ball.center_sigma, ball.radius_sigma);
    if (ball.inlier_share >= kFirmShare && ball.visible_share >= kFirmVisible &&
        sigma <= kFirmSigma * ball.radius_px)
        return;
    findings.push_back(
        {Severity::Warning,
         "ball-outline-weak",
         fmt::format("the ball's outline, centre ({:.1f}, {:.1f}) and radius {:.1f} px, shows in "
                     "{:.0f} % of its visible directions, {:.0f} % of it lie in the picture, and "
                     "it is uncertain by {:.2f} px: check it, or give centre and radius",
                     ball.center_px.x,
                     ball.center_px.y,
                     ball.radius_px,
                     100.0 * ball.inlier_share,
                     100.0 * ball.visible_share,
                     sigma)});
}

BallOutlineResult findIn(const OutlinePicture& picture, const BallOutlineOptions& options)
{
    for (const Finding& finding : options.validate())
        throw InputError("ball outline", finding.message);
    BallOutlineResult result;
    if (options.start && !options.refine) {
        result.outline = measureGiven(picture, *options.start);
    } else if (options.start) {
        const Outline start = outlineOf(*options.start);
        result.outline = refineOutline(
            picture, start, std::max(kStartReach * start.radius, 3.0), options.ellipse);
    } else {
        const int longer = std::max(picture.width(), picture.height());
        const int factor = (longer + kCoarseSide - 1) / kCoarseSide;
        const double smallest = std::max(options.smallest_radius * longer, kSmallestRadius);
        std::optional<Outline> coarse = searchEverywhere(
            picture.reduced(factor), std::max(smallest / factor, kSmallestCoarseRadius));
        if (coarse) {
            coarse->center *= factor;
            coarse->radius *= factor;
            result.outline = refineOutline(picture, *coarse, 3.0 * factor + 2.0, options.ellipse);
        }
    }
    const bool trusted = options.start && !options.refine;
    if (result.outline && !trusted && result.outline->inlier_share < kFoundShare)
        result.outline.reset();
    if (result.outline) {
        reportWeak(*result.outline, result.findings);
    } else {
        result.findings.push_back({Severity::Error,
                                   "ball-not-found",
                                   "no mirror ball's outline was found in the picture: give its "
                                   "centre and radius in pixels"});
    }
    return result;
}

}  // namespace

Findings BallOutlineOptions::validate() const
{
    Findings findings;
    const auto require = [&](bool condition, const std::string& cause) {
        if (!condition) findings.push_back({Severity::Error, "ball-options", cause});
    };
    require(smallest_radius > 0.0 && smallest_radius <= 0.5,
            fmt::format("the smallest radius is {}, must be in (0, 0.5]", smallest_radius));
    require(refine || start, "without a start there is nothing to keep unrefined");
    if (start) {
        require(std::isfinite(start->center_px.x) && std::isfinite(start->center_px.y),
                "the start's centre is not finite");
        require(start->radius_px >= 4.0 && start->radius_px < 1e6,
                fmt::format("the start's radius is {} pixels; at least 4 are needed",
                            start->radius_px));
        require(
            start->axis_ratio >= 0.8 && start->axis_ratio <= 1.0 &&
                std::isfinite(start->axis_angle),
            fmt::format("the start's axes are as {} to 1, must be in [0.8, 1]", start->axis_ratio));
    }
    return findings;
}

BallOutlineResult findBallOutline(const Image<Rgb>& radiance, const BallOutlineOptions& options)
{
    return findIn(OutlinePicture(radiance), options);
}

BallOutlineResult findBallOutline(const Bracket& bracket, const BallOutlineOptions& options)
{
    return findIn(OutlinePicture(bracket), options);
}

}  // namespace insitu
