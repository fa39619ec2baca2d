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

CellRadiance lightOfCells(const PlaceLight& light)
{
    const std::size_t pairs = light.radiance.size() / 2;
    CellRadiance cells{
        std::vector<Rgb>(pairs), std::vector<Rgb>(pairs), std::vector<float>(pairs)};
    for (std::size_t pair = 0; pair < pairs; ++pair) {
        const float solid_angle = light.geometry->solid_angles[2 * pair];
        const auto arriving = [&](std::size_t cell) {
            return solid_angle * (light.radiance[cell] + light.change[cell]);
        };
        cells.along[pair] = arriving(2 * pair);
        cells.against[pair] = arriving(2 * pair + 1);
        cells.solid_angles[pair] = solid_angle;
    }
    return cells;
}

}  // namespace insitu
