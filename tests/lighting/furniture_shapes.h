#pragma once

#include "core/mesh.h"
#include "tests/support/shapes.h"

/// Furniture that is hard for visibility: thin parts, hollows, undersides.
namespace insitu::shapes {

inline void append(TriangleMesh& to, const TriangleMesh& part)
{
    const auto base = static_cast<std::uint32_t>(to.positions.size());
    to.positions.insert(to.positions.end(), part.positions.begin(), part.positions.end());
    for (const glm::uvec3& t : part.triangles)
        to.triangles.push_back(t + base);
    to.material_of.insert(to.material_of.end(), part.material_of.begin(), part.material_of.end());
}

/// 1.2 x 0.8 m, 0.75 m high, on four legs of 3 cm.
[[nodiscard]] inline TriangleMesh table()
{
    TriangleMesh mesh = box({-0.6f, 0.72f, -0.4f}, {0.6f, 0.75f, 0.4f});
    for (const float x : {-0.58f, 0.55f})
        for (const float z : {-0.38f, 0.35f})
            append(mesh, box({x, 0.0f, z}, {x + 0.03f, 0.72f, z + 0.03f}));
    return mesh;
}

/// A seat and a back on four legs of 2 cm.
[[nodiscard]] inline TriangleMesh chair()
{
    TriangleMesh mesh = box({-0.22f, 0.43f, -0.22f}, {0.22f, 0.46f, 0.22f});
    append(mesh, box({-0.22f, 0.46f, -0.22f}, {0.22f, 0.95f, -0.19f}));
    for (const float x : {-0.21f, 0.19f})
        for (const float z : {-0.21f, 0.19f})
            append(mesh, box({x, 0.0f, z}, {x + 0.02f, 0.43f, z + 0.02f}));
    return mesh;
}

/// A cube of 1 m without a lid; its five sides have no thickness.
[[nodiscard]] inline TriangleMesh openBox()
{
    TriangleMesh mesh = quad({-0.5f, 0, -0.5f}, {1, 0, 0}, {0, 0, 1});
    addQuad(mesh, {-0.5f, 0, -0.5f}, {0, 1, 0}, {1, 0, 0});
    addQuad(mesh, {-0.5f, 0, 0.5f}, {1, 0, 0}, {0, 1, 0});
    addQuad(mesh, {-0.5f, 0, -0.5f}, {0, 0, 1}, {0, 1, 0});
    addQuad(mesh, {0.5f, 0, -0.5f}, {0, 1, 0}, {0, 0, 1});
    return mesh;
}

}  // namespace insitu::shapes
