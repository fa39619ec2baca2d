#include "render/fiv/object_light.h"

#include "core/color.h"
#include "core/parallel.h"
#include "lighting/sampling.h"
#include "render/bsdf/bsdf.h"
#include "render/bsdf/ggx_albedo.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kMaxNodesAlong = 6;
constexpr int kIrradianceCube = 16;
/// Rays along a cell's side from the nodes: at the edges of windows the light of a cell is mixed.
constexpr int kNodeRaysAlong = 3;

/// What of diffuse light the base reflects: a coat lets less through at grazing views.
Rgb diffuseReflectance(const SurfaceMaterial& m, double cosine)
{
    Rgb base = m.base_color * (1.0f - m.metallic);
    if (m.specular > 0.0f && m.metallic < 1.0f)
        base *= static_cast<float>(
            1.0 - ggx::directionalAlbedo(m.roughness, cosine).of(0.04 * m.specular, m.specular));
    return base;
}

}  // namespace

Rgb evenReflectance(const SurfaceMaterial& m)
{
    const GlossyLobe lobe = glossyLobe(m);
    const ggx::Albedo albedo = ggx::meanAlbedo(m.roughness);
    const Rgb f0 = lobe.metal.base_color;
    const Rgb glossy = isGlossy(m) ? lobe.scale * (f0 * static_cast<float>(albedo.at_f0) +
                                                   static_cast<float>(albedo.at_f90))
                                   : Rgb(0.0f);
    return m.base_color * (1.0f - m.metallic) * (1.0f - luminance(glossy) * (1.0f - m.metallic)) +
           glossy;
}

ObjectShading::Place ObjectShading::placeOf(const SurfacePoint& point)
{
    return {point.position, point.shading_normal, point.geometric_normal};
}

ObjectShading::ObjectShading(const FivScene& scene, double node_spacing_m) : scene_(scene)
{
    lookFromNodes(node_spacing_m);
    update();
}

void ObjectShading::update()
{
    parallelFor(0, static_cast<std::int64_t>(lights_.size()), [&](std::int64_t number) {
        PlaceLight& light = lights_[static_cast<std::size_t>(number)];
        light.setChange(scene_.room_change);
        nodes_[static_cast<std::size_t>(number)] = irradianceCube(light, kIrradianceCube);
    });
}

void ObjectShading::lookFromNodes(double spacing_m)
{
    const std::vector<BoundingBox>& bounds = scene_.objects.bounds();
    box_ = bounds.front();
    for (const BoundingBox& b : bounds)
        box_ = {glm::min(box_.min, b.min), glm::max(box_.max, b.max)};
    // Objects stand on surfaces: their light is looked at from just above these.
    const glm::dvec3 size = box_.max - box_.min;
    const glm::dvec3 inset = glm::min(0.1 * size, glm::dvec3(0.02));
    box_ = {box_.min + inset, box_.max - inset};
    for (int axis = 0; axis < 3; ++axis)
        node_count_[axis] =
            std::clamp(static_cast<int>(std::ceil(size[axis] / spacing_m)) + 1, 2, kMaxNodesAlong);

    const glm::dvec3 center = 0.5 * (box_.min + box_.max);
    const std::size_t count =
        static_cast<std::size_t>(node_count_.x * node_count_.y * node_count_.z);
    nodes_.resize(count);
    lights_.resize(count);
    parallelFor(0, static_cast<std::int64_t>(count), [&](std::int64_t number) {
        const int n = static_cast<int>(number);
        const glm::ivec3 at(n % node_count_.x,
                            n / node_count_.x % node_count_.y,
                            n / (node_count_.x * node_count_.y));
        const glm::dvec3 inside = glm::dvec3(at) / glm::dvec3(node_count_ - 1);
        glm::dvec3 place = glm::mix(box_.min, box_.max, inside);
        // A place beyond a wall looks from before it.
        const glm::dvec3 way = place - center;
        const double length = glm::length(way);
        if (length > 0.0) {
            const auto wall = scene_.room.intersect(center, way / length);
            if (wall && wall->distance_m < length + 0.01)
                place = center + way / length * std::max(0.0, wall->distance_m - 0.02);
        }
        if (scene_.light != FivLight::Room) place = scene_.frame().center;
        lights_[static_cast<std::size_t>(number)] = lookAround(
            scene_.room, scene_.spots, place, scene_.coarse_cells, {.rays_along = kNodeRaysAlong});
    });
}

Rgb ObjectShading::openIrradiance(const Place& place) const
{
    const glm::dvec3 size = glm::max(box_.max - box_.min, glm::dvec3(1e-12));
    const glm::dvec3 at =
        glm::clamp((place.position - box_.min) / size, glm::dvec3(0.0), glm::dvec3(1.0)) *
        glm::dvec3(node_count_ - 1);
    const glm::ivec3 low = glm::min(glm::ivec3(at), node_count_ - 2);
    const glm::vec3 t(at - glm::dvec3(low));
    Rgb sum(0.0f);
    for (int corner = 0; corner < 8; ++corner) {
        const glm::ivec3 step(corner & 1, (corner >> 1) & 1, corner >> 2);
        const glm::vec3 w = glm::mix(1.0f - t, t, glm::vec3(step));
        const float weight = w.x * w.y * w.z;
        if (weight <= 0.0f) continue;
        const glm::ivec3 n = low + step;
        const auto number =
            static_cast<std::size_t>((n.z * node_count_.y + n.y) * node_count_.x + n.x);
        sum += weight * nodes_[number].lookUp(place.normal);
    }
    return sum;
}

glm::dvec3 ObjectShading::startOfRays(const Place& place) const
{
    SurfacePoint point;
    point.position = place.position;
    point.geometric_normal = place.geometric_normal;
    return scene_.objects.leave(point, place.geometric_normal);
}

Rgb ObjectShading::spotIrradiance(const Place& place) const
{
    glm::dvec3 sum(0.0);
    const glm::dvec3 start = startOfRays(place);
    for (const LightSpot& spot : scene_.spots.spots()) {
        const glm::dvec3 toward = spot.far ? spot.at : spot.at - start;
        if (glm::dot(toward, place.normal) <= 0.0 ||
            glm::dot(toward, place.geometric_normal) <= 0.0)
            continue;
        const auto arriving = reach(scene_.room, spot, start);
        if (!arriving ||
            (scene_.light != FivLight::Cube &&
             scene_.objects.occluded(start, arriving->direction, arriving->distance_m)))
            continue;
        sum += arriving->irradiance * glm::dot(arriving->direction, place.normal);
    }
    return Rgb(sum);
}

RayLight ObjectShading::rayLight(const Place& place, int rays) const
{
    const glm::dvec3 start = startOfRays(place);
    const glm::dvec3 from = scene_.light == FivLight::Room ? start : scene_.frame().center;
    const glm::dmat3 to_world = frameFromNormal(place.normal);
    const int draws = rays / 2;
    RayLight light;
    // Cosine and light sampling joined by the balance heuristic [Veach97, 9.2].
    const auto add = [&](const RoomLight::DrawnArrival& drawn) {
        const auto& [direction, arrival, density] = drawn;
        const double cosine = glm::dot(direction, place.normal);
        // What is below the surface only by its own curvature tells nothing of what lies near.
        if (cosine <= 0.0 || glm::dot(direction, place.geometric_normal) <= 0.0) return;
        const auto weight =
            static_cast<float>(cosine / (cosine / static_cast<double>(kPi) + density) / draws);
        Rgb radiance(0.0f);
        if (!scene_.spots.holds(arrival, direction)) radiance = arrival.radiance;
        if (arrival.hit && !arrival.hit->opening)
            radiance += scene_.room_change.lookUp(arrival.hit->face, arrival.hit->uv, Rgb(0.0f));
        const Rgb arriving = weight * glm::max(radiance, Rgb(0.0f));
        light.all += arriving;
        if (const auto met = scene_.objects.intersect(start, direction, arrival.distance_m))
            light.sent += weight * scene_.sent.at(met->position, met->geometric_normal);
        else
            light.passed += arriving;
    };
    for (int i = 0; i < draws; ++i) {
        const glm::dvec2 u = r2Point(i, place.shift);
        add(scene_.room.arriveWithPdf(from, to_world * cosineHemisphere(u)));
        // Which light is drawn matters more than where on it: evenly by itself.
        const double selector = glm::fract(place.shift.x + i * std::numbers::phi);
        if (const auto drawn = scene_.room.draw(from, selector, u)) add(*drawn);
    }
    return light;
}

std::vector<ObjectShading::Received> ObjectShading::receive(std::span<const Place> places,
                                                            int rays) const
{
    std::vector<Received> result(places.size());
    parallelFor(0, static_cast<std::int64_t>(places.size()), [&](std::int64_t number) {
        const Place& place = places[static_cast<std::size_t>(number)];
        Received& received = result[static_cast<std::size_t>(number)];
        received.open = openIrradiance(place);
        received.rays = scene_.light == FivLight::Cube ? RayLight{Rgb(1.0f), Rgb(1.0f), Rgb(0.0f)}
                                                       : rayLight(place, rays);
        if (!scene_.spots.spots().empty()) received.spots = spotIrradiance(place);
    });
    return result;
}

void ObjectShading::add(const SurfacePoint& point,
                        glm::dvec3 wo,
                        const Received& received,
                        const LobeDraw& draw,
                        ObjectPixel& pixel,
                        Rgb& radiance) const
{
    const double cosine = std::abs(glm::dot(point.shading_normal, wo));
    const Rgb matt = diffuseReflectance(point.material, cosine) / kPi;
    pixel.matt += matt;
    pixel.matt_open += matt * received.open;
    pixel.rays += received.rays;
    radiance += point.material.emissive + matt * received.spots;
    if (!isGlossy(point.material)) return;
    const Gloss gloss = glossyRadiance(scene_, point, wo, received.spots, draw);
    pixel.glossy += gloss.reflectance;
    pixel.gathered += gloss.gathered;
    radiance += gloss.sharp;
}

}  // namespace insitu
