#include "core/io/smooth_normals.h"

#include <cmath>
#include <unordered_map>

namespace insitu {

namespace {

glm::dvec3 normalizeOrZero(glm::dvec3 v)
{
    const double length = glm::length(v);
    return length > 0.0 && std::isfinite(length) ? v / length : glm::dvec3(0.0);
}

// Angle between the edges that leave a corner, in [0, pi]; atan2 keeps its precision at both ends.
double cornerAngle(glm::dvec3 previous, glm::dvec3 here, glm::dvec3 next)
{
    const glm::dvec3 a = previous - here;
    const glm::dvec3 b = next - here;
    return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

std::uint64_t vertexKey(std::int32_t group, std::uint32_t position)
{
    return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(group)) << 32) | position;
}

}  // namespace

glm::dvec3 polygonNormal(const PolygonSoup& soup, std::size_t face)
{
    // Relative to the first corner, so that a polygon far from the origin keeps its digits.
    const auto corners = soup.corners(face);
    const glm::dvec3 origin(soup.positions[corners[0]]);
    glm::dvec3 sum(0.0);
    for (std::size_t i = 1; i + 1 < corners.size(); ++i)
        sum += glm::cross(glm::dvec3(soup.positions[corners[i]]) - origin,
                          glm::dvec3(soup.positions[corners[i + 1]]) - origin);
    return normalizeOrZero(sum);
}

std::vector<glm::vec3> cornerNormals(const PolygonSoup& soup)
{
    std::vector<glm::dvec3> face_normals(soup.faceCount());
    std::unordered_map<std::uint64_t, glm::dvec3> sums;
    for (std::size_t face = 0; face < soup.faceCount(); ++face) {
        face_normals[face] = polygonNormal(soup, face);
        if (soup.face_group[face] == kFlatGroup) continue;
        const auto corners = soup.corners(face);
        const std::size_t n = corners.size();
        for (std::size_t i = 0; i < n; ++i) {
            const double angle = cornerAngle(soup.positions[corners[(i + n - 1) % n]],
                                             soup.positions[corners[i]],
                                             soup.positions[corners[(i + 1) % n]]);
            sums.try_emplace(vertexKey(soup.face_group[face], corners[i]), 0.0).first->second +=
                angle * face_normals[face];
        }
    }

    std::vector<glm::vec3> normals;
    normals.reserve(soup.corner_position.size());
    for (std::size_t face = 0; face < soup.faceCount(); ++face)
        for (const std::uint32_t position : soup.corners(face)) {
            glm::dvec3 normal = face_normals[face];
            if (soup.face_group[face] != kFlatGroup) {
                const glm::dvec3 sum = sums.at(vertexKey(soup.face_group[face], position));
                if (glm::length(sum) > 1e-9) normal = glm::normalize(sum);
            }
            normals.emplace_back(normal);
        }
    return normals;
}

}  // namespace insitu
