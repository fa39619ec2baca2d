#include "render/fiv/object_gloss.h"

#include "core/color.h"
#include "lighting/sampling.h"
#include "render/bsdf/bsdf.h"
#include "render/bsdf/ggx_albedo.h"
#include "render/fiv/object_light.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Surfaces smoother than this are mirrors.
constexpr float kMirror = 0.1f;
/// Directions drawn for a point whose lobe reflects nothing, and all; a pixel has four points.
constexpr int kLeastDirections = 3;
constexpr int kMostDirections = 6;

/// Of light from all around, towards a viewer at this cosine.
Rgb reflectanceOf(const GlossyLobe& lobe, double cosine)
{
    const ggx::Albedo albedo = ggx::directionalAlbedo(lobe.metal.roughness, cosine);
    return lobe.scale * (lobe.metal.base_color * static_cast<float>(albedo.at_f0) +
                         static_cast<float>(albedo.at_f90));
}

/// Reflections of objects in objects that are followed.
int bouncesIn(const FivScene& scene)
{
    return scene.interreflection ? 1 : 0;
}

Rgb arriving(const FivScene& scene,
             const SurfacePoint& point,
             glm::dvec3 direction,
             bool with_spots,
             int bounces);

/// Radiance of an object that a ray meets; with bounces left its own reflection is followed.
Rgb sentBy(const FivScene& scene, const SurfacePoint& met, glm::dvec3 direction, int bounces)
{
    const Rgb mean = scene.sent.at(met.position, met.geometric_normal);
    if (bounces == 0 || !isGlossy(met.material)) return mean;
    constexpr double kMeanCosine = 0.7;
    const GlossyLobe lobe = glossyLobe(met.material);
    const Rgb even = evenReflectance(met.material);
    const Rgb glossy = glm::min(reflectanceOf(lobe, kMeanCosine), even);
    const Rgb matt = 1.0f - glossy / glm::max(even, Rgb(1e-6f));
    const double cosine = std::max(-glm::dot(met.shading_normal, direction), 0.0);
    return mean * matt +
           reflectanceOf(lobe, cosine) * arriving(scene,
                                                  met,
                                                  glm::reflect(direction, met.shading_normal),
                                                  /*with_spots=*/true,
                                                  bounces - 1);
}

Rgb arriving(const FivScene& scene,
             const SurfacePoint& point,
             glm::dvec3 direction,
             bool with_spots,
             int bounces)
{
    const glm::dvec3 start = scene.objects.leave(point, direction);
    const RoomLight::Arrival arrival =
        scene.room.arrive(scene.light == FivLight::Room ? start : scene.frame().center, direction);
    if (scene.light != FivLight::Cube) {
        const auto met = scene.objects.intersect(start, direction, arrival.distance_m);
        if (met) return sentBy(scene, *met, direction, bounces);
    }
    Rgb radiance =
        with_spots || !scene.spots.holds(arrival, direction) ? arrival.radiance : Rgb(0.0f);
    if (arrival.hit && !arrival.hit->opening)
        radiance += scene.room_change.lookUp(arrival.hit->face, arrival.hit->uv, Rgb(0.0f));
    return glm::max(radiance, Rgb(0.0f));
}

/// Mean of what arrives along directions of the lobe, each by its share.
Rgb meanOfLobe(const FivScene& scene,
               const SurfacePoint& point,
               glm::dvec3 wo,
               int directions,
               const LobeDraw& draw)
{
    // White, so that a direction's weight is its share; colour comes after.
    SurfaceMaterial white;
    white.base_color = Rgb(1.0f);
    white.metallic = 1.0f;
    white.roughness = point.material.roughness;
    Rgb sum(0.0f);
    float weights = 0.0f;
    for (int i = 0; i < directions; ++i) {
        const glm::dvec2 u = r2Point(draw.point * directions + i, draw.shift);
        const auto drawn = sampleBsdf(white, point.shading_normal, wo, 0.5f, glm::vec2(u));
        // What lies below the surface itself, by its own curvature, is not lit.
        if (!drawn || glm::dot(drawn->direction, point.geometric_normal) <= 0.0) continue;
        sum += drawn->weight.g *
               arriving(scene, point, drawn->direction, /*with_spots=*/false, bouncesIn(scene));
        weights += drawn->weight.g;
    }
    return weights > 0.0f ? sum / weights : Rgb(0.0f);
}

/// What the lobe reflects of the light of spots; what of it is hidden is taken from the irradiance.
Rgb spotsOfLobe(const FivScene& scene,
                const SurfacePoint& point,
                glm::dvec3 wo,
                const GlossyLobe& lobe,
                Rgb spots_received)
{
    Rgb all(0.0f);
    Rgb shining(0.0f);
    for (const LightSpot& spot : scene.spots.spots()) {
        const auto from_spot = reach(scene.room, spot, point.position);
        if (!from_spot) continue;
        const double c = glm::dot(from_spot->direction, point.shading_normal);
        if (c <= 0.0) continue;
        const Rgb irradiance(from_spot->irradiance * c);
        all += irradiance;
        shining += lobe.scale *
                   evaluateBsdf(lobe.metal, point.shading_normal, wo, from_spot->direction) *
                   irradiance;
    }
    for (int c = 0; c < 3; ++c)
        shining[c] *= all[c] > 0.0f ? std::min(1.0f, spots_received[c] / all[c]) : 0.0f;
    return shining;
}

}  // namespace

GlossyLobe glossyLobe(const SurfaceMaterial& m)
{
    const float f90 = glm::mix(m.specular, 1.0f, m.metallic);
    GlossyLobe lobe;
    lobe.scale = f90;
    lobe.metal = m;
    lobe.metal.metallic = 1.0f;
    if (f90 > 0.0f)
        lobe.metal.base_color =
            glm::mix(glm::vec3(0.04f * m.specular), m.base_color, m.metallic) / f90;
    return lobe;
}

Gloss glossyRadiance(const FivScene& scene,
                     const SurfacePoint& point,
                     glm::dvec3 wo,
                     Rgb spots_received,
                     const LobeDraw& draw)
{
    const GlossyLobe lobe = glossyLobe(point.material);
    const glm::dvec3 normal = point.shading_normal;
    const Rgb reflectance = reflectanceOf(lobe, std::max(glm::dot(normal, wo), 0.0));
    Gloss gloss;
    if (point.material.roughness < kMirror) {
        gloss.sharp = reflectance * arriving(scene,
                                             point,
                                             glm::reflect(-wo, normal),
                                             /*with_spots=*/true,
                                             bouncesIn(scene));
        return gloss;
    }
    const float share = std::min(luminance(reflectance), 1.0f);
    const int directions =
        kLeastDirections +
        static_cast<int>(std::lround(share * (kMostDirections - kLeastDirections)));
    gloss.reflectance = reflectance;
    gloss.gathered = reflectance * meanOfLobe(scene, point, wo, directions, draw);
    if (spots_received != Rgb(0.0f))
        gloss.sharp = spotsOfLobe(scene, point, wo, lobe, spots_received);
    return gloss;
}

}  // namespace insitu
