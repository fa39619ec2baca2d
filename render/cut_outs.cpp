#include "render/cut_outs.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Parts that a model is divided into at most.
constexpr double kMaxParts = 4e6;

template <class Vector>
double longestEdge(const Vector& a, const Vector& b, const Vector& c)
{
    return static_cast<double>(
        std::max({glm::length(b - a), glm::length(c - b), glm::length(a - c)}));
}

/// Into how many parts the edges of a triangle are divided, at most this long.
int divisionsOf(const Model& model, std::uint32_t triangle, double largest_edge)
{
    const TriangleMesh& mesh = model.mesh;
    const Material& material = model.materials[mesh.material_of[triangle]];
    if (material.base_color_texture == kNoTexture || mesh.texcoords.empty()) return 1;
    const glm::uvec3 t = mesh.triangles[triangle];
    const auto& texels =
        model.textures[static_cast<std::size_t>(material.base_color_texture)].texels;
    const glm::vec2 size(texels.width(), texels.height());
    const double in_texels = longestEdge(
        mesh.texcoords[t.x] * size, mesh.texcoords[t.y] * size, mesh.texcoords[t.z] * size);
    const double length =
        longestEdge(mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]);
    return static_cast<int>(
        std::clamp(std::ceil(std::min(length / largest_edge, in_texels)), 1.0, 4096.0));
}

/// Appends those parts of a triangle that are there.
void addParts(const Model& model, std::uint32_t triangle, int n, TriangleMesh& made)
{
    const TriangleMesh& mesh = model.mesh;
    const glm::uvec3 t = mesh.triangles[triangle];
    const auto first = static_cast<std::uint32_t>(made.positions.size());
    const float step = 1.0f / static_cast<float>(n);
    // Row j of the grid of corners has n + 1 - j of them.
    const auto corner = [&](int i, int j) {
        return first + static_cast<std::uint32_t>(j * (n + 1) - j * (j - 1) / 2 + i);
    };
    for (int j = 0; j <= n; ++j)
        for (int i = 0; i + j <= n; ++i) {
            const float u = static_cast<float>(i) * step;
            const float v = static_cast<float>(j) * step;
            made.positions.push_back(mesh.positions[t.x] * (1.0f - u - v) +
                                     mesh.positions[t.y] * u + mesh.positions[t.z] * v);
        }
    const auto add = [&](float i, float j, glm::uvec3 part) {
        if (isThere(model, triangle, glm::vec2(i, j) * step)) made.triangles.push_back(part);
    };
    constexpr float third = 1.0f / 3.0f;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i + j < n; ++i) {
            const auto x = static_cast<float>(i);
            const auto y = static_cast<float>(j);
            add(x + third, y + third, {corner(i, j), corner(i + 1, j), corner(i, j + 1)});
            if (i + j + 1 < n)
                add(x + 2.0f * third,
                    y + 2.0f * third,
                    {corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)});
        }
}

}  // namespace

bool isThere(const Model& model, std::uint32_t triangle, glm::vec2 barycentric)
{
    const Material& material = model.materials[model.mesh.material_of[triangle]];
    if (!material.alpha_mask) return true;
    float alpha = material.alpha;
    if (material.base_color_texture != kNoTexture)
        alpha *= model.textures[static_cast<std::size_t>(material.base_color_texture)]
                     .sample(texcoordAt(model.mesh, triangle, barycentric))
                     .a;
    return alpha >= material.alpha_cutoff;
}

bool hasCutOuts(const Model& model)
{
    return std::any_of(model.materials.begin(), model.materials.end(), [](const Material& m) {
        return m.alpha_mask;
    });
}

TriangleMesh withoutCutOuts(const Model& model, double largest_edge)
{
    INSITU_CHECK(largest_edge > 0.0, "longest edge {}", largest_edge);
    const TriangleMesh& mesh = model.mesh;
    TriangleMesh made;
    made.positions = mesh.positions;
    if (!hasCutOuts(model)) {
        made.triangles = mesh.triangles;
        return made;
    }
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    const auto hasHoles = [&](std::uint32_t triangle) {
        return model.materials[mesh.material_of[triangle]].alpha_mask;
    };
    double parts = 0.0;
    for (std::uint32_t triangle = 0; triangle < count; ++triangle)
        if (hasHoles(triangle)) {
            const double n = divisionsOf(model, triangle, largest_edge);
            parts += n * n;
        }
    const double fewer = std::min(1.0, std::sqrt(kMaxParts / std::max(parts, 1.0)));
    for (std::uint32_t triangle = 0; triangle < count; ++triangle) {
        const int n =
            hasHoles(triangle)
                ? std::max(1, static_cast<int>(fewer * divisionsOf(model, triangle, largest_edge)))
                : 1;
        if (n > 1)
            addParts(model, triangle, n, made);
        else if (isThere(model, triangle, glm::vec2(1.0f / 3.0f)))
            made.triangles.push_back(mesh.triangles[triangle]);
    }
    return made;
}

}  // namespace insitu
