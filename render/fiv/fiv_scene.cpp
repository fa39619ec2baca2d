#include "render/fiv/fiv_scene.h"

#include "core/parallel.h"

#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// A cell of the room changes when the objects' bounding sphere fills at least this share (r/d)² of
/// its sky.
constexpr double kLeastView = 2e-3;

glm::dvec3 changeAt(const FivScene& scene, glm::dvec3 x, glm::dvec3 normal)
{
    const SilhouetteSet& set = scene.coarse.silhouettes;
    const DirectionCells cells = scene.coarse.cells();
    const glm::vec3 x_local = scene.frame().localFrom(x);
    const glm::dvec3 way = scene.frame().center - x;
    const double distance = glm::length(way);
    const double sine = scene.frame().radius / distance;
    if (sine * sine < kLeastView) return glm::dvec3(0.0);
    // Cells that the cone around the bounding sphere touches.
    const double half_angle = sine < 1.0 ? std::asin(sine) : std::numbers::pi;
    const double widest = 1.0 / cells.face_size;
    const double least = std::cos(std::min(half_angle + 1.5 * widest, std::numbers::pi));

    glm::dvec3 sum(0.0);
    for (std::size_t pair = 0; pair < cells.pairCount(); ++pair) {
        const glm::dvec3 d = set.directions[pair];
        for (const double side : {1.0, -1.0}) {
            const glm::dvec3 direction = side * d;
            const double cosine = glm::dot(direction, normal);
            if (cosine <= 0.0 || glm::dot(direction, way) < least * distance) continue;
            const HiddenShares shares = hiddenShares(set, pair, x_local);
            const double hidden = side > 0.0 ? shares.along : shares.against;
            if (!(hidden > 0.0)) continue;
            const RoomLight::Arrival arrival = scene.room.arrive(x, direction);
            glm::dvec3 lost(0.0);
            if (!scene.spots.holds(arrival, direction)) lost = arrival.light.radiance;
            const Rgb glow = scene.glow[2 * pair + (side > 0.0 ? 0 : 1)];
            sum -= (lost - glm::dvec3(glow)) * (hidden * cosine * cells.solidAngle(pair));
        }
    }
    for (const LightSpot& spot : scene.spots.spots()) {
        const glm::dvec3 start = offsetOrigin(x, normal, normal);
        const auto arriving = reach(scene.room, spot, start);
        if (!arriving) continue;
        const double cosine = glm::dot(arriving->direction, normal);
        if (cosine > 0.0 && scene.mayMeetObjects(start, arriving->direction) &&
            scene.objects.occluded(start, arriving->direction, arriving->distance_m))
            sum -= arriving->irradiance * cosine;
    }
    return sum;
}

}  // namespace

HideableLight hideableLight(const FivScene& scene,
                            const VisibilityAtlas& atlas,
                            const PlaceLight& light)
{
    const std::size_t pairs = atlas.cells().pairCount();
    const bool coarse = &atlas == &scene.coarse;
    HideableLight split;
    for (ObjectLight* part : {&split.lost, &split.gained}) {
        part->atlas = &atlas;
        part->light.along.resize(pairs);
        part->light.against.resize(pairs);
    }
    for (std::size_t cell = 0; cell < light.radiance.size(); ++cell) {
        if (light.ends[cell].face == PlaceLight::End::kNotLooked) continue;
        const Rgb sent = light.radiance[cell] + light.change[cell];
        const glm::vec3 direction = light.geometry->directions[cell];
        const Rgb glow = coarse ? scene.glow[cell] : scene.glowAlong(glm::dvec3(direction));
        const Rgb loss = sent - glow;
        if (loss == Rgb(0.0f)) continue;
        const glm::vec3 weighted = direction * light.geometry->solid_angles[cell];
        const auto of = [&](ObjectLight& part) -> IrradianceVector& {
            return (cell % 2 == 0 ? part.light.along : part.light.against)[cell / 2];
        };
        for (std::size_t c = 0; c < 3; ++c) {
            const float value = loss[static_cast<int>(c)];
            if (value >= 0.0f) {
                of(split.lost).channels[c] = value * weighted;
            } else {
                of(split.gained).channels[c] = -value * weighted;
                split.gains = true;
            }
        }
    }
    return split;
}

FaceGrid<Rgb> roomChange(const FivScene& scene)
{
    FaceGrid<Rgb> change = scene.room.cellReflectance();
    const std::vector<ProxyFace>& faces = scene.room.proxy().faces();
    parallelFor(0, static_cast<std::int64_t>(change.size()), [&](std::int64_t number) {
        const std::size_t cell = static_cast<std::size_t>(number);
        const Rgb reflectance = change[cell];
        change[cell] = Rgb(0.0f);
        if (!change.valid(cell)) return;
        const auto texel = change.texel(cell);
        const glm::dvec3 x =
            scene.room.proxy().pointOn(texel.face, change.uv(texel, glm::dvec2(0.5)));
        const glm::dvec3 irradiance = changeAt(scene, x, faces[texel.face].normal);
        change[cell] = reflectance * Rgb(irradiance / std::numbers::pi);
    });
    return change;
}

}  // namespace insitu
