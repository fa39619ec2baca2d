#include "lighting/place_light.h"

#include <algorithm>

namespace insitu {

CellGeometry::CellGeometry(DirectionCells cells_of) : cells(cells_of)
{
    for (std::size_t pair = 0; pair < cells.pairCount(); ++pair) {
        const glm::vec3 direction(cells.direction(pair));
        const float solid_angle = static_cast<float>(cells.solidAngle(pair));
        directions.insert(directions.end(), {direction, -direction});
        solid_angles.insert(solid_angles.end(), {solid_angle, solid_angle});
    }
}

void PlaceLight::setChange(const FaceGrid<Rgb>& room_change)
{
    for (std::size_t cell = 0; cell < ends.size(); ++cell)
        change[cell] = ends[cell].lookUp(room_change);
}

std::pair<Rgb, Rgb> PlaceLight::irradiance(glm::vec3 unit_normal) const
{
    glm::dvec3 without(0.0);
    glm::dvec3 changed(0.0);
    for (std::size_t cell = 0; cell < radiance.size(); ++cell) {
        const float weight = std::max(0.0f, glm::dot(unit_normal, geometry->directions[cell])) *
                             geometry->solid_angles[cell];
        without += glm::dvec3(weight * radiance[cell]);
        changed += glm::dvec3(weight * change[cell]);
    }
    return {Rgb(without), Rgb(changed)};
}

PlaceLight::End endOf(const RoomLight::Arrival& arrival)
{
    if (!arrival.hit || arrival.hit->opening) return {PlaceLight::End::kNoFace, {}};
    return {static_cast<std::uint32_t>(arrival.hit->face), glm::vec2(arrival.hit->uv)};
}

PlaceLight lookAround(const RoomLight& room,
                      const LightSpots& spots,
                      glm::dvec3 place,
                      std::shared_ptr<const CellGeometry> geometry,
                      const LookOptions& options)
{
    const std::vector<ProxyFace>& faces = room.proxy().faces();
    const std::size_t count = geometry->directions.size();
    PlaceLight light{std::move(geometry),
                     std::vector<Rgb>(count, Rgb(0.0f)),
                     std::vector<PlaceLight::End>(count),
                     std::vector<Rgb>(count, Rgb(0.0f)),
                     0.0};
    std::size_t looked = 0;
    std::size_t behind = 0;
    const int rays = options.rays_along * options.rays_along;
    for (std::size_t cell = 0; cell < count; ++cell) {
        if (!options.hold(light.geometry->directions[cell])) continue;
        for (int ray = 0; ray < rays; ++ray) {
            const glm::dvec3 direction =
                light.geometry->cells.directionOfRay(cell, ray, options.rays_along);
            const RoomLight::Arrival arrival = room.arrive(place, direction);
            ++looked;
            if (!spots.holds(arrival, direction))
                light.radiance[cell] += arrival.radiance / static_cast<float>(rays);
            light.ends[cell] = endOf(arrival);
            if (light.ends[cell].face == PlaceLight::End::kNoFace) continue;
            if (!faces[arrival.hit->face].two_sided &&
                glm::dot(faces[arrival.hit->face].normal, direction) > 0.0)
                ++behind;
        }
    }
    if (looked > 0) light.inside_share = static_cast<double>(behind) / static_cast<double>(looked);
    return light;
}

}  // namespace insitu
