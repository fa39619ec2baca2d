#include "capture/ball_picture.h"

#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

namespace insitu::detail {

using std::numbers::pi;

namespace {

/// The outline's outermost pixels mix ball and background. At this distance from it a bilinear
/// look-up takes about 1 % of background; at one pixel it would be 5 %, and at two a quarter more
/// of the sphere would be blind.
constexpr double kRimPixels = 1.25;
/// Difference of predicted and measured outline that is reported, share of the radius.
constexpr double kOutlineTolerance = 0.02;
/// Sub-samples per texel and axis.
constexpr int kFewestPlaces = 2;
constexpr int kMostPlaces = 8;

ProjectedOutline projectOutline(const BallReflection& reflection, const Camera& camera)
{
    constexpr int kPoints = 720;
    std::vector<glm::dvec2> points;
    glm::dvec2 low(std::numeric_limits<double>::max());
    glm::dvec2 high(std::numeric_limits<double>::lowest());
    for (int i = 0; i < kPoints; ++i) {
        const double turn = 2.0 * pi * i / kPoints;
        const glm::dvec3 side =
            std::cos(turn) * reflection.sideA() + std::sin(turn) * reflection.sideB();
        const std::optional<glm::dvec2> point =
            camera.project(reflection.pointAt(reflection.tangentAngle(), side));
        if (!point) throw InputError("light probe", "the ball is not in front of the camera");
        points.push_back(*point);
        low = glm::min(low, *point);
        high = glm::max(high, *point);
    }
    ProjectedOutline outline;
    outline.center = 0.5 * (low + high);
    for (const glm::dvec2 point : points)
        outline.radius += glm::length(point - outline.center) / kPoints;
    return outline;
}

void reportOutline(const ProjectedOutline& predicted, const MirrorBall& ball, Findings& findings)
{
    const double shift = glm::length(predicted.center - ball.center_px);
    const double growth = std::abs(predicted.radius - ball.radius_px);
    if (std::max(shift, growth) <= kOutlineTolerance * ball.radius_px) return;
    findings.push_back(
        {Severity::Warning,
         "probe-outline-mismatch",
         fmt::format("seen by the given camera the ball's outline has centre ({:.1f}, {:.1f}) and "
                     "radius {:.1f} px, measured are ({:.1f}, {:.1f}) and {:.1f} px: check the "
                     "ball's place, its size and the camera; the measured outline is used",
                     predicted.center.x,
                     predicted.center.y,
                     predicted.radius,
                     ball.center_px.x,
                     ball.center_px.y,
                     ball.radius_px)});
}

}  // namespace

void checkBall(const MirrorBall& ball, glm::dvec3 camera_position)
{
    const auto require = [](bool condition, const std::string& cause) {
        if (!condition) throw InputError("light probe", cause);
    };
    require(std::isfinite(ball.radius_px) && ball.radius_px >= 4.0,
            fmt::format("the ball's radius is {} pixels; at least 4 are needed", ball.radius_px));
    require(std::isfinite(ball.radius_m) && ball.radius_m > 0.0,
            fmt::format("the ball's radius is {} m, must be positive", ball.radius_m));
    require(ball.reflectance > 0.0 && ball.reflectance <= 1.0,
            fmt::format("the ball's reflectance is {}, must be in (0, 1]", ball.reflectance));
    const double distance = glm::length(camera_position - ball.center_m);
    require(std::isfinite(distance) && distance > 1.01 * ball.radius_m,
            fmt::format("the camera is {:.3g} m from the middle of a ball of radius {:.3g} m",
                        distance,
                        ball.radius_m));
}

BallPicture::BallPicture(const Image<Rgb>& radiance,
                         const MirrorBall& ball,
                         const Camera& camera,
                         const UnwrapOptions& options,
                         Findings& findings)
    : radiance_(radiance),
      ball_(ball),
      camera_(camera),
      options_(options),
      reflection_(ball.center_m, ball.radius_m, camera.position_m, kRimPixels / ball.radius_px),
      predicted_(projectOutline(reflection_, camera)),
      scale_(ball.radius_px / predicted_.radius),
      rim_cosine_(std::cos(reflection_.lastDirection()))
{
    reportOutline(predicted_, ball, findings);
}

BallPicture::Sample BallPicture::seen(glm::dvec3 direction) const
{
    double distance = std::numeric_limits<double>::infinity();
    if (options_.distance_to_room) distance = options_.distance_to_room(ball_.center_m, direction);
    const BallReflection::Point point = reflection_.pointFor(direction, distance);
    const glm::dvec2 predicted = camera_.project(point.position).value_or(predicted_.center);
    Sample sample;
    sample.pixel =
        ball_.center_px + scale_ * (predicted - predicted_.center) - options_.crop_origin_px;
    sample.blind = point.blind;
    sample.outside = sample.pixel.x < 0.0 || sample.pixel.y < 0.0 ||
                     sample.pixel.x > radiance_.width() || sample.pixel.y > radiance_.height();
    sample.radiance = sampleBilinear(radiance_, sample.pixel.x, sample.pixel.y) /
                      static_cast<float>(ball_.reflectance);
    return sample;
}

int BallPicture::places(glm::dvec3 direction, double texel_radians) const
{
    const double cosine = glm::dot(direction, reflection_.axis());
    const double half = std::sqrt(std::max(0.5 * (1.0 + cosine), 1e-4));
    const double pixels = 0.5 * ball_.radius_px / half * texel_radians;
    return std::clamp(static_cast<int>(std::ceil(pixels)), kFewestPlaces, kMostPlaces);
}

double BallPicture::resolution(glm::dvec3 direction) const
{
    const double above_rim = glm::dot(direction, reflection_.axis()) - rim_cosine_;
    return 0.125 * ball_.radius_px * ball_.radius_px * std::max(above_rim, 0.0);
}

void reportCoverage(const BallPicture& picture, Findings& findings)
{
    constexpr int kWidth = 360;
    constexpr int kHeight = kWidth / 2;
    double blind = 0.0;
    double outside = 0.0;
    for (int y = 0; y < kHeight; ++y) {
        const double share = environmentTexelSolidAngle(kWidth, kHeight, y) / (4.0 * pi);
        for (int x = 0; x < kWidth; ++x) {
            const BallPicture::Sample sample =
                picture.seen(environmentDirectionFromUv({(x + 0.5) / kWidth, (y + 0.5) / kHeight}));
            if (sample.blind) blind += share;
            if (sample.outside) outside += share;
        }
    }
    findings.push_back({Severity::Info,
                        "probe-blind-spot",
                        fmt::format("{:.2f} % of the sphere lies behind the ball or in its rim and "
                                    "was filled from the nearest direction seen",
                                    100.0 * blind)});
    if (outside > 0.0)
        findings.push_back(
            {Severity::Warning,
             "probe-outside-image",
             fmt::format("{:.2f} % of the sphere falls outside the picture: is the whole ball in "
                         "it, and are centre, radius and crop origin right?",
                         100.0 * outside)});
}

}  // namespace insitu::detail
