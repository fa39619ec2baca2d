#pragma once

#include "calib/line_segments.h"
#include "core/camera.h"
#include "core/random.h"

#include <glm/glm.hpp>
#include <glm/gtc/constants.hpp>

#include <cmath>
#include <optional>

namespace insitu::synthetic {

/// A camera in a room, the world's origin on the floor in front of it, and exact segments.
struct Room {
    Camera camera;
    LineSet lines;
};

struct View {
    double yaw_deg = 35.0;
    double pitch_deg = -18.0;
    double roll_deg = 0.0;
    double focal_px = 900.0;
    double height_m = 1.5;
};

inline Camera cameraOf(const View& view)
{
    const double yaw = glm::radians(view.yaw_deg);
    const double pitch = glm::radians(view.pitch_deg);
    const glm::dvec3 forward(
        std::sin(yaw) * std::cos(pitch), std::sin(pitch), -std::cos(yaw) * std::cos(pitch));
    Camera camera = Camera::lookAt(glm::dvec3(0.0), forward, view.focal_px, 1200, 900);
    const double roll = glm::radians(view.roll_deg);
    const glm::dvec3 right = camera.right * std::cos(roll) + camera.up * std::sin(roll);
    camera.up = camera.up * std::cos(roll) - camera.right * std::sin(roll);
    camera.right = right;
    return camera;
}

inline bool inside(const Camera& camera, glm::dvec2 pixel)
{
    return pixel.x > 0.0 && pixel.y > 0.0 && pixel.x < camera.width && pixel.y < camera.height;
}

/// A segment along the axis that starts at a random place 2 to 6 m away and lies in the picture.
inline LineSegment randomSegment(const Camera& camera, RoomAxis axis, RandomStream& random)
{
    for (;;) {
        const glm::dvec2 start(random.uniformDouble() * camera.width,
                               random.uniformDouble() * camera.height);
        const glm::dvec3 from =
            camera.position_m + camera.rayDirection(start) * (2.0 + 4.0 * random.uniformDouble());
        glm::dvec3 direction(0.0);
        direction[static_cast<int>(axis)] = random.uniformDouble() < 0.5 ? -1.0 : 1.0;
        const auto to = camera.project(from + direction * (1.0 + random.uniformDouble()));
        if (to && inside(camera, *to) && glm::length(*to - start) > 120.0)
            return {axis, start, *to};
    }
}

/// `counts` segments along x, y and z.
inline Room makeRoom(const View& view, std::array<int, 3> counts, std::uint64_t seed)
{
    Room room;
    room.camera = cameraOf(view);
    room.lines.width = room.camera.width;
    room.lines.height = room.camera.height;
    room.lines.origin_px = {0.52 * room.camera.width, 0.9 * room.camera.height};
    const glm::dvec3 ray = room.camera.rayDirection(room.lines.origin_px);
    room.camera.position_m = ray * (view.height_m / ray.y);
    room.lines.camera_height_m = view.height_m;
    RandomStream random(seed, 0, 0);
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < counts[static_cast<std::size_t>(axis)]; ++i)
            room.lines.segments.push_back(
                randomSegment(room.camera, static_cast<RoomAxis>(axis), random));
    return room;
}

inline View randomView(RandomStream& random)
{
    const auto between = [&random](double low, double high) {
        return low + (high - low) * random.uniformDouble();
    };
    return {between(15.0, 75.0) * (random.uniformDouble() < 0.5 ? -1.0 : 1.0),
            between(-35.0, -8.0),
            between(-6.0, 6.0),
            between(700.0, 1600.0),
            between(0.8, 2.2)};
}

inline void addNoise(LineSet& lines, double sigma_px, RandomStream& random)
{
    const auto shift = [&](glm::dvec2& point) {
        point.x += sigma_px * random.normal();
        point.y += sigma_px * random.normal();
    };
    for (LineSegment& segment : lines.segments) {
        shift(segment.from_px);
        shift(segment.to_px);
    }
    for (KnownLength& length : lines.lengths) {
        shift(length.from_px);
        shift(length.to_px);
    }
    shift(lines.origin_px);
}

/// Angle in radians between two cameras' rotations.
inline double rotationError(const Camera& a, const Camera& b)
{
    const glm::dmat3 turn =
        glm::transpose(glm::dmat3(a.right, a.up, a.forward)) * glm::dmat3(b.right, b.up, b.forward);
    // The sine from the skew part: exact where the trace's cosine is not.
    const glm::dvec3 skew(
        turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]);
    const double cosine = 0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1.0);
    return std::atan2(0.5 * glm::length(skew), cosine);
}

}  // namespace insitu::synthetic
