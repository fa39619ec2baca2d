#include "capture/ball_outline.h"

#include "capture/ball_reflection.h"
#include "capture/outline_refine.h"
#include "capture/outline_search.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace insitu {

using std::numbers::pi;

namespace {

using detail::OutlinePicture;

/// How far a given start may be off, share of the radius.
constexpr double kStartReach = 0.12;
/// A circle with fewer edges is no ball; one with fewer than the second is doubtful.
constexpr double kFoundShare = 0.2;
constexpr double kFirmShare = 0.33;
/// Less of the outline than this in the picture is doubtful.
constexpr double kFirmVisible = 0.6;
/// Standard deviation, share of the radius, from which on the outline is doubtful.
constexpr double kFirmSigma = 0.01;

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
    requireValid(options.validate(), "ball outline options");
    BallOutlineResult result;
    if (options.start && !options.refine) {
        result.outline = detail::withShares(picture, *options.start);
    } else if (options.start) {
        const detail::Outline start = detail::outlineOf(*options.start);
        result.outline = detail::approachOutline(
            picture, start, std::max(kStartReach * start.radius, 3.0), options.ellipse);
        if (result.outline)
            result.outline = detail::refineOutline(
                picture, *result.outline, options.ellipse && start.stretch == glm::dvec2(0.0));
    } else {
        result.outline = detail::searchPicture(picture, options);
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
