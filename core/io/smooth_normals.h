#pragma once

#include <glm/glm.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// Polygons before triangulation, as OBJ states them.
struct PolygonSoup {
    std::vector<glm::vec3> positions;
    std::vector<std::uint32_t> corner_position;  ///< index into positions, one a corner
    std::vector<std::uint32_t> face_begin;       ///< first corner of each face, then the end
    std::vector<std::int32_t> face_group;        ///< smoothing group; kFlatGroup = faceted

    [[nodiscard]] std::size_t faceCount() const { return face_group.size(); }
    [[nodiscard]] std::span<const std::uint32_t> corners(std::size_t face) const
    {
        return std::span(corner_position)
            .subspan(face_begin[face], face_begin[face + 1] - face_begin[face]);
    }
};
inline constexpr std::int32_t kFlatGroup = 0;

/// Unit normal of a polygon by Newell's method: exact for planar ones, the average plane of bent
/// ones; zero when the polygon has no area. Source: [Newell72], as given in [Tampieri92].
[[nodiscard]] glm::dvec3 polygonNormal(const PolygonSoup& soup, std::size_t face);

/// One unit normal a corner.
///
/// In a smoothing group: the normals of all polygons of that group that use the same position
/// *index*, weighted by the polygon's angle at the corner [ThuermerWuethrich98]; this is what
/// Blender does for smooth-shaded meshes. Equal coordinates under different indices are not
/// joined. Where the sum vanishes, and in the flat group: the polygon's own normal (zero for a
/// polygon without area).
[[nodiscard]] std::vector<glm::vec3> cornerNormals(const PolygonSoup& soup);

}  // namespace insitu
