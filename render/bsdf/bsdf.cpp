#include "render/bsdf/bsdf.h"

#include "core/color.h"
#include "lighting/sampling.h"
#include "render/bsdf/ggx.h"
#include "render/bsdf/ggx_albedo.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// Schlick's weight (1 − c)^5. Source: [Schlick94].
double schlick(double cosine)
{
    const double m = std::clamp(1.0 - cosine, 0.0, 1.0);
    const double m2 = m * m;
    return m2 * m2 * m;
}

/// The material as the two lobes see it. Directions are in the frame where the normal is +z.
///
/// Specular: D·V·F with F = f0 + (f90 − f0)(1 − wo·h)^5; f0 mixes 0.04·specular and base colour,
/// f90 mixes specular and 1, both by metallic (glTF 2.0 B.2.1, KHR_materials_specular).
///
/// Diffuse: glTF scales base/π by 1 − F(wo·h), which sends back up to twice the light at grazing
/// angles of a smooth surface. Instead the base gets what the dielectric coat does not reflect, on
/// the way in and on the way out [KelSzi01]: with E the coat's directional albedo,
///   f_d = base/π · (1 − E(cos_o)) (1 − E(cos_i)) / (1 − mean E),
/// whose reflectance for light from wo is base·(1 − E(cos_o)). A white dielectric thus reflects
/// all.
class Lobes {
public:
    explicit Lobes(const SurfaceMaterial& m)
        : roughness_(m.roughness),
          alpha_(ggx::alphaFromRoughness(roughness_)),
          coat_f0_(0.04 * m.specular),
          coat_f90_(m.specular),
          f0_(glm::mix(glm::dvec3(coat_f0_), glm::dvec3(m.base_color), double(m.metallic))),
          f90_(glm::mix(coat_f90_, 1.0, double(m.metallic))),
          diffuse_(glm::dvec3(m.base_color) * (1.0 - double(m.metallic))),
          coated_(m.specular > 0.0f && m.metallic < 1.0f),
          glossy_(isGlossy(m))
    {
    }

    [[nodiscard]] glm::dvec3 evaluate(glm::dvec3 wo, glm::dvec3 wi) const
    {
        if (!(wi.z > 0.0)) return glm::dvec3(0.0);
        glm::dvec3 f = diffuse_ / pi;
        if (coated_)
            f *= transmitted(wo.z) * transmitted(wi.z) /
                 (1.0 - ggx::meanAlbedo(roughness_).of(coat_f0_, coat_f90_));
        if (glossy_ && wo.z > 0.0) {
            const glm::dvec3 h = glm::normalize(wo + wi);
            const double facets = ggx::distribution(h, alpha_) * ggx::visibility(wo, wi, alpha_);
            f += (f0_ + (f90_ - f0_) * schlick(glm::dot(wo, h))) * facets;
        }
        return f;
    }

    [[nodiscard]] double pdf(glm::dvec3 wo, glm::dvec3 wi) const
    {
        if (!(wi.z > 0.0)) return 0.0;
        const double glossy = glossyShare(wo);
        double density = (1.0 - glossy) * wi.z / pi;
        if (glossy > 0.0) {
            const glm::dvec3 h = glm::normalize(wo + wi);
            density +=
                glossy * ggx::masking(wo, alpha_) * ggx::distribution(h, alpha_) / (4.0 * wo.z);
        }
        return density;
    }

    [[nodiscard]] glm::dvec3 draw(glm::dvec3 wo, float selector, glm::vec2 u) const
    {
        if (static_cast<double>(selector) >= glossyShare(wo)) return cosineHemisphere(u);
        const glm::dvec3 h = ggx::drawVisibleNormal(wo, alpha_, glm::dvec2(u));
        return 2.0 * glm::dot(wo, h) * h - wo;
    }

    [[nodiscard]] bool black() const
    {
        return !glossy_ && diffuse_.x <= 0.0 && diffuse_.y <= 0.0 && diffuse_.z <= 0.0;
    }

private:
    /// What the coat lets through, 1 − E.
    [[nodiscard]] double transmitted(double cosine) const
    {
        return 1.0 - ggx::directionalAlbedo(roughness_, cosine).of(coat_f0_, coat_f90_);
    }
    /// Share of draws that go to the glossy lobe: by what each lobe reflects, neither starved.
    [[nodiscard]] double glossyShare(glm::dvec3 wo) const
    {
        if (!glossy_ || !(wo.z > 0.0)) return 0.0;
        const auto base = static_cast<double>(luminance(Rgb(diffuse_)));
        if (!(base > 0.0)) return 1.0;
        const ggx::Albedo albedo = ggx::directionalAlbedo(roughness_, wo.z);
        const double glossy = albedo.of(static_cast<double>(luminance(Rgb(f0_))), f90_);
        const double diffuse = base * (1.0 - albedo.of(coat_f0_, coat_f90_));
        return std::clamp(glossy / (glossy + diffuse), 0.1, 0.9);
    }

    double roughness_;
    double alpha_;
    double coat_f0_;  ///< of the dielectric part
    double coat_f90_;
    glm::dvec3 f0_;  ///< of the whole
    double f90_;
    glm::dvec3 diffuse_;
    bool coated_;
    bool glossy_;
};

}  // namespace

Rgb evaluateBsdf(const SurfaceMaterial& m, glm::dvec3 normal, glm::dvec3 wo, glm::dvec3 wi)
{
    const glm::dmat3 normal_from_world = glm::transpose(frameFromNormal(normal));
    return Rgb(Lobes(m).evaluate(normal_from_world * wo, normal_from_world * wi));
}

double bsdfPdf(const SurfaceMaterial& m, glm::dvec3 normal, glm::dvec3 wo, glm::dvec3 wi)
{
    const glm::dmat3 normal_from_world = glm::transpose(frameFromNormal(normal));
    return Lobes(m).pdf(normal_from_world * wo, normal_from_world * wi);
}

std::optional<BsdfSample> sampleBsdf(
    const SurfaceMaterial& m, glm::dvec3 normal, glm::dvec3 wo, float selector, glm::vec2 u)
{
    const Lobes lobes(m);
    if (lobes.black()) return std::nullopt;
    const glm::dmat3 world_from_normal = frameFromNormal(normal);
    const glm::dvec3 o = glm::transpose(world_from_normal) * wo;
    const glm::dvec3 i = lobes.draw(o, selector, u);
    const double pdf = lobes.pdf(o, i);
    if (!(pdf > 0.0)) return std::nullopt;
    const glm::dvec3 weight = lobes.evaluate(o, i) * (i.z / pdf);
    return BsdfSample{world_from_normal * i, Rgb(weight), pdf};
}

}  // namespace insitu
