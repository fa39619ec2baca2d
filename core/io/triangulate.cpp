#include "core/io/triangulate.h"

#include <cmath>
#include <numeric>

namespace insitu {

namespace {

double cross(glm::dvec2 a, glm::dvec2 b)
{
    return a.x * b.y - a.y * b.x;
}

// Twice the signed area; > 0 for a left turn.
double turn(glm::dvec2 a, glm::dvec2 b, glm::dvec2 c)
{
    return cross(b - a, c - a);
}

glm::dvec3 areaVector(std::span<const glm::vec3> polygon)
{
    const glm::dvec3 origin(polygon[0]);
    glm::dvec3 sum(0.0);
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
        sum += glm::cross(glm::dvec3(polygon[i]) - origin, glm::dvec3(polygon[i + 1]) - origin);
    return sum;
}

// Drops the axis along which the polygon is widest seen; counter-clockwise stays so.
std::vector<glm::dvec2> project(std::span<const glm::vec3> polygon)
{
    const glm::dvec3 normal = areaVector(polygon);
    const glm::dvec3 size = glm::abs(normal);
    const int drop = size.x > size.y && size.x > size.z ? 0 : (size.y > size.z ? 1 : 2);
    const int first = normal[drop] < 0.0 ? (drop + 2) % 3 : (drop + 1) % 3;
    const int second = normal[drop] < 0.0 ? (drop + 1) % 3 : (drop + 2) % 3;
    std::vector<glm::dvec2> flat;
    flat.reserve(polygon.size());
    for (const glm::vec3& p : polygon)
        flat.emplace_back(static_cast<double>(p[first]) - polygon[0][first],
                          static_cast<double>(p[second]) - polygon[0][second]);
    return flat;
}

// A simple polygon whose fan from corner 0 has no triangle of the wrong turn is that fan: it is
// convex, or at least seen wholly from corner 0.
bool fanFits(std::span<const glm::dvec2> polygon)
{
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
        if (turn(polygon[0], polygon[i], polygon[i + 1]) < 0.0) return false;
    return true;
}

void fan(std::uint32_t count, std::vector<glm::uvec3>& triangles)
{
    for (std::uint32_t i = 1; i + 1 < count; ++i)
        triangles.emplace_back(0, i, i + 1);
}

// [BlenderLib] is_quad_flip_v3: the diagonal 0-2 folds when its two triangles face apart.
bool diagonalFolds(std::span<const glm::vec3> quad)
{
    const glm::dvec3 a(quad[0]);
    const glm::dvec3 diagonal = glm::dvec3(quad[2]) - a;
    return glm::dot(glm::cross(glm::dvec3(quad[1]) - a, diagonal),
                    glm::cross(diagonal, glm::dvec3(quad[3]) - a)) < 0.0;
}

}  // namespace

void Triangulator::triangulate(std::span<const glm::vec3> polygon,
                               std::vector<glm::uvec3>& triangles)
{
    if (polygon.size() == 4 && diagonalFolds(polygon)) {
        triangles.emplace_back(0, 1, 3);
        triangles.emplace_back(1, 2, 3);
        return;
    }
    if (polygon.size() > 4) {
        const std::vector<glm::dvec2> flat = project(polygon);
        if (!fanFits(flat)) return clipEars(flat, triangles);
    }
    fan(static_cast<std::uint32_t>(polygon.size()), triangles);
}

bool Triangulator::isEar(std::span<const glm::dvec2> polygon,
                         std::span<const std::uint32_t> ring,
                         std::size_t at)
{
    --ear_tests_left_;
    const std::size_t n = ring.size();
    const std::size_t before = (at + n - 1) % n;
    const std::size_t after = (at + 1) % n;
    const glm::dvec2 a = polygon[ring[before]];
    const glm::dvec2 b = polygon[ring[at]];
    const glm::dvec2 c = polygon[ring[after]];
    if (!(turn(a, b, c) > 0.0)) return false;
    for (std::size_t i = 0; i < n; ++i) {
        if (i == before || i == at || i == after) continue;
        --ear_tests_left_;
        const glm::dvec2 p = polygon[ring[i]];
        if (p == a || p == b || p == c) continue;
        if (turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) return false;
    }
    return true;
}

void Triangulator::clipEars(std::span<const glm::dvec2> polygon, std::vector<glm::uvec3>& triangles)
{
    std::vector<std::uint32_t> ring(polygon.size());
    std::iota(ring.begin(), ring.end(), 0u);
    while (ring.size() > 3 && ear_tests_left_ >= 0) {
        // No ear (self-intersecting or collinear): cut the first corner, so that it ends.
        std::size_t ear = 0;
        for (std::size_t i = 0; i < ring.size(); ++i)
            if (isEar(polygon, ring, i)) {
                ear = i;
                break;
            }
        const std::size_t n = ring.size();
        triangles.emplace_back(ring[(ear + n - 1) % n], ring[ear], ring[(ear + 1) % n]);
        ear_tests_left_ -= static_cast<std::int64_t>(n / 16);  // what the erasure moves
        ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    for (std::size_t i = 1; i + 1 < ring.size(); ++i)
        triangles.emplace_back(ring[0], ring[i], ring[i + 1]);
}

}  // namespace insitu
