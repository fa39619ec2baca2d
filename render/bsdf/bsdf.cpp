#include "render/bsdf/bsdf.h"

#include "core/color.h"
#include "lighting/sampling.h"
#include "render/bsdf/ggx.h"

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
/// angles of a smooth surface. Instead, with g(c) = 1 − F_dielectric(c), as in [Shirley97] 3,
///   f_d = base/π · g(cos_o) g(cos_i) / ∫ 2c g(c) dc,   ∫ 2c g = 1 − f0 − (f90 − f0)/21,
/// whose reflectance for light from wo is base·g(cos_o): what the smooth coat lets through.
class Lobes {
public:
    explicit Lobes(const SurfaceMaterial& m)
        : alpha_(std::max(1e-4, static_cast<double>(m.roughness) * m.roughness)),
          dielectric_f0_(0.04 * m.specular),
          dielectric_f90_(m.specular),
          f0_(glm::mix(glm::dvec3(dielectric_f0_), glm::dvec3(m.base_color), double(m.metallic))),
          f90_(glm::mix(dielectric_f90_, 1.0, double(m.metallic))),
          diffuse_(glm::dvec3(m.base_color) * (1.0 - double(m.metallic))),
          glossy_(isGlossy(m))
    {
    }

    [[nodiscard]] glm::dvec3 evaluate(glm::dvec3 wo, glm::dvec3 wi) const
    {
        if (!(wi.z > 0.0)) return glm::dvec3(0.0);
        const double mean = 1.0 - dielectric_f0_ - (dielectric_f90_ - dielectric_f0_) / 21.0;
        glm::dvec3 f(0.0);
        if (mean > 0.0) f = diffuse_ * (transmitted(wo.z) * transmitted(wi.z) / (mean * pi));
        if (glossy_ && wo.z > 0.0) {
            const glm::dvec3 h = glm::normalize(wo + wi);
            const double facets = ggx::distribution(h, alpha_) * ggx::visibility(wo, wi, alpha_);
            f += fresnel(glm::dot(wo, h)) * facets;
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
    [[nodiscard]] glm::dvec3 fresnel(double cosine) const
    {
        return f0_ + (f90_ - f0_) * schlick(cosine);
    }
    /// g of the comment above.
    [[nodiscard]] double transmitted(double cosine) const
    {
        return 1.0 - dielectric_f0_ - (dielectric_f90_ - dielectric_f0_) * schlick(cosine);
    }
    /// Share of draws that go to the glossy lobe: by what each lobe reflects, neither starved.
    [[nodiscard]] double glossyShare(glm::dvec3 wo) const
    {
        if (!glossy_ || !(wo.z > 0.0)) return 0.0;
        const double glossy = static_cast<double>(luminance(Rgb(fresnel(wo.z))));
        const double diffuse = static_cast<double>(luminance(Rgb(diffuse_))) * transmitted(wo.z);
        if (!(diffuse > 0.0)) return 1.0;
        return std::clamp(glossy / (glossy + diffuse), 0.1, 0.9);
    }

    double alpha_;
    double dielectric_f0_;
    double dielectric_f90_;
    glm::dvec3 f0_;
    double f90_;
    glm::dvec3 diffuse_;
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
