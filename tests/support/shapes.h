#pragma once

#include "core/mesh.h"

#include <glm/glm.hpp>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

/// Small meshes and models for tests.
namespace insitu::shapes {

/// Parallelogram corner, corner + u, corner + u + v, corner + v; front side along u × v.
inline void addQuad(TriangleMesh& mesh, glm::vec3 corner, glm::vec3 u, glm::vec3 v)
{
    const auto base = static_cast<std::uint32_t>(mesh.positions.size());
    for (const glm::vec3& p : {corner, corner + u, corner + u + v, corner + v})
        mesh.positions.push_back(p);
    mesh.triangles.push_back({base, base + 1, base + 2});
    mesh.triangles.push_back({base, base + 2, base + 3});
    mesh.material_of.insert(mesh.material_of.end(), 2, 0u);
}

[[nodiscard]] inline TriangleMesh quad(glm::vec3 corner, glm::vec3 u, glm::vec3 v)
{
    TriangleMesh mesh;
    addQuad(mesh, corner, u, v);
    return mesh;
}

/// A box seen from outside.
[[nodiscard]] inline TriangleMesh box(glm::vec3 min, glm::vec3 max)
{
    TriangleMesh mesh;
    const glm::vec3 size = max - min;
    const glm::vec3 x(size.x, 0.0f, 0.0f);
    const glm::vec3 y(0.0f, size.y, 0.0f);
    const glm::vec3 z(0.0f, 0.0f, size.z);
    addQuad(mesh, min, x, z);      // bottom
    addQuad(mesh, min + y, z, x);  // top
    addQuad(mesh, min, y, x);      // back
    addQuad(mesh, min + z, x, y);  // front
    addQuad(mesh, min, z, y);      // left
    addQuad(mesh, min + x, y, z);  // right
    return mesh;
}

/// A sphere of rows × 2·rows quads cut into triangles, with exact normals.
[[nodiscard]] inline TriangleMesh sphere(glm::vec3 center, float radius, int rows)
{
    TriangleMesh mesh;
    const int columns = 2 * rows;
    for (int i = 0; i <= rows; ++i)
        for (int j = 0; j <= columns; ++j) {
            const double polar = std::numbers::pi * i / rows;
            const double azimuth = 2.0 * std::numbers::pi * j / columns;
            const glm::vec3 normal(std::sin(polar) * std::cos(azimuth),
                                   std::cos(polar),
                                   std::sin(polar) * std::sin(azimuth));
            mesh.positions.push_back(center + radius * normal);
            mesh.normals.push_back(normal);
        }
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j) {
            const auto a = static_cast<std::uint32_t>(i * (columns + 1) + j);
            const auto b = a + static_cast<std::uint32_t>(columns) + 1;
            if (i > 0) mesh.triangles.push_back({a, a + 1, b + 1});
            if (i < rows - 1) mesh.triangles.push_back({a, b + 1, b});
        }
    mesh.material_of.assign(mesh.triangles.size(), 0u);
    return mesh;
}

/// Pure Lambert.
[[nodiscard]] inline Material lambert(glm::vec3 albedo)
{
    Material material;
    material.base_color = albedo;
    material.specular = 0.0f;
    return material;
}

[[nodiscard]] inline Model model(TriangleMesh mesh, Material material)
{
    Model made;
    made.mesh = std::move(mesh);
    made.materials.push_back(std::move(material));
    return made;
}

}  // namespace insitu::shapes
