#include "render/fiv/fiv_scene.h"

#include <cmath>
#include <numbers>

namespace insitu {

LookOptions FivScene::limitsTowardObjects(glm::dvec3 place,
                                          double reach_m,
                                          const VisibilityAtlas& of) const
{
    const glm::dvec3 way = frame().center - place;
    const double distance = glm::length(way);
    const double sine = (frame().radius + reach_m) / distance;
    if (!(sine < 1.0)) return {};
    // From a cell's centre to its corner, and a little more.
    const double angle = std::asin(sine) + 1.5 / of.options.face_size;
    if (angle >= std::numbers::pi) return {};
    LookOptions limits;
    limits.axis = glm::vec3(way / distance);
    limits.least_cosine = static_cast<float>(std::cos(angle));
    return limits;
}

CellRadiance lightOfCells(const FivScene& scene, const PlaceLight& light, bool less_glow)
{
    const std::size_t pairs = scene.coarse.cells().pairCount();
    CellRadiance hideable{
        std::vector<Rgb>(pairs), std::vector<Rgb>(pairs), std::vector<float>(pairs)};
    for (std::size_t pair = 0; pair < pairs; ++pair)
        hideable.solid_angles[pair] = light.geometry->solid_angles[2 * pair];
    for (std::size_t cell = 0; cell < light.radiance.size(); ++cell)
        (cell % 2 == 0 ? hideable.along : hideable.against)[cell / 2] =
            light.geometry->solid_angles[cell] * (light.radiance[cell] + light.change[cell] -
                                                  (less_glow ? scene.glow[cell] : Rgb(0.0f)));
    return hideable;
}

CellRadiance hideableLight(const FivScene& scene, const PlaceLight& light)
{
    return lightOfCells(scene, light, /*less_glow=*/true);
}

}  // namespace insitu
