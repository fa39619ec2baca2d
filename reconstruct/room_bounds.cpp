#include "reconstruct/room_bounds.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace insitu {

namespace {

/// Corners that miss a wall's plane by less are on it, metres.
constexpr double kFlat = 1e-6;
constexpr std::size_t kFewestFaces = 4;

/// A wall: what it encloses lies where the normal points to.
struct HalfSpace {
    glm::dvec3 on{0.0};
    glm::dvec3 inward{0.0};

    [[nodiscard]] double beyond(glm::dvec3 p) const { return glm::dot(on - p, inward); }
};
using Walls = std::vector<HalfSpace>;

Walls wallsOf(const RoomBox& box)
{
    Walls walls;
    for (int axis = 0; axis < 3; ++axis) {
        glm::dvec3 inward(0.0);
        inward[axis] = 1.0;
        walls.push_back({box.min_m, inward});
        walls.push_back({box.max_m, -inward});
    }
    return walls;
}

/// Every edge belongs to two faces, which run along it in opposite directions.
bool closed(const RoomPrimitive& primitive)
{
    const auto same = [](glm::dvec3 a, glm::dvec3 b) { return glm::distance(a, b) < kFlat; };
    const auto edge = [](const WorldFace& face, std::size_t i) {
        return std::pair(face.corners_m[i], face.corners_m[(i + 1) % face.corners_m.size()]);
    };
    for (const WorldFace& face : primitive.faces)
        for (std::size_t i = 0; i < face.corners_m.size(); ++i) {
            const auto [from, to] = edge(face, i);
            int back = 0;
            for (const WorldFace& other : primitive.faces)
                for (std::size_t k = 0; k < other.corners_m.size(); ++k) {
                    const auto [a, b] = edge(other, k);
                    back += same(a, to) && same(b, from) ? 1 : 0;
                }
            if (back != 1) return false;
        }
    return true;
}

/// Empty when the primitive does not enclose anything, or is not convex.
Walls wallsOf(const RoomPrimitive& primitive)
{
    if (primitive.solid || primitive.two_sided || primitive.faces.size() < kFewestFaces ||
        !closed(primitive))
        return {};
    Walls walls;
    for (const WorldFace& face : primitive.faces) {
        const auto& c = face.corners_m;
        const glm::dvec3 normal = glm::normalize(glm::cross(c[1] - c[0], c[2] - c[0]));
        walls.push_back({c[0], normal});
    }
    for (const HalfSpace& wall : walls)
        for (const WorldFace& face : primitive.faces)
            for (const glm::dvec3 corner : face.corners_m)
                if (!(wall.beyond(corner) < kFlat)) return {};
    return walls;
}

}  // namespace

std::optional<double> reachOutside(const RoomDescription& room,
                                   std::span<const glm::dvec3> points_m)
{
    std::vector<Walls> enclosing;
    for (const RoomBox& box : room.boxes)
        if (!box.solid) enclosing.push_back(wallsOf(box));
    for (const RoomPrimitive& primitive : room.primitives)
        if (Walls walls = wallsOf(primitive); !walls.empty()) enclosing.push_back(std::move(walls));
    if (enclosing.empty()) return std::nullopt;
    double furthest = 0.0;
    for (const glm::dvec3 p : points_m) {
        double least = std::numeric_limits<double>::infinity();
        for (const Walls& walls : enclosing) {
            double out = 0.0;
            for (const HalfSpace& wall : walls)
                out = std::max(out, wall.beyond(p));
            least = std::min(least, out);
        }
        furthest = std::max(furthest, least);
    }
    return furthest;
}

}  // namespace insitu
