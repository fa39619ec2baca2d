#pragma once

#include "calib/line_segments.h"
#include "core/camera.h"
#include "core/random.h"

#include <Eigen/Dense>
#include <glm/glm.hpp>
#include <glm/gtc/constants.hpp>

#include <cmath>
#include <optional>
#include <vector>

/// Random rooms for bench/calib_monte_carlo, with the Cramér–Rao bound and the closed form.
namespace insitu::monte_carlo {

inline constexpr int kWidth = 6000;
inline constexpr int kHeight = 4000;
inline constexpr double kFocalPx = 24.0 / 36.0 * kWidth;

struct Room {
    Camera camera;
    LineSet lines;  ///< exact
};

struct Cell {
    double yaw_deg = 25.0;
    bool uprights = true;
    int per_axis = 10;
    glm::dvec2 principal_offset_px{0.0};
};

inline double between(RandomStream& random, double low, double high)
{
    return low + (high - low) * random.uniformDouble();
}

inline Camera randomCamera(const Cell& cell, RandomStream& random)
{
    const double yaw = glm::radians(cell.yaw_deg) * (random.uniformDouble() < 0.5 ? -1.0 : 1.0);
    const double pitch = glm::radians(between(random, -14.0, -6.0));
    const double roll = glm::radians(between(random, -1.5, 1.5));
    const glm::dvec3 forward(
        std::sin(yaw) * std::cos(pitch), std::sin(pitch), -std::cos(yaw) * std::cos(pitch));
    Camera camera = Camera::lookAt(glm::dvec3(0.0), forward, kFocalPx, kWidth, kHeight);
    const glm::dvec3 right = camera.right * std::cos(roll) + camera.up * std::sin(roll);
    camera.up = camera.up * std::cos(roll) - camera.right * std::sin(roll);
    camera.right = right;
    camera.principal_px += cell.principal_offset_px;
    return camera;
}

inline bool inPicture(glm::dvec2 pixel)
{
    return pixel.x > 0.0 && pixel.y > 0.0 && pixel.x < kWidth && pixel.y < kHeight;
}

/// An edge of 1 to 3 m that begins 2 to 5 m away and `part` (of `parts`) across the picture, at
/// least an eighth of its width long.
inline LineSegment randomEdge(
    const Camera& camera, RoomAxis axis, int part, int parts, RandomStream& random)
{
    for (;;) {
        const glm::dvec2 start((part + random.uniformDouble()) * kWidth / parts,
                               between(random, 0.0, kHeight));
        const glm::dvec3 from =
            camera.position_m + camera.rayDirection(start) * between(random, 2.0, 5.0);
        glm::dvec3 direction(0.0);
        direction[static_cast<int>(axis)] = random.uniformDouble() < 0.5 ? -1.0 : 1.0;
        const auto to = camera.project(from + direction * between(random, 1.0, 3.0));
        if (to && inPicture(*to) && glm::length(*to - start) > 0.125 * kWidth)
            return {axis, start, *to};
    }
}

inline Room randomRoom(const Cell& cell, RandomStream& random)
{
    Room room;
    room.camera = randomCamera(cell, random);
    room.lines.width = kWidth;
    room.lines.height = kHeight;
    room.lines.origin_px = {between(random, 0.35, 0.65) * kWidth,
                            between(random, 0.8, 0.95) * kHeight};
    const double height = between(random, 1.2, 1.7);
    const glm::dvec3 ray = room.camera.rayDirection(room.lines.origin_px);
    room.camera.position_m = ray * (height / ray.y);
    room.lines.camera_height_m = height;
    room.lines.camera_height_sigma_m = 0.01;
    for (const RoomAxis axis : {RoomAxis::X, RoomAxis::Y, RoomAxis::Z})
        for (int i = 0; i < cell.per_axis && (axis != RoomAxis::Y || cell.uprights); ++i)
            room.lines.segments.push_back(randomEdge(room.camera, axis, i, cell.per_axis, random));
    return room;
}

/// The room's lines as somebody marks them.
inline LineSet marked(const Room& room, double noise_px, RandomStream& random)
{
    LineSet lines = room.lines;
    const auto shift = [&](glm::dvec2& point) {
        point.x += noise_px * random.normal();
        point.y += noise_px * random.normal();
    };
    for (LineSegment& segment : lines.segments) {
        shift(segment.from_px);
        shift(segment.to_px);
    }
    for (MarkedRectangle& rectangle : lines.rectangles)
        for (glm::dvec2& corner : rectangle.corners_px)
            shift(corner);
    shift(lines.origin_px);
    *lines.camera_height_m += lines.camera_height_sigma_m * random.normal();
    return lines;
}

/// v × (a − b) + v.z a × b with v = K R e_axis: zero when the segment runs along the axis.
inline double incidence(const Camera& camera,
                        const Eigen::Matrix<double, 6, 1>& change,
                        int axis,
                        glm::dvec2 from,
                        glm::dvec2 to)
{
    glm::dvec3 d(camera.right[axis], -camera.up[axis], camera.forward[axis]);
    d += glm::cross(glm::dvec3(change[0], change[1], change[2]), d);
    const double f = camera.focal_px.x * std::exp(change[3]);
    const glm::dvec2 principal = camera.principal_px + glm::dvec2(change[4], change[5]);
    const glm::dvec2 a = from - principal;
    const glm::dvec2 b = to - principal;
    const glm::dvec2 v(f * d.x, f * d.y);
    return v.x * (a - b).y - v.y * (a - b).x + d.z * (a.x * b.y - a.y * b.x);
}

/// Fisher information about (turn, ln f, principal point), everything else about the segments
/// unknown: with q the incidence, Σ ∇θq ∇θqᵀ / (σ² |∇q by the four coordinates|²). Central
/// differences, none of the solver's code.
inline Eigen::Matrix<double, 6, 6> fisher(const Room& room, double noise_px)
{
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    for (const LineSegment& segment : room.lines.segments) {
        const int axis = static_cast<int>(segment.axis);
        Vector6 by_camera;
        for (int i = 0; i < 6; ++i) {
            Vector6 change = Vector6::Zero();
            change[i] = i < 4 ? 1e-6 : 1e-2;
            by_camera[i] = (incidence(room.camera, change, axis, segment.from_px, segment.to_px) -
                            incidence(room.camera, -change, axis, segment.from_px, segment.to_px)) /
                           (2.0 * change[i]);
        }
        double square = 0.0;
        for (int i = 0; i < 4; ++i) {
            double value[2];
            for (int side = 0; side < 2; ++side) {
                glm::dvec2 ends[2] = {segment.from_px, segment.to_px};
                ends[i / 2][i % 2] += side == 0 ? 1e-2 : -1e-2;
                value[side] = incidence(room.camera, Vector6::Zero(), axis, ends[0], ends[1]);
            }
            square += std::pow((value[0] - value[1]) / 2e-2, 2.0);
        }
        information += by_camera * by_camera.transpose() / (square * noise_px * noise_px);
    }
    return information;
}

/// Smallest standard deviation of ln f that an unbiased estimate can have.
inline double focalBound(const Room& room, double noise_px, double principal_sigma_px)
{
    Eigen::Matrix<double, 6, 6> information = fisher(room, noise_px);
    if (principal_sigma_px == 0.0)
        return std::sqrt(information.topLeftCorner<4, 4>().inverse()(3, 3));
    for (int i = 4; i < 6; ++i)
        information(i, i) += 1.0 / (principal_sigma_px * principal_sigma_px);
    return std::sqrt(information.inverse()(3, 3));
}

/// fSpy's kind: of both horizontal axes two segments, meeting in v and w; f² = −(v − c)·(w − c).
/// `best` takes the pair that meets at the largest angle, else the first two.
inline std::optional<double> closedFormFocal(const LineSet& lines, bool best)
{
    glm::dvec3 point[2];
    for (int k = 0; k < 2; ++k) {
        std::vector<glm::dvec3> own;
        for (const LineSegment& segment : lines.segments)
            if (segment.axis == (k == 0 ? RoomAxis::X : RoomAxis::Z))
                own.push_back(
                    glm::cross(glm::dvec3(segment.from_px, 1.0), glm::dvec3(segment.to_px, 1.0)));
        glm::dvec3 found = glm::cross(own[0], own[1]);
        double angle = 0.0;
        for (std::size_t i = 0; best && i < own.size(); ++i)
            for (std::size_t j = i + 1; j < own.size(); ++j) {
                const glm::dvec2 a = glm::normalize(glm::dvec2(own[i]));
                const glm::dvec2 b = glm::normalize(glm::dvec2(own[j]));
                const double sine = std::abs(a.x * b.y - a.y * b.x);
                if (sine <= angle) continue;
                angle = sine;
                found = glm::cross(own[i], own[j]);
            }
        point[k] = found;
    }
    const glm::dvec2 centre(0.5 * lines.width, 0.5 * lines.height);
    const glm::dvec2 v = glm::dvec2(point[0]) / point[0].z - centre;
    const glm::dvec2 w = glm::dvec2(point[1]) / point[1].z - centre;
    const double square = -glm::dot(v, w);
    if (!std::isfinite(square) || square <= 0.0) return std::nullopt;
    return std::sqrt(square);
}

}  // namespace insitu::monte_carlo
