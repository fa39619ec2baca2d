#include "core/check.h"
#include "core/mesh.h"

#include <cmath>
#include <limits>

namespace insitu {

namespace {

// A triangle whose height is below this part of its longest edge is a line in float coordinates.
constexpr double kMinHeightToEdge = 1e-7;
// A stated normal this far from unit length was meant; beyond, the file is at fault.
constexpr float kNormalLengthTolerance = 1e-2f;

bool isFinite(glm::vec3 v)
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void checkArrays(const TriangleMesh& mesh, std::size_t materials, const std::string& path)
{
    const std::size_t count = mesh.positions.size();
    if (mesh.triangles.empty()) throw InputError(path, "has no triangles");
    if (!mesh.normals.empty() && mesh.normals.size() != count)
        throw InputError(path,
                         fmt::format("{} normals for {} vertices", mesh.normals.size(), count));
    if (!mesh.texcoords.empty() && mesh.texcoords.size() != count)
        throw InputError(
            path,
            fmt::format("{} texture coordinates for {} vertices", mesh.texcoords.size(), count));
    if (mesh.material_of.size() != mesh.triangles.size())
        throw InputError(path,
                         fmt::format("{} material numbers for {} triangles",
                                     mesh.material_of.size(),
                                     mesh.triangles.size()));
    for (const std::uint32_t material : mesh.material_of)
        if (material >= materials)
            throw InputError(path, fmt::format("material {} of {}", material, materials));
    for (const glm::uvec3& triangle : mesh.triangles)
        for (int i = 0; i < 3; ++i)
            if (triangle[i] >= count)
                throw InputError(
                    path,
                    fmt::format("a triangle names vertex {} of {}; the file is damaged",
                                triangle[i],
                                count));
}

void checkValues(const TriangleMesh& mesh, const std::string& path)
{
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
        if (!isFinite(mesh.positions[i]))
            throw InputError(path, fmt::format("vertex {} is not finite; the file is damaged", i));
    for (std::size_t i = 0; i < mesh.texcoords.size(); ++i)
        if (!std::isfinite(mesh.texcoords[i].x) || !std::isfinite(mesh.texcoords[i].y))
            throw InputError(
                path, fmt::format("texture coordinate {} is not finite; the file is damaged", i));
}

/// Twice the area times the normal, in double so that float coordinates cannot overflow.
glm::dvec3 areaVector(const TriangleMesh& mesh, const glm::uvec3& triangle)
{
    const glm::dvec3 a(mesh.positions[triangle[0]]);
    return glm::cross(glm::dvec3(mesh.positions[triangle[1]]) - a,
                      glm::dvec3(mesh.positions[triangle[2]]) - a);
}

bool isDegenerate(const TriangleMesh& mesh, const glm::uvec3& triangle)
{
    const glm::dvec3 a(mesh.positions[triangle[0]]);
    const glm::dvec3 b(mesh.positions[triangle[1]]);
    const glm::dvec3 c(mesh.positions[triangle[2]]);
    const double longest =
        std::max({glm::distance(a, b), glm::distance(b, c), glm::distance(c, a)});
    return !(glm::length(areaVector(mesh, triangle)) > kMinHeightToEdge * longest * longest);
}

void dropDegenerate(Model& model, const std::string& path)
{
    TriangleMesh& mesh = model.mesh;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        if (isDegenerate(mesh, mesh.triangles[i])) continue;
        mesh.triangles[kept] = mesh.triangles[i];
        mesh.material_of[kept] = mesh.material_of[i];
        ++kept;
    }
    const std::size_t dropped = mesh.triangles.size() - kept;
    if (kept == 0)
        throw InputError(path,
                         fmt::format("has no triangles: all {} are points or lines", dropped));
    mesh.triangles.resize(kept);
    mesh.material_of.resize(kept);
    if (dropped > 0)
        model.findings.push_back(
            {Severity::Info,
             "mesh-degenerate-triangles",
             fmt::format("{}: {} of {} triangles have no area and are left out",
                         path,
                         dropped,
                         dropped + kept)});
}

// Vertices that no triangle uses would count in the bounding box, hence in where a model stands.
void dropUnusedVertices(TriangleMesh& mesh)
{
    constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> new_index(mesh.positions.size(), kUnused);
    for (const glm::uvec3& triangle : mesh.triangles)
        for (int i = 0; i < 3; ++i)
            new_index[triangle[i]] = 0;
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < new_index.size(); ++i) {
        if (new_index[i] == kUnused) continue;
        mesh.positions[count] = mesh.positions[i];
        if (!mesh.normals.empty()) mesh.normals[count] = mesh.normals[i];
        if (!mesh.texcoords.empty()) mesh.texcoords[count] = mesh.texcoords[i];
        new_index[i] = count++;
    }
    mesh.positions.resize(count);
    if (!mesh.normals.empty()) mesh.normals.resize(count);
    if (!mesh.texcoords.empty()) mesh.texcoords.resize(count);
    for (glm::uvec3& triangle : mesh.triangles)
        triangle = {new_index[triangle.x], new_index[triangle.y], new_index[triangle.z]};
}

// A normal without direction is replaced by the area-weighted mean of the vertex's triangles.
void repairNormals(Model& model, const std::string& path)
{
    TriangleMesh& mesh = model.mesh;
    if (mesh.normals.empty()) return;
    std::vector<glm::dvec3> means(mesh.positions.size(), glm::dvec3(0.0));
    for (const glm::uvec3& triangle : mesh.triangles)
        for (int i = 0; i < 3; ++i)
            means[triangle[i]] += areaVector(mesh, triangle);
    std::size_t repaired = 0;
    for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
        const glm::dvec3 stated(mesh.normals[i]);
        const double length = glm::length(stated);
        const bool has_direction = std::isfinite(length) && length > 1e-6;
        if (!has_direction || std::abs(length - 1.0) > kNormalLengthTolerance) ++repaired;
        const glm::dvec3 mean_length(glm::length(means[i]));
        if (has_direction)
            mesh.normals[i] = glm::vec3(stated / length);
        else
            mesh.normals[i] = mean_length.x > 0.0 ? glm::vec3(means[i] / mean_length)
                                                  : glm::vec3(0.0f, 1.0f, 0.0f);
    }
    if (repaired > 0)
        model.findings.push_back({Severity::Info,
                                  "mesh-normals-repaired",
                                  fmt::format("{}: {} of {} normals were not of unit length",
                                              path,
                                              repaired,
                                              mesh.normals.size())});
}

}  // namespace

void validateMesh(Model& model, const std::string& path)
{
    checkArrays(model.mesh, model.materials.size(), path);
    checkValues(model.mesh, path);
    dropDegenerate(model, path);
    dropUnusedVertices(model.mesh);
    repairNormals(model, path);
}

}  // namespace insitu
