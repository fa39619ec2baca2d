#pragma once

#include <glm/glm.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// Cuts polygons of three or more corners into n − 2 triangles of corner numbers, same winding.
///
/// Quadrilaterals along the diagonal 0–2 unless it lies outside, as Blender does; convex polygons
/// as a fan from corner 0; others by ear clipping in the polygon's mean plane [Meisters75].
/// Self-intersecting polygons give some triangulation. The ear tests of all polygons of a file
/// share a budget, so that a hostile file cannot hang: past it, polygons become fans.
class Triangulator {
public:
    /// Appends to `triangles`.
    void triangulate(std::span<const glm::vec3> polygon, std::vector<glm::uvec3>& triangles);
    /// True when some polygon became a fan for want of budget.
    [[nodiscard]] bool gaveUp() const { return ear_tests_left_ < 0; }

private:
    void clipEars(std::span<const glm::dvec2> polygon, std::vector<glm::uvec3>& triangles);
    [[nodiscard]] bool isEar(std::span<const glm::dvec2> polygon,
                             std::span<const std::uint32_t> ring,
                             std::size_t at);

    std::int64_t ear_tests_left_ = 200'000'000;
};

}  // namespace insitu
