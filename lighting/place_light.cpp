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
        change[cell] =
            ends[cell].face >= End::kNotLooked
                ? Rgb(0.0f)
                : room_change.lookUp(ends[cell].face, glm::dvec2(ends[cell].uv), Rgb(0.0f));
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

PlaceLight lookAround(const RoomLight& room,
                      const LightSpots& spots,
                      glm::dvec3 place,
                      std::shared_ptr<const CellGeometry> geometry,
                      const std::optional<glm::vec3>& horizon_normal)
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
    for (std::size_t cell = 0; cell < count; ++cell) {
        const glm::vec3 toward = light.geometry->directions[cell];
        if (horizon_normal && glm::dot(toward, *horizon_normal) <= 0.0f) continue;
        const glm::dvec3 direction = glm::normalize(glm::dvec3(toward));
        const RoomLight::Arrival arrival = room.arrive(place, direction);
        ++looked;
        if (!spots.holds(arrival, direction)) light.radiance[cell] = arrival.light.radiance;
        light.ends[cell].face = PlaceLight::End::kNoFace;
        if (!arrival.hit || arrival.hit->opening) continue;
        light.ends[cell] = {static_cast<std::uint32_t>(arrival.hit->face),
                            glm::vec2(arrival.hit->uv)};
        if (!faces[arrival.hit->face].two_sided &&
            glm::dot(faces[arrival.hit->face].normal, direction) > 0.0)
            ++behind;
    }
    if (looked > 0) light.inside_share = static_cast<double>(behind) / static_cast<double>(looked);
    return light;
}

}  // namespace insitu
