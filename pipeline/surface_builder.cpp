#include "pipeline/surface_builder.h"

#include "pipeline/surface_texture.h"

#include <algorithm>
#include <vector>

namespace insitu {

SurfaceBuilder::Finish SurfaceBuilder::addFinish(const SimulatedSurface& surface, glm::dvec2 size_m)
{
    Material material;
    material.roughness = surface.roughness;
    material.specular = surface.specular;
    material.double_sided = true;
    material.base_color = surface.color_linear;

    Finish finish;
    finish.height_m = size_m.y;
    std::optional<Texture> texture;
    switch (surface.kind) {
        case SimulatedSurface::Kind::Plain:
            break;
        case SimulatedSurface::Kind::Picture:
            texture = pictureTexture(surface);
            finish.metres_per_uv =
                glm::dvec2(surface.size_m,
                           surface.size_m * texture->texels.height() / texture->texels.width());
            break;
        case SimulatedSurface::Kind::Boards:
            texture = boardsTexture(surface, size_m.x, size_m.y, seed_);
            finish.metres_per_uv = size_m;
            break;
        case SimulatedSurface::Kind::Checker:
            texture = checkerTexture(surface);
            finish.metres_per_uv = glm::dvec2(2.0 * surface.size_m);
            break;
    }
    if (texture) {
        material.base_color = glm::vec3(1.0f);
        material.base_color_texture = static_cast<int>(model_.textures.size());
        model_.textures.push_back(std::move(*texture));
    }
    finish.material = static_cast<std::uint32_t>(model_.materials.size());
    model_.materials.push_back(material);
    return finish;
}

void SurfaceBuilder::addQuad(const Finish& finish,
                             glm::dvec3 corner,
                             glm::dvec3 u,
                             glm::dvec3 v,
                             glm::dvec2 low,
                             glm::dvec2 high)
{
    TriangleMesh& mesh = model_.mesh;
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    const glm::dvec3 along_u = glm::normalize(u);
    const glm::dvec3 along_v = glm::normalize(v);
    for (const glm::dvec2 place : {low, {high.x, low.y}, high, {low.x, high.y}}) {
        mesh.positions.emplace_back(corner + along_u * place.x + along_v * place.y);
        // Row 0 of a texture is its top: pictures stand upright where v points up.
        mesh.texcoords.emplace_back(glm::dvec2(place.x, finish.height_m - place.y) /
                                    finish.metres_per_uv);
    }
    mesh.triangles.emplace_back(first, first + 1, first + 2);
    mesh.triangles.emplace_back(first, first + 2, first + 3);
    mesh.material_of.insert(mesh.material_of.end(), 2, finish.material);
}

void SurfaceBuilder::addRectangle(const SimulatedSurface& surface,
                                  glm::dvec3 corner,
                                  glm::dvec3 u,
                                  glm::dvec3 v,
                                  std::span<const std::pair<glm::dvec2, glm::dvec2>> holes)
{
    const glm::dvec2 size{glm::length(u), glm::length(v)};
    const Finish finish = addFinish(surface, size);
    // Cut along every border of every hole: each cell is then wholly in or out.
    std::vector<double> cuts_u{0.0, size.x};
    std::vector<double> cuts_v{0.0, size.y};
    for (const auto& [from, to] : holes) {
        cuts_u.insert(cuts_u.end(), {from.x, to.x});
        cuts_v.insert(cuts_v.end(), {from.y, to.y});
    }
    for (std::vector<double>* cuts : {&cuts_u, &cuts_v}) {
        std::sort(cuts->begin(), cuts->end());
        cuts->erase(std::unique(cuts->begin(), cuts->end()), cuts->end());
    }
    for (std::size_t i = 0; i + 1 < cuts_u.size(); ++i)
        for (std::size_t j = 0; j + 1 < cuts_v.size(); ++j) {
            const glm::dvec2 low{cuts_u[i], cuts_v[j]};
            const glm::dvec2 high{cuts_u[i + 1], cuts_v[j + 1]};
            const glm::dvec2 middle = 0.5 * (low + high);
            const bool open = std::any_of(holes.begin(), holes.end(), [&](const auto& hole) {
                return glm::all(glm::lessThan(hole.first, middle)) &&
                       glm::all(glm::lessThan(middle, hole.second));
            });
            if (!open) addQuad(finish, corner, u, v, low, high);
        }
}

void SurfaceBuilder::addBox(const SimulatedSurface& surface, glm::dvec3 a, glm::dvec3 b)
{
    const glm::dvec3 low = glm::min(a, b);
    const glm::dvec3 size = glm::max(a, b) - low;
    const glm::dvec3 x{size.x, 0.0, 0.0};
    const glm::dvec3 y{0.0, size.y, 0.0};
    const glm::dvec3 z{0.0, 0.0, size.z};
    addRectangle(surface, low, z, x);
    addRectangle(surface, low + y, x, z);
    addRectangle(surface, low, x, y);
    addRectangle(surface, low + z, x, y);
    addRectangle(surface, low, z, y);
    addRectangle(surface, low + x, z, y);
}

}  // namespace insitu
