#include "capture/ball_outline.h"

#include "capture/ball_reflection.h"
#include "capture/outline_fit.h"
#include "capture/outline_picture.h"
#include "capture/outline_rim.h"
#include "capture/outline_vote.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
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
constexpr int kMostCoarseRays = 360;
constexpr int kFewestRays = 180;
constexpr int kMostRays = 480;
/// In the reduced picture: distance of an edge from its circle, and the power of the radius that
/// circles gain by being large.
constexpr double kCoarseTolerance = 1.5;
/// An ellipse of axes 1.2 : 1 leaves its circle by 4.5 % of the radius.
constexpr double kEllipseBand = 0.045;
constexpr double kEllipseTolerance = 0.02;
constexpr double kSizeBonus = 0.2;
/// A circle around another one needs only this share of its score: one a little larger than what
/// runs along its rim, one much larger than a lamp that it mirrors.
constexpr double kRimShare = 0.85;
constexpr double kLampShare = 0.6;
constexpr double kOuterGrowth = 1.2;
constexpr double kOuterSlack = 0.03;
/// How far a given start may be off, share of the radius.
constexpr double kStartReach = 0.12;
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
/// Candidates looked at in full resolution.
constexpr std::size_t kFinalists = 5;
/// A circle with fewer edges is no ball; one with fewer than the second is doubtful.
constexpr double kFoundShare = 0.2;
constexpr double kFirmShare = 0.33;
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
        for (detail::RimPoint& point : ray)
            point.place =
                near.center + scaled(point.place - near.center, 1.0 / (1.0 + e), 1.0 / (1.0 - e));
    std::optional<Outline> found = detail::consensusCircle(rays, near, reach, tolerance);
    if (!found) return std::nullopt;
    found->center = near.center + scaled(found->center - near.center, 1.0 + e, 1.0 - e);
    found->stretch = near.stretch;
    return found;
}

/// Edges in a window about the outline, joined by consensus, then fitted. The consensus is of a
/// circle; an ellipse is looked for in a band about it as wide as ellipses need.
std::optional<OutlineFit> searchNear(
    const OutlinePicture& picture, const Outline& near, int rays, double window, bool ellipse)
{
    const double sigma = std::max(window / 10.0, 1.0);
    const std::vector<RimRay> edges = detail::scanEdges(picture, near, rays, window, sigma);
    const double fine = 2.0 * sigma;
    if (!ellipse) {
        const std::optional<Outline> circle =
            detail::consensusCircle(edges, near, window, 1.5 * sigma);
        if (!circle) return std::nullopt;
        return detail::fitOutline(edges, *circle, false, {fine, fine});
    }
    const double band = std::max(fine, kEllipseBand * near.radius);
    const std::optional<Outline> circle = near.stretch == glm::dvec2(0.0)
                                              ? detail::consensusCircle(edges, near, window, band)
                                              : consensusOfShape(edges, near, window, 1.5 * sigma);
    if (!circle) return std::nullopt;
    const std::optional<OutlineFit> wide = detail::fitOutline(edges, *circle, true, {band, band});
    if (!wide) return std::nullopt;
    return detail::fitOutline(edges, wide->outline, true, {fine, fine});
}

/// A circle of the reduced picture, and how well its edges speak for it.
struct Candidate {
    Outline outline;
    double score = 0.0;
};

/// Two circles that the full picture would not tell apart.
bool isNear(const Outline& a, const Outline& b)
{
    return glm::length(a.center - b.center) < 1.5 && std::abs(a.radius - b.radius) < 1.5;
}

/// The share of the score of `inner` that `outer` needs to be preferred: 1 unless it holds it. What
/// a ball mirrors, lamps and whatever runs along its rim, makes circles inside it, but none around.
double handicap(const BallOutline& outer, const BallOutline& inner)
{
    const double growth = outer.radius_px - inner.radius_px;
    const double slack = kOuterSlack * inner.radius_px;
    if (growth <= 0.0 || glm::length(outer.center_px - inner.center_px) > growth + slack)
        return 1.0;
    return outer.radius_px < kOuterGrowth * inner.radius_px ? kRimShare : kLampShare;
}

/// The circles that the reduced picture's edges vote for, in its pixels, judged by what long arcs
/// show; best first.
std::vector<Candidate> searchEverywhere(const OutlinePicture& coarse, double smallest, bool ellipse)
{
    const std::vector<detail::Edge> edges = detail::thinEdges(coarse);
    std::vector<Candidate> candidates;
    for (const Circle& circle :
         detail::voteForCircles(edges, {coarse.width(), coarse.height()}, smallest, kCandidates)) {
        const Outline near{circle.center, circle.radius, glm::dvec2(0.0)};
        const double window = 0.06 * circle.radius + 2.0;
        const std::vector<RimRay> sorted = detail::sortEdges(edges, near, kCoarseRays, window);
        const std::optional<Outline> joined =
            detail::consensusCircle(sorted, near, window, kCoarseTolerance);
        if (!joined) continue;
        const int rays = std::min(raysFor(joined->radius), kMostCoarseRays);
        const std::optional<OutlineFit> fit =
            searchNear(coarse, *joined, rays, window + 1.0, ellipse);
        if (!fit || !coarse.contains(fit->outline.center)) continue;
        const auto same = [&](const Candidate& other) {
            return isNear(other.outline, fit->outline);
        };
        if (std::ranges::none_of(candidates, same))
            candidates.push_back(
                {fit->outline, fit->support / rays * std::pow(fit->outline.radius, kSizeBonus)});
    }
    std::ranges::stable_sort(candidates, std::greater<>(), &Candidate::score);
    return candidates;
}

Outline outlineOf(const BallOutline& ball)
{
    const double e = (1.0 - ball.axis_ratio) / (1.0 + ball.axis_ratio);
    return {ball.center_px,
            ball.radius_px,
            e * glm::dvec2(std::cos(2.0 * ball.axis_angle), std::sin(2.0 * ball.axis_angle))};
}

/// The outline, with what the picture says about it.
BallOutline withShares(const OutlinePicture& picture, BallOutline ball)
{
    const Outline outline = outlineOf(ball);
    const int rays = raysFor(ball.radius_px);
    const double tolerance = toleranceFor(ball.radius_px);
    const double reach = kReachTolerances * tolerance;
    int inliers = 0;
    for (const RimRay& ray : detail::locateRim(picture, outline, rays, reach)) {
        for (const detail::RimPoint& point : ray) {
            const glm::dvec2 arm = point.place - outline.center;
            const double off = glm::length(arm) - outline.radiusAt(std::atan2(arm.y, arm.x));
            inliers += std::abs(off) < tolerance;
        }
    }
    ball.visible_share = visibleShare(picture, outline);
    ball.inlier_share = shareOfRim(inliers, rays, ball.visible_share);
    return ball;
}

/// A fit to the places of the rim; `inside_share` of the tolerance counts inside the curve.
std::optional<OutlineFit> fitRim(const OutlinePicture& picture,
                                 const Outline& near,
                                 bool ellipse,
                                 double tolerance,
                                 double inside_share)
{
    const std::vector<RimRay> rim =
        detail::locateRim(picture, near, raysFor(near.radius), kReachTolerances * tolerance);
    const std::optional<OutlineFit> fit =
        detail::fitOutline(rim, near, ellipse, {2.0 * tolerance, 2.0 * tolerance});
    if (!fit) return std::nullopt;
    return detail::fitOutline(rim, fit->outline, ellipse, {inside_share * tolerance, tolerance});
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

/// Full resolution: consensus in windows that shrink, then the rim's model.
std::optional<BallOutline> refineOutline(const OutlinePicture& picture,
                                         Outline outline,
                                         double window,
                                         bool ellipse)
{
    for (;; window *= 0.4) {
        const std::optional<OutlineFit> fit =
            searchNear(picture, outline, raysFor(outline.radius), window, ellipse);
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
    return outer.inlier_share >= kOuterEdgeShare * middle.inlier_share ? outer : middle;
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

/// The best of the reduced picture's candidates at full resolution.
std::optional<BallOutline> searchPicture(const OutlinePicture& picture,
                                         const BallOutlineOptions& options)
{
    const int longer = std::max(picture.width(), picture.height());
    const int factor = (longer + kCoarseSide - 1) / kCoarseSide;
    const double smallest = std::max(options.smallest_radius * longer, kSmallestRadius);
    std::vector<Candidate> candidates =
        searchEverywhere(picture.reduced(factor),
                         std::max(smallest / factor, kSmallestCoarseRadius),
                         options.ellipse);
    if (candidates.size() > kFinalists) candidates.resize(kFinalists);
    std::optional<BallOutline> best;
    double most = 0.0;
    for (const Candidate& candidate : candidates) {
        Outline start = candidate.outline;
        start.center *= factor;
        start.radius *= factor;
        const std::optional<BallOutline> ball =
            refineOutline(picture, start, 3.0 * factor + 2.0, options.ellipse);
        if (!ball) continue;
        const double score =
            ball->inlier_share * ball->visible_share * std::pow(ball->radius_px, kSizeBonus);
        const double wanted = best ? most * handicap(*ball, *best) / handicap(*best, *ball) : 0.0;
        if (score <= wanted) continue;
        most = score;
        best = ball;
    }
    return best;
}

BallOutlineResult findIn(const OutlinePicture& picture, const BallOutlineOptions& options)
{
    for (const Finding& finding : options.validate())
        throw InputError("ball outline", finding.message);
    BallOutlineResult result;
    if (options.start && !options.refine) {
        result.outline = withShares(picture, *options.start);
    } else if (options.start) {
        const Outline start = outlineOf(*options.start);
        result.outline = refineOutline(
            picture, start, std::max(kStartReach * start.radius, 3.0), options.ellipse);
    } else {
        result.outline = searchPicture(picture, options);
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

BallOutline predictBallOutline(glm::dvec3 center_m, double radius_m, const Camera& camera)
{
    const double distance = glm::length(camera.position_m - center_m);
    if (!(radius_m > 0.0 && std::isfinite(distance) && distance > radius_m))
        throw InputError("ball outline",
                         fmt::format("the camera is {:.3g} m from the middle of a ball of radius "
                                     "{:.3g} m",
                                     distance,
                                     radius_m));
    const detail::BallReflection ball(center_m, radius_m, camera.position_m, 0.0);
    std::vector<glm::dvec2> points;
    glm::dvec2 low(std::numeric_limits<double>::max());
    glm::dvec2 high(std::numeric_limits<double>::lowest());
    constexpr int kPoints = 3600;
    for (int i = 0; i < kPoints; ++i) {
        const glm::dvec2 turn = detail::rayDirection(i, kPoints);
        const std::optional<glm::dvec2> point = camera.project(
            ball.pointAt(ball.tangentAngle(), turn.x * ball.sideA() + turn.y * ball.sideB()));
        if (!point) throw InputError("ball outline", "the ball is not in front of the camera");
        points.push_back(*point);
        low = glm::min(low, *point);
        high = glm::max(high, *point);
    }
    BallOutline outline;
    outline.center_px = 0.5 * (low + high);
    const auto arm = [&](glm::dvec2 point) { return glm::length(point - outline.center_px); };
    const auto [shorter, longer] = std::ranges::minmax(points, {}, arm);
    outline.radius_px = 0.5 * (arm(shorter) + arm(longer));
    outline.axis_ratio = arm(shorter) / arm(longer);
    const glm::dvec2 axis = longer - outline.center_px;
    outline.axis_angle = std::atan2(axis.y, axis.x);
    if (outline.axis_angle < 0.0) outline.axis_angle += pi;
    return outline;
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
