#pragma once

#include "capture/light_probe.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

/// Pictures of mirror balls traced ray by ray: forwards, camera to ball to surroundings, so that
/// they share nothing with the search for reflecting points that they judge.
namespace insitu {

/// What a ray that leaves the ball, or the camera, at `origin` along `direction` sees.
using Surroundings = std::function<Rgb(glm::dvec3 origin, glm::dvec3 direction)>;

/// `n` x `n` rays a pixel; behind the ball is `background`, or the colour `behind`.
inline Image<Rgb> renderBall(const MirrorBall& ball,
                             const Camera& camera,
                             const Surroundings& surroundings,
                             glm::ivec2 crop = {0, 0},
                             glm::ivec2 size = {0, 0},
                             Rgb behind = Rgb(0.0f),
                             const Surroundings& background = {},
                             int n = 3)
{
    if (size.x == 0) size = {camera.width, camera.height};
    Image<Rgb> image(size.x, size.y);
    parallelFor(0, size.y, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < size.x; ++x) {
            glm::dvec3 sum(0.0);
            for (int k = 0; k < n * n; ++k) {
                const glm::dvec2 pixel(crop.x + x + (k % n + 0.5) / n,
                                       crop.y + y + (k / n + 0.5) / n);
                const glm::dvec3 d = camera.rayDirection(pixel);
                const glm::dvec3 from_center = camera.position_m - ball.center_m;
                const double b = glm::dot(d, from_center);
                const double q = glm::dot(from_center, from_center) - ball.radius_m * ball.radius_m;
                if (b > 0.0 || b * b <= q) {
                    sum += glm::dvec3(background ? background(camera.position_m, d) : behind);
                    continue;
                }
                const glm::dvec3 hit = camera.position_m + d * (-b - std::sqrt(b * b - q));
                const glm::dvec3 normal = (hit - ball.center_m) / ball.radius_m;
                const glm::dvec3 reflected = d - 2.0 * glm::dot(d, normal) * normal;
                sum += ball.reflectance * glm::dvec3(surroundings(hit, reflected));
            }
            image(x, y) = Rgb(sum / static_cast<double>(n * n));
        }
    });
    return image;
}

/// Distance from inside the box of a small room to its walls.
inline constexpr glm::dvec3 kRoomLow(-1.6, 0.0, -2.1);
inline constexpr glm::dvec3 kRoomHigh(1.9, 2.5, 1.7);
inline double distanceToWalls(glm::dvec3 origin, glm::dvec3 direction)
{
    double nearest = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        const double wall = direction[axis] > 0.0 ? kRoomHigh[axis] : kRoomLow[axis];
        if (direction[axis] != 0.0)
            nearest = std::min(nearest, (wall - origin[axis]) / direction[axis]);
    }
    return nearest;
}

/// The room: coloured walls that get lighter upwards, a tiled floor, a lamp in the ceiling, a
/// bright window in the wall at +x.
inline Rgb roomRadiance(glm::dvec3 origin, glm::dvec3 direction)
{
    const glm::dvec3 p = origin + distanceToWalls(origin, direction) * direction;
    constexpr double kNear = 1e-6;
    if (p.y < kRoomLow.y + kNear) {
        const bool odd = (static_cast<int>(std::floor(p.x / 0.4) + std::floor(p.z / 0.4)) & 1) != 0;
        return odd ? Rgb(0.35f, 0.2f, 0.12f) : Rgb(0.6f, 0.45f, 0.3f);
    }
    if (p.y > kRoomHigh.y - kNear) {
        const bool lamp = std::abs(p.x - 0.3) < 0.3 && std::abs(p.z + 0.4) < 0.3;
        return lamp ? Rgb(30.0f, 28.0f, 24.0f) : Rgb(0.9f);
    }
    const float light = 0.4f + 0.3f * static_cast<float>(p.y);
    if (p.x > kRoomHigh.x - kNear) {
        const bool window = p.y > 0.9 && p.y < 2.0 && std::abs(p.z) < 0.6;
        return window ? Rgb(12.0f, 14.0f, 18.0f) : light * Rgb(0.7f, 0.6f, 0.5f);
    }
    if (p.x < kRoomLow.x + kNear) return light * Rgb(0.3f, 0.5f, 0.6f);
    const float picture = std::abs(p.x) < 0.4 && p.y > 1.2 && p.y < 1.8 ? 0.3f : 1.0f;
    return picture * light * (p.z > 0.0 ? Rgb(0.6f, 0.3f, 0.25f) : Rgb(0.55f, 0.6f, 0.4f));
}

/// What a place sees of the surroundings, averaged over 4 x 4 places a texel.
inline EnvironmentMap panorama(const Surroundings& surroundings, glm::dvec3 place, int width)
{
    constexpr int n = 4;
    const int height = width / 2;
    EnvironmentMap map{Image<Rgb>(width, height)};
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            glm::dvec3 sum(0.0);
            for (int k = 0; k < n * n; ++k)
                sum += glm::dvec3(
                    surroundings(place,
                                 environmentDirectionFromUv({(x + (k % n + 0.5) / n) / width,
                                                             (y + (k / n + 0.5) / n) / height})));
            map.pixels(x, y) = Rgb(sum / static_cast<double>(n * n));
        }
    });
    return map;
}

/// A unit vector as a colour, and back: pictures that say where everything came from.
inline Rgb colourOf(glm::dvec3 unit)
{
    return Rgb(0.5 * unit + 0.5);
}
inline glm::dvec3 vectorOf(Rgb colour)
{
    return glm::normalize(2.0 * glm::dvec3(colour) - 1.0);
}

/// The silhouette as an ellipse: middle of its bounding box and half the longest and shortest
/// widths, by projecting the tangent cone.
struct Silhouette {
    glm::dvec2 center{0.0};
    double longer = 0.0;
    double shorter = 0.0;
    double angle = 0.0;  ///< of the longer axis, [0, pi)
};
inline Silhouette silhouetteOf(const MirrorBall& ball, const Camera& camera)
{
    using std::numbers::pi;
    const glm::dvec3 to_camera = camera.position_m - ball.center_m;
    const double distance = glm::length(to_camera);
    const glm::dvec3 axis = to_camera / distance;
    const glm::dvec3 side = glm::normalize(glm::cross(axis, glm::dvec3(0.123, 0.7, -0.5)));
    const glm::dvec3 other = glm::cross(axis, side);
    const double cosine = ball.radius_m / distance;
    const double sine = std::sqrt(1.0 - cosine * cosine);
    std::vector<glm::dvec2> points;
    glm::dvec2 low(1e9);
    glm::dvec2 high(-1e9);
    for (int i = 0; i < 7200; ++i) {
        const double turn = 2.0 * pi * i / 7200;
        const glm::dvec3 normal =
            cosine * axis + sine * (std::cos(turn) * side + std::sin(turn) * other);
        points.push_back(camera.project(ball.center_m + ball.radius_m * normal).value());
        low = glm::min(low, points.back());
        high = glm::max(high, points.back());
    }
    Silhouette result;
    result.center = 0.5 * (low + high);
    result.shorter = 1e9;
    for (const glm::dvec2 point : points) {
        const glm::dvec2 arm = point - result.center;
        result.shorter = std::min(result.shorter, glm::length(arm));
        if (glm::length(arm) <= result.longer) continue;
        result.longer = glm::length(arm);
        result.angle = std::atan2(arm.y, arm.x);
        if (result.angle < 0.0) result.angle += pi;
    }
    return result;
}

}  // namespace insitu
