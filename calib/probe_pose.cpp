#include "calib/probe_pose.h"

#include "calib/camera_errors.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace insitu {

namespace {

constexpr double kWeakDistance = 0.05;
constexpr double kFloorSigmas = 3.0;
constexpr int kNewtonSteps = 40;
constexpr int kHalvings = 20;
/// Of the outline, shares of the focal length.
constexpr double kConverged = 1e-13;
constexpr double kNearEnough = 1e-9;

/// Outline centre relative to the principal point, and mean half axis, pixels of a pinhole.
using Outline = glm::dvec3;

/// The outline of a ball at `center` in the camera's frame. The cone of the rays that touch it is
/// (x·c)² = (|c|² − R²) |x|²; with x = (u/f, v/f, 1) that is a conic in the picture whose centre
/// and axes are the formulas of the header. Nothing when the ball is not wholly in front.
std::optional<Outline> outlineOf(glm::dvec3 center, double radius_m, double focal_px)
{
    const double distance = glm::length(center);
    if (!(distance > radius_m)) return std::nullopt;
    const double sine = radius_m / distance;    // of α
    const double cosine = center.z / distance;  // of θ
    const double q = cosine * cosine - sine * sine;
    if (!(q > 0.0) || !(cosine > 0.0)) return std::nullopt;
    const double aside = std::hypot(center.x, center.y);
    const double out = focal_px * (aside / distance) * cosine / q;
    const double along = focal_px * sine * std::sqrt(1.0 - sine * sine) / q;
    const double across = focal_px * sine / std::sqrt(q);
    const glm::dvec2 direction = aside > 0.0 ? glm::dvec2(center) / aside : glm::dvec2(1.0, 0.0);
    return Outline(direction * out, 0.5 * (along + across));
}

/// Derivative of the outline by the ball's centre, central differences.
std::optional<glm::dmat3> slopeAt(glm::dvec3 center, double radius_m, double focal_px)
{
    glm::dmat3 slope(0.0);
    const double step = 1e-6 * glm::length(center);
    for (int k = 0; k < 3; ++k) {
        glm::dvec3 moved(0.0);
        moved[k] = step;
        const auto high = outlineOf(center + moved, radius_m, focal_px);
        const auto low = outlineOf(center - moved, radius_m, focal_px);
        if (!high || !low) return std::nullopt;
        slope[k] = (*high - *low) / (2.0 * step);
    }
    return slope;
}

/// The ball's centre in the camera's frame: Newton's method from the paraxial answer, with steps
/// halved until they lead nearer.
std::optional<glm::dvec3> centerOf(const Outline& seen, double radius_m, double focal_px)
{
    const glm::dvec2 off(seen);
    const double angle = std::atan(seen.z / std::hypot(focal_px, glm::length(off)));
    glm::dvec3 center =
        glm::normalize(glm::dvec3(off / focal_px, 1.0)) * (radius_m / std::sin(angle));
    auto outline = outlineOf(center, radius_m, focal_px);
    for (int i = 0; i < kNewtonSteps && !outline; ++i) {
        center *= 1.3;  // so far off the axis only a smaller ball is wholly in front
        outline = outlineOf(center, radius_m, focal_px);
    }
    for (int i = 0; i < kNewtonSteps && outline; ++i) {
        const glm::dvec3 miss = seen - *outline;
        if (glm::length(miss) < kConverged * focal_px) return center;
        const auto slope = slopeAt(center, radius_m, focal_px);
        if (!slope) return std::nullopt;
        glm::dvec3 step = glm::inverse(*slope) * miss;
        if (!std::isfinite(glm::length(step))) return std::nullopt;
        auto next = outlineOf(center + step, radius_m, focal_px);
        for (int half = 0;
             half < kHalvings && !(next && glm::length(seen - *next) < glm::length(miss));
             ++half) {
            step *= 0.5;
            next = outlineOf(center + step, radius_m, focal_px);
        }
        // No step leads nearer: as near as the differences of doubles can tell, or there is none.
        if (!next || glm::length(seen - *next) >= glm::length(miss)) {
            if (glm::length(miss) < kNearEnough * focal_px) return center;
            return std::nullopt;
        }
        center += step;
        outline = next;
    }
    return std::nullopt;
}

void check(const SeenBall& ball, const std::string& source)
{
    const auto positive = [&](double value, const char* name) {
        if (!std::isfinite(value) || !(value > 0.0))
            throw InputError(source, name, fmt::format("is {}, must be positive", value));
    };
    const auto deviation = [&](double value, const char* name) {
        if (!std::isfinite(value) || value < 0.0)
            throw InputError(source, name, fmt::format("is {}, must not be negative", value));
    };
    if (!std::isfinite(ball.center_px.x) || !std::isfinite(ball.center_px.y))
        throw InputError(source, "center_px", "must be finite");
    positive(ball.radius_px, "radius_px");
    positive(ball.radius_m, "radius_m");
    deviation(ball.center_sigma_px, "center_sigma_px");
    deviation(ball.radius_sigma_px, "radius_sigma_px");
    deviation(ball.radius_sigma_m, "radius_sigma_m");
}

/// The outline as a lens without distortion would show it: its centre moved, its radius stretched
/// as the picture is there.
Outline straightOutline(const Camera& camera, const SeenBall& ball)
{
    const glm::dvec2 center = camera.straightened(ball.center_px);
    double stretched = 0.0;
    for (const glm::dvec2 way : {glm::dvec2(1, 0), {0, 1}, {-1, 0}, {0, -1}})
        stretched +=
            0.25 * glm::length(camera.straightened(ball.center_px + way * ball.radius_px) - center);
    return {center - camera.principal_px, stretched};
}

glm::dmat3 outer(glm::dvec3 v)
{
    return glm::outerProduct(v, v);
}

/// Covariance in the camera's frame of outline and size.
glm::dmat3 covarianceOf(const SeenBall& ball, glm::dvec3 center, double focal_px)
{
    const glm::dmat3 by_outline = glm::inverse(*slopeAt(center, ball.radius_m, focal_px));
    const double s2 = ball.center_sigma_px * ball.center_sigma_px;
    glm::dmat3 sum = s2 * (outer(by_outline[0]) + outer(by_outline[1])) +
                     ball.radius_sigma_px * ball.radius_sigma_px * outer(by_outline[2]);
    // The whole scene grows with the ball.
    sum += outer(center * (ball.radius_sigma_m / ball.radius_m));
    return sum;
}

double focalOf(const Camera& camera)
{
    return 0.5 * (camera.focal_px.x + camera.focal_px.y);
}

/// The ball's centre in the camera's frame.
glm::dvec3 centerBefore(const Camera& camera, const SeenBall& ball, const std::string& source)
{
    const auto center = centerOf(straightOutline(camera, ball), ball.radius_m, focalOf(camera));
    if (!center)
        throw NoAnswerError(source,
                            fmt::format("no ball in front of the camera has the outline of {:.1f} "
                                        "px about ({:.1f}, {:.1f})",
                                        ball.radius_px,
                                        ball.center_px.x,
                                        ball.center_px.y));
    return *center;
}

glm::dmat3 worldFromCamera(const Camera& camera)
{
    return {camera.right, -camera.up, camera.forward};
}

}  // namespace

BallPlace placeBall(const CameraEstimate& estimate, const SeenBall& ball, const std::string& source)
{
    check(ball, source);
    const Camera& camera = estimate.camera;
    const glm::dvec3 center = centerBefore(camera, ball, source);
    const glm::dmat3 world_from_camera = worldFromCamera(camera);
    BallPlace place;
    place.center_m = camera.position_m + world_from_camera * center;
    place.distance_m = glm::length(center);
    const glm::dmat3 by_outline = covarianceOf(ball, center, focalOf(camera));
    const glm::dmat3 by_camera = covarianceFromCamera(
        estimate, [&](const Camera& other) { return centerBefore(other, ball, source); });
    const glm::dvec3 ray = center / place.distance_m;
    place.distance_sigma_m = std::sqrt(glm::dot(ray, (by_outline + by_camera) * ray));
    place.covariance =
        world_from_camera * by_outline * glm::transpose(world_from_camera) +
        covarianceFromCamera(estimate, [&](const Camera& other) {
            return other.position_m + worldFromCamera(other) * centerBefore(other, ball, source);
        });
    for (int k = 0; k < 3; ++k)
        place.sigma_m[k] = std::sqrt(place.covariance[k][k]);
    if (place.distance_sigma_m > kWeakDistance * place.distance_m)
        place.findings.push_back(
            {Severity::Warning,
             "probe-place-weak",
             fmt::format("the ball is {:.2f} ± {:.2f} m away: its outline of {:.1f} ± {:.2f} px is "
                         "too small or uncertain",
                         place.distance_m,
                         place.distance_sigma_m,
                         ball.radius_px,
                         ball.radius_sigma_px)});
    const double lowest = place.center_m.y - ball.radius_m;
    if (lowest < -kFloorSigmas * place.sigma_m.y)
        place.findings.push_back(
            {Severity::Warning,
             "probe-below-floor",
             fmt::format("the ball would reach {:.2f} m below the floor: check its radius ({} m) "
                         "and the camera's height",
                         -lowest,
                         ball.radius_m)});
    return place;
}

}  // namespace insitu
