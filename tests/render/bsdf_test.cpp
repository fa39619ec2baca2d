#include "render/bsdf/bsdf.h"

#include "core/color.h"
#include "core/random.h"
#include "render/bsdf/ggx.h"
#include "render/bsdf/ggx_albedo.h"
#include "tests/support/chi_square.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

const glm::dvec3 kUp(0.0, 1.0, 0.0);

SurfaceMaterial lambert(float albedo)
{
    return {.base_color = Rgb(albedo), .metallic = 0.0f, .roughness = 1.0f, .specular = 0.0f};
}
SurfaceMaterial plastic(float albedo, float roughness)
{
    return {.base_color = Rgb(albedo), .metallic = 0.0f, .roughness = roughness};
}
SurfaceMaterial metal(float albedo, float roughness)
{
    return {.base_color = Rgb(albedo), .metallic = 1.0f, .roughness = roughness};
}

/// Unit vector at this cosine from +y.
glm::dvec3 at(double cosine, double azimuth)
{
    const double sine = std::sqrt(1.0 - cosine * cosine);
    return {sine * std::cos(azimuth), cosine, sine * std::sin(azimuth)};
}

/// Reflectance for light from everywhere, ∫ f cos dω, by the midpoint rule in the half angle's
/// slope and azimuth about the normal: h = (tan φ, 1), which follows narrow lobes. Independent of
/// the sampling code: dω_i = 4 (wo·h) dω_h.
double albedoByQuadrature(const SurfaceMaterial& m, double cosine)
{
    const glm::dvec3 wo = at(cosine, 0.0);
    constexpr int kPolar = 800;
    constexpr int kAzimuth = 360;
    double sum = 0.0;
    for (int i = 0; i < kPolar; ++i) {
        // sin θ_h = s²: dense near the lobe's peak.
        const double s0 = static_cast<double>(i) / kPolar;
        const double s1 = (i + 1.0) / kPolar;
        const double c0 = std::sqrt(1.0 - std::pow(s0, 4.0));
        const double c1 = std::sqrt(1.0 - std::pow(s1, 4.0));
        const double c = 0.5 * (c0 + c1);
        for (int j = 0; j < kAzimuth; ++j) {
            const glm::dvec3 h = at(c, 2.0 * pi * (j + 0.5) / kAzimuth);
            const double oh = glm::dot(wo, h);
            if (oh <= 0.0) continue;
            const glm::dvec3 wi = 2.0 * oh * h - wo;
            if (wi.y <= 0.0) continue;
            const double solid_angle = (c0 - c1) * 2.0 * pi / kAzimuth;
            sum += static_cast<double>(luminance(evaluateBsdf(m, kUp, wo, wi))) * wi.y * 4.0 * oh *
                   solid_angle;
        }
    }
    return sum;
}

/// The same from the sampler's weights, on a low-discrepancy set of random numbers: multiples of
/// powers of the root of x⁴ = x + 1.
double albedoBySampling(const SurfaceMaterial& m, double cosine)
{
    const glm::dvec3 wo = at(cosine, 0.7);
    constexpr int kPoints = 20000;
    double sum = 0.0;
    for (int i = 0; i < kPoints; ++i) {
        const glm::vec3 u(glm::fract(0.5 + (i + 1.0) * glm::dvec3(0.8191725133961645,
                                                                  0.6710436067037893,
                                                                  0.5497004779019703)));
        const std::optional<BsdfSample> sample = sampleBsdf(m, kUp, wo, u.z, {u.x, u.y});
        if (sample) sum += static_cast<double>(luminance(sample->weight));
    }
    return sum / kPoints;
}

TEST(Bsdf, WithoutSpecularItIsLambertExactly)
{
    const Rgb f = evaluateBsdf(lambert(0.6f), kUp, at(0.3, 1.0), at(0.8, -2.0));
    EXPECT_NEAR(f.r, 0.6 / pi, tolerance::kFloat);
    // Whatever the viewer's direction, even below an interpolated normal's horizon.
    EXPECT_EQ(evaluateBsdf(lambert(0.6f), kUp, at(-0.4, 1.0), at(0.1, 0.0)), f);
    EXPECT_EQ(evaluateBsdf(lambert(0.6f), kUp, at(0.3, 1.0), at(-0.1, 0.0)), Rgb(0.0f));
    const std::optional<BsdfSample> sample =
        sampleBsdf(lambert(0.6f), kUp, at(-0.4, 1.0), 0.3f, {0.2f, 0.9f});
    ASSERT_TRUE(sample.has_value());
    EXPECT_NEAR(sample->weight.r, 0.6, tolerance::kFloat);
}

TEST(Bsdf, IsReciprocal)
{
    RandomStream random(1, 0, 0);
    for (int i = 0; i < 500; ++i) {
        SurfaceMaterial m = plastic(0.7f, random.uniform());
        m.metallic = random.uniform();
        m.specular = random.uniform();
        const glm::dvec3 a = at(0.01 + 0.98 * random.uniform(), 7.0 * random.uniform());
        const glm::dvec3 b = at(0.01 + 0.98 * random.uniform(), 7.0 * random.uniform());
        const float ab = evaluateBsdf(m, kUp, a, b).g;
        EXPECT_NEAR(evaluateBsdf(m, kUp, b, a).g, ab, tolerance::kFloat * ab);
    }
}

// For alpha = 1 and F = 1: D = 1/π and G2/(4 cos_o cos_i) = 1/(2 (cos_o + cos_i)), so the albedo is
// ∫ c/(c + cos_o) dc = 1 − cos_o ln((1 + cos_o)/cos_o); at normal incidence 1 − ln 2.
TEST(Bsdf, RoughestMetalReflectsTheClosedFormShare)
{
    EXPECT_NEAR(albedoBySampling(metal(1.0f, 1.0f), 1.0), 0.306852819, 1e-3);
    for (const double cosine : {0.05, 0.3, 0.7, 1.0}) {
        const double truth = 1.0 - cosine * std::log((1.0 + cosine) / cosine);
        // The horizon cuts through the cells of both rules.
        EXPECT_NEAR(albedoByQuadrature(metal(1.0f, 1.0f), cosine), truth, 5e-3) << cosine;
        EXPECT_NEAR(albedoBySampling(metal(1.0f, 1.0f), cosine), truth, 1e-3) << cosine;
    }
}

TEST(Bsdf, SamplingAgreesWithQuadrature)
{
    for (const float roughness : {0.3f, 0.6f, 1.0f})
        for (const double cosine : {0.2, 0.6, 0.95})
            for (const SurfaceMaterial& m : {metal(1.0f, roughness), plastic(0.8f, roughness)})
                EXPECT_NEAR(albedoBySampling(m, cosine), albedoByQuadrature(m, cosine), 2e-3)
                    << "roughness " << roughness << " cosine " << cosine << " metallic "
                    << m.metallic;
}

// No surface sends back more than it receives. A white dielectric sends back everything, a white
// metal all but what its facets scatter more than once.
TEST(Bsdf, WhiteFurnace)
{
    for (const float roughness : {0.0f, 0.02f, 0.1f, 0.33f, 0.5f, 0.8f, 1.0f})
        for (const double cosine : {0.02, 0.1, 0.3, 0.6, 1.0})
            for (const float metallic : {0.0f, 0.5f, 1.0f})
                for (const float specular : {0.0f, 0.5f, 1.0f}) {
                    SCOPED_TRACE(testing::Message()
                                 << "roughness " << roughness << " cosine " << cosine
                                 << " metallic " << metallic << " specular " << specular);
                    SurfaceMaterial m = plastic(1.0f, roughness);
                    m.metallic = metallic;
                    m.specular = specular;
                    const double albedo = albedoBySampling(m, cosine);
                    // The coat's albedo is a table, good to 4e-3 (ggx_albedo.h); the set adds 1e-3.
                    EXPECT_LE(albedo, 1.0 + 5e-3);
                    if (metallic == 0.0f) {
                        EXPECT_GE(albedo, 1.0 - 5e-3);
                    }
                    EXPECT_GE(albedo, 0.3);
                }
    EXPECT_NEAR(albedoBySampling(metal(1.0f, 0.02f), 0.5), 1.0, 1e-3);
}

// The table against the quadrature: F = 1 everywhere is a metal with base 1, F = (1 − c)^5 one with
// base 0.
TEST(GgxAlbedo, TableMatchesQuadrature)
{
    for (const float roughness : {0.27f, 0.45f, 0.71f, 1.0f})
        for (const double cosine : {0.05, 0.22, 0.57, 0.93}) {
            const ggx::Albedo albedo = ggx::directionalAlbedo(roughness, cosine);
            EXPECT_NEAR(
                albedo.of(1.0, 1.0), albedoByQuadrature(metal(1.0f, roughness), cosine), 5e-3)
                << roughness << " " << cosine;
            EXPECT_NEAR(albedo.at_f90, albedoByQuadrature(metal(0.0f, roughness), cosine), 5e-3)
                << roughness << " " << cosine;
        }
    // Roughest: the mean of the closed form above.
    double mean = 0.0;
    for (int i = 0; i < 10000; ++i) {
        const double c = (i + 0.5) / 10000.0;
        mean += 2.0 * c * (1.0 - c * std::log((1.0 + c) / c)) / 10000.0;
    }
    EXPECT_NEAR(ggx::meanAlbedo(1.0).of(1.0, 1.0), mean, 1e-3);
}

TEST(Bsdf, WeightIsValueTimesCosineOverPdf)
{
    RandomStream random(5, 0, 0);
    const glm::dvec3 normal = glm::normalize(glm::dvec3(0.2, -0.7, 0.4));
    const glm::dvec3 wo = glm::normalize(normal + glm::dvec3(0.5, 0.1, -0.3));
    for (int i = 0; i < 300; ++i) {
        const SurfaceMaterial m = plastic(0.7f, 0.2f + 0.8f * random.uniform());
        const float selector = random.uniform();
        const std::optional<BsdfSample> sample =
            sampleBsdf(m, normal, wo, selector, random.uniform2());
        if (!sample) continue;
        EXPECT_NEAR(glm::length(sample->direction), 1.0, 1e-9);
        const double pdf = bsdfPdf(m, normal, wo, sample->direction);
        EXPECT_NEAR(sample->pdf, pdf, 1e-6 * pdf);
        const double weight =
            static_cast<double>(evaluateBsdf(m, normal, wo, sample->direction).g) *
            glm::dot(normal, sample->direction) / pdf;
        EXPECT_NEAR(sample->weight.g, weight, 1e-4 * weight);
    }
}

TEST(Bsdf, SmoothMetalIsAMirror)
{
    const glm::dvec3 wo = at(0.6, 0.4);
    const glm::dvec3 mirrored(-wo.x, wo.y, -wo.z);
    for (const float u : {0.0f, 0.3f, 0.9f}) {
        const std::optional<BsdfSample> sample =
            sampleBsdf(metal(0.9f, 0.0f), kUp, wo, 0.5f, {u, u});
        ASSERT_TRUE(sample.has_value());
        EXPECT_LT(glm::length(sample->direction - mirrored), 5e-3);
        EXPECT_NEAR(sample->weight.g, 0.9, 0.01);
        EXPECT_TRUE(std::isfinite(sample->pdf));
    }
}

// Facets seen from any direction add up to what is seen: ∫ masking·D·max(0, w·h) dω_h = cos.
TEST(Ggx, MaskingKeepsTheProjectedArea)
{
    for (const double alpha : {0.1, 0.5, 1.0})
        for (const double cosine : {0.1, 0.5, 0.9}) {
            const glm::dvec3 w(std::sqrt(1.0 - cosine * cosine), 0.0, cosine);
            constexpr int kSteps = 2000;
            double sum = 0.0;
            for (int i = 0; i < kSteps; ++i) {
                const double c0 = std::sqrt(1.0 - std::pow(static_cast<double>(i) / kSteps, 4.0));
                const double c1 = std::sqrt(1.0 - std::pow((i + 1.0) / kSteps, 4.0));
                const double c = 0.5 * (c0 + c1);
                const double s = std::sqrt(1.0 - c * c);
                for (int j = 0; j < 360; ++j) {
                    const double azimuth = 2.0 * pi * (j + 0.5) / 360.0;
                    const glm::dvec3 h(s * std::cos(azimuth), s * std::sin(azimuth), c);
                    sum += ggx::distribution(h, alpha) * std::max(0.0, glm::dot(w, h)) * (c0 - c1) *
                           2.0 * pi / 360.0;
                }
            }
            EXPECT_NEAR(sum * ggx::masking(w, alpha), cosine, 5e-4) << alpha << " " << cosine;
        }
}

struct Lobe {
    const char* name;
    SurfaceMaterial material;
    double cosine;
};

class BsdfChiSquare : public testing::TestWithParam<Lobe> {};

std::vector<Lobe> lobes()
{
    std::vector<Lobe> all;
    for (const double cosine : {0.98, 0.5, 0.1})
        for (const float roughness : {0.25f, 0.5f, 1.0f}) {
            all.push_back({"metal", metal(0.8f, roughness), cosine});
            all.push_back({"plastic", plastic(0.5f, roughness), cosine});
        }
    all.push_back({"lambert", lambert(0.5f), 0.3});
    return all;
}

TEST_P(BsdfChiSquare, DrawsWithTheDensityItClaims)
{
    const auto& [name, material, cosine] = GetParam();
    SCOPED_TRACE(testing::Message()
                 << name << " roughness " << material.roughness << " cosine " << cosine);
    const glm::dvec3 wo = at(cosine, 0.3);
    chi_square::expectDirections(
        [&](RandomStream& random) -> std::optional<glm::dvec3> {
            const float selector = random.uniform();
            const std::optional<BsdfSample> sample =
                sampleBsdf(material, kUp, wo, selector, random.uniform2());
            if (!sample) return std::nullopt;
            return sample->direction;
        },
        [&](glm::dvec3 wi) { return bsdfPdf(material, kUp, wo, wi); },
        // At grazing angles a lobe is alpha·cos wide in azimuth: about 0.006 for the narrowest
        // here.
        {.rows = 16,
         .columns = 32,
         .inner = material.roughness < 0.3f && cosine < 0.3 ? 64 : 16,
         .draws = 40000,
         .seed = 1},
        chi_square::sidakLevel(static_cast<int>(lobes().size())));
}

INSTANTIATE_TEST_SUITE_P(Lobes, BsdfChiSquare, testing::ValuesIn(lobes()));

}  // namespace
}  // namespace insitu
