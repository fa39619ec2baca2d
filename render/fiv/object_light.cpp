#include "render/fiv/object_light.h"

#include "core/color.h"
#include "core/parallel.h"
#include "lighting/sampling.h"
#include "render/bsdf/bsdf.h"
#include "render/bsdf/ggx_albedo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr int kMaxNodesAlong = 6;
constexpr int kIrradianceCube = 16;
/// Rays of a place: the first few, and all where one of these meets something near.
constexpr int kFirstRays = 16;
constexpr int kNearRays = 32;

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

ObjectShading::ObjectShading(const FivScene& scene, const ObjectLightOptions& options)
    : scene_(scene), options_(options)
{
    const SilhouetteSet& set = scene.coarse.silhouettes;
    double texels_m = 0.0;
    for (const SilhouetteFrame& frame : set.frames)
        texels_m += set.local.radius * static_cast<double>(frame.texel_depth) /
                    glm::length(glm::dvec3(frame.depth_axis));
    near_m_ = (static_cast<double>(options.bias_texels) - 0.5) * texels_m /
              static_cast<double>(set.frames.size());
    lookFromNodes(options.node_spacing_m);
    update();
}

void ObjectShading::update()
{
    parallelFor(0, static_cast<std::int64_t>(lights_.size()), [&](std::int64_t number) {
        PlaceLight& light = lights_[static_cast<std::size_t>(number)];
        light.setChange(scene_.room_change);
        nodes_[static_cast<std::size_t>(number)] = irradianceCube(light, kIrradianceCube);
    });
    PlaceLight mean = lights_.front();
    for (std::size_t cell = 0; cell < mean.radiance.size(); ++cell) {
        for (std::size_t i = 1; i < lights_.size(); ++i) {
            mean.radiance[cell] += lights_[i].radiance[cell];
            mean.change[cell] += lights_[i].change[cell];
        }
        mean.radiance[cell] /= static_cast<float>(lights_.size());
        mean.change[cell] /= static_cast<float>(lights_.size());
    }
    mean_irradiance_ = irradianceCube(mean, kIrradianceCube);
    hideable_ = lightOfCells(mean);
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
        lights_[static_cast<std::size_t>(number)] =
            lookAround(scene_.room, scene_.spots, place, scene_.coarse_cells);
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

Rgb ObjectShading::spotIrradiance(const Place& place) const
{
    glm::dvec3 sum(0.0);
    SurfacePoint point;
    point.position = place.position;
    point.geometric_normal = place.geometric_normal;
    const glm::dvec3 start = scene_.objects.leave(point, place.geometric_normal);
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

ObjectShading::Around ObjectShading::lookAtObjects(const Place& place) const
{
    SurfacePoint point;
    point.position = place.position;
    point.geometric_normal = place.geometric_normal;
    const glm::dvec3 start = scene_.objects.leave(point, place.geometric_normal);
    const glm::dmat3 to_world = frameFromNormal(place.normal);
    std::array<glm::dvec3, kNearRays> near;
    std::array<glm::dvec3, kNearRays> passed;
    std::size_t near_count = 0;
    std::size_t passed_count = 0;
    Around around;
    int met_count = 0;
    int rays = kFirstRays;
    for (int i = 0; i < rays; ++i) {
        const glm::dvec3 direction = to_world * cosineHemisphere(r2Point(i));
        // Below the surface by its own curvature, not by what lies near.
        const auto met = glm::dot(direction, place.geometric_normal) > 0.0
                             ? scene_.objects.intersect(start, direction)
                             : std::nullopt;
        if (met && met->distance_m < near_m_) {
            near[near_count++] = direction;
            around.sent_nearby += scene_.sent.at(met->position, met->geometric_normal);
        } else {
            passed[passed_count++] = direction;
            if (met) {
                around.sent += scene_.sent.at(met->position, met->geometric_normal);
                ++met_count;
            }
        }
        if (i + 1 == kFirstRays && near_count > 0) rays = kNearRays;
    }
    // Where rays meet nothing, what the atlas takes for hidden is the surface's own beginning.
    around.sent = met_count > 0 ? around.sent / static_cast<float>(met_count)
                                : scene_.sent.at(place.position, place.normal);
    if (near_count == 0) return around;
    around.sent_nearby /= static_cast<float>(near_count);
    // What is thick hides in the atlas too: it counts once.
    const glm::vec3 local = scene_.frame().localFrom(place.position);
    const auto open = [&](std::span<const glm::dvec3> directions) {
        float sum = 0.0f;
        for (const glm::dvec3& direction : directions)
            sum += 1.0f - hiddenShare(scene_.coarse, local, direction, options_.bias_texels);
        return sum;
    };
    const float lost = open({near.data(), near_count});
    const float left = open({passed.data(), passed_count});
    around.hidden_nearby = lost + left > 0.0f ? lost / (lost + left) : 0.0f;
    return around;
}

std::vector<ObjectShading::Received> ObjectShading::receive(std::span<const Place> places) const
{
    std::vector<glm::vec3> local(places.size());
    std::vector<glm::vec3> normals(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
        local[i] = scene_.frame().localFrom(places[i].position);
        normals[i] = glm::vec3(places[i].normal);
    }
    std::vector<HiddenIrradiance> lost(places.size());
    if (scene_.light != FivLight::Cube)
        hiddenIrradiance(scene_.coarse, hideable_, local, normals, lost, options_.bias_texels);
    std::vector<Received> result(places.size());
    parallelFor(0, static_cast<std::int64_t>(places.size()), [&](std::int64_t number) {
        const auto i = static_cast<std::size_t>(number);
        const Rgb all = mean_irradiance_.lookUp(places[i].normal);
        const Rgb left = glm::max(all - lost[i].light, Rgb(0.0f));
        const Rgb open = openIrradiance(places[i]);
        Received& r = result[i];
        for (int c = 0; c < 3; ++c)
            r.smooth[c] = all[c] > 0.0f ? open[c] * (left[c] / all[c]) : 0.0f;
        if (scene_.light != FivLight::Cube) {
            const Around around = lookAtObjects(places[i]);
            r.smooth += lost[i].sky * around.sent;
            const float hidden = around.hidden_nearby;
            r.smooth = r.smooth * (1.0f - hidden) +
                       hidden * std::max(kPi - lost[i].sky, 0.0f) * around.sent_nearby;
        }
        if (!scene_.spots.spots().empty()) r.spots = spotIrradiance(places[i]);
    });
    return result;
}

Gloss ObjectShading::radiance(const SurfacePoint& point,
                              glm::dvec3 wo,
                              const Received& received,
                              const LobeDraw& draw) const
{
    Gloss seen;
    if (isGlossy(point.material)) seen = glossyRadiance(scene_, point, wo, received.spots, draw);
    const double cosine = std::abs(glm::dot(point.shading_normal, wo));
    seen.sharp += point.material.emissive + diffuseReflectance(point.material, cosine) *
                                                (received.smooth + received.spots) / kPi;
    return seen;
}

}  // namespace insitu
