#include "core/mesh.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

glm::dvec3 rotateY(glm::dvec3 v, double angle_rad)
{
    const double c = std::cos(angle_rad);
    const double s = std::sin(angle_rad);
    return {c * v.x + s * v.z, v.y, -s * v.x + c * v.z};
}

}  // namespace

glm::vec2 texcoordAt(const TriangleMesh& mesh, std::uint32_t triangle, glm::vec2 barycentric)
{
    if (mesh.texcoords.empty()) return glm::vec2(0.0f);
    const glm::uvec3 corner = mesh.triangles[triangle];
    return mesh.texcoords[corner.x] * (1.0f - barycentric.x - barycentric.y) +
           mesh.texcoords[corner.y] * barycentric.x + mesh.texcoords[corner.z] * barycentric.y;
}

BoundingBox boundingBox(const TriangleMesh& mesh)
{
    if (mesh.positions.empty()) return {};
    BoundingBox box{glm::dvec3(mesh.positions[0]), glm::dvec3(mesh.positions[0])};
    for (const glm::vec3& position : mesh.positions) {
        box.min = glm::min(box.min, glm::dvec3(position));
        box.max = glm::max(box.max, glm::dvec3(position));
    }
    return box;
}

std::optional<Finding> extentFinding(const BoundingBox& box_in_metres, const std::string& name)
{
    const glm::dvec3 size = box_in_metres.max - box_in_metres.min;
    const double extent = std::max({size.x, size.y, size.z});
    if (extent >= kMinModelExtent_m && extent <= kMaxModelExtent_m) return std::nullopt;
    return Finding{Severity::Warning,
                   "model-extent-implausible",
                   fmt::format("{}: {:.4g} m across, which is no piece of furniture; is its unit "
                               "another one (centimetres: scale 0.01, millimetres: 0.001)?",
                               name,
                               extent)};
}

glm::dvec3 Placement::apply(glm::dvec3 x_in_model) const
{
    return position_m + rotateY(scale * (x_in_model - pivot_in_model), rotation_y_rad);
}

glm::dmat3 Placement::worldFromModelRotation() const
{
    return {rotateY({1.0, 0.0, 0.0}, rotation_y_rad),
            {0.0, 1.0, 0.0},
            rotateY({0.0, 0.0, 1.0}, rotation_y_rad)};
}

glm::dvec3 bottomCenter(const BoundingBox& box)
{
    return {0.5 * (box.min.x + box.max.x), box.min.y, 0.5 * (box.min.z + box.max.z)};
}

TriangleMesh placed(const TriangleMesh& mesh, const Placement& placement)
{
    INSITU_CHECK(placement.scale > 0.0, "scale {}", placement.scale);
    TriangleMesh result = mesh;
    for (glm::vec3& position : result.positions)
        position = glm::vec3(placement.apply(position));
    for (glm::vec3& normal : result.normals)
        normal = glm::vec3(rotateY(normal, placement.rotation_y_rad));
    return result;
}

Placement relativeTo(const Placement& base, const Placement& placement)
{
    const auto rounded = [](double value, double step) { return std::round(value / step) * step; };
    Placement relative = placement;
    glm::dvec3 way = rotateY(placement.position_m - base.position_m, -base.rotation_y_rad);
    for (int axis = 0; axis < 3; ++axis)
        way[axis] = rounded(way[axis], 1e-6);
    relative.position_m = base.pivot_in_model + way / base.scale;
    relative.scale = placement.scale / base.scale;
    relative.rotation_y_rad = rounded(placement.rotation_y_rad - base.rotation_y_rad, 1e-9);
    return relative;
}

}  // namespace insitu
