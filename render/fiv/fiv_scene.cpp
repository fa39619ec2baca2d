#include "render/fiv/fiv_scene.h"

#include <cmath>
#include <numbers>

namespace insitu {

LookOptions FivScene::limitsTowardObjects(glm::dvec3 place, double reach_m) const
{
    const glm::dvec3 way = frame().center - place;
    const double distance = glm::length(way);
    const double sine = (frame().radius + reach_m) / distance;
    if (!(sine < 1.0)) return {};
    // From a cell's centre to its corner, and a little more.
    const double angle = std::asin(sine) + 1.5 / atlas.options.face_size;
    if (angle >= std::numbers::pi) return {};
    LookOptions limits;
    limits.axis = glm::vec3(way / distance);
    limits.least_cosine = static_cast<float>(std::cos(angle));
    return limits;
}

}  // namespace insitu
