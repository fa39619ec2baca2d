#include "lighting/environment_light.h"

#include "core/check.h"
#include "core/color.h"
#include "core/random.h"
#include "tests/support/chi_square.h"
#include "tests/support/form_factor.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

constexpr int kChiSquareTests = 5;

EnvironmentMap constantEnvironment(float radiance, int width = 16)
{
    return {Image<Rgb>(width, width / 2, Rgb(radiance))};
}

/// Smooth noise with a bright texel and black ones, as rooms have.
EnvironmentMap roomLikeEnvironment(int width, std::uint64_t seed)
{
    EnvironmentMap environment{Image<Rgb>(width, width / 2)};
    RandomStream random(seed, 0, 0);
    for (Rgb& pixel : environment.pixels.pixels())
        pixel = random.uniform() < 0.3f ? Rgb(0.0f) : Rgb(random.uniform(), random.uniform(), 0.5f);
    environment.pixels(width / 3, width / 8) = Rgb(200.0f, 180.0f, 150.0f);
    environment.pixels(0, width / 4) = Rgb(80.0f);  // bleeds over the seam
    return environment;
}

struct Estimate {
    double mean = 0.0;
    double standard_error = 0.0;
};

/// Irradiance (luminance) by the light's own samples.
Estimate irradianceOf(const LightSource& light, glm::dvec3 x, glm::dvec3 normal, int samples)
{
    double sum = 0.0;
    double squares = 0.0;
    for (int i = 0; i < samples; ++i) {
        RandomStream random(5, 1, static_cast<std::uint64_t>(i));
        const float selector = random.uniform();
        const std::optional<LightSample> sample = light.sample(x, selector, random.uniform2());
        if (!sample) continue;
        const double value = static_cast<double>(luminance(sample->radiance)) *
                             std::max(0.0, glm::dot(normal, sample->direction)) / sample->pdf;
        sum += value;
        squares += value * value;
    }
    const double n = samples;
    return {sum / n, std::sqrt(std::max(0.0, squares - sum * sum / n) / (n * (n - 1.0)))};
}

void expectNear(const Estimate& estimate, double truth, double widest)
{
    EXPECT_NEAR(
        estimate.mean, truth, tolerance::kStandardErrors * estimate.standard_error + 1e-9 * truth);
    EXPECT_LT(estimate.standard_error, widest * truth) << "too noisy to tell";
}

AreaLamp ceilingLamp(float radiance = 3.0f)
{
    // Looks down: edge_u × edge_v is along −y.
    return {{{-0.5, 2.0, -0.25}, {1.0, 0.0, 0.0}, {0.0, 0.0, 0.5}}, Rgb(radiance), false};
}

TEST(EnvironmentLight, UniformHemisphereGivesPiTimesRadiance)
{
    const EnvironmentLight light(constantEnvironment(2.0f));
    const glm::dvec3 normal = glm::normalize(glm::dvec3(0.3, 0.8, -0.2));
    expectNear(irradianceOf(light, glm::dvec3(1.0, 2.0, 3.0), normal, 20000), 2.0 * pi, 0.01);
}

// A disc of half angle θ around the normal: E = π L sin²θ.
TEST(EnvironmentLight, DiscAroundTheNormal)
{
    constexpr int kHeight = 256;
    constexpr int kRows = 32;
    EnvironmentMap environment{Image<Rgb>(2 * kHeight, kHeight)};
    for (int y = 0; y < kRows; ++y)
        for (Rgb& pixel : environment.pixels.row(y))
            pixel = Rgb(5.0f);
    const double half_angle = pi * kRows / kHeight;
    const double truth = 5.0 * pi * std::sin(half_angle) * std::sin(half_angle);
    const EnvironmentLight light(environment);
    const Estimate estimate = irradianceOf(light, glm::dvec3(0.0), {0.0, 1.0, 0.0}, 100000);
    // The bilinear edge is one texel wide: second order in its width, below 1e-4 here.
    EXPECT_NEAR(
        estimate.mean,
        truth,
        tolerance::kStandardErrors * estimate.standard_error + tolerance::kQuadrature * truth);
    EXPECT_LT(estimate.standard_error, 0.002 * truth);
}

TEST(EnvironmentLight, SamplesTellTheSameAsIncident)
{
    const EnvironmentLight light(roomLikeEnvironment(32, 3),
                                 {{{{-1.0, 0.5, -2.0}, {2.0, 0.0, 0.0}, {0.0, 1.0, 0.0}}}},
                                 {ceilingLamp()});
    const glm::dvec3 x(0.1, 0.2, 0.3);
    for (int i = 0; i < 2000; ++i) {
        RandomStream random(2, 0, static_cast<std::uint64_t>(i));
        const float selector = random.uniform();
        const std::optional<LightSample> sample = light.sample(x, selector, random.uniform2());
        ASSERT_TRUE(sample.has_value());
        const IncidentLight incident = light.incident(x, sample->direction);
        EXPECT_EQ(sample->radiance, incident.radiance);
        EXPECT_EQ(sample->pdf, incident.pdf);
        EXPECT_EQ(sample->distance_m, incident.distance_m);
    }
}

void expectChiSquare(const EnvironmentLight& light, glm::dvec3 x, int inner)
{
    chi_square::expectDirections(
        [&](RandomStream& random) -> std::optional<glm::dvec3> {
            const float selector = random.uniform();
            const std::optional<LightSample> sample = light.sample(x, selector, random.uniform2());
            if (!sample) return std::nullopt;
            return sample->direction;
        },
        [&](glm::dvec3 direction) { return light.incident(x, direction).pdf; },
        {.rows = 16, .columns = 32, .inner = inner, .draws = 50000, .seed = 4},
        chi_square::sidakLevel(kChiSquareTests));
}

TEST(EnvironmentLight, ChiSquareOfTheEnvironment)
{
    expectChiSquare(EnvironmentLight(roomLikeEnvironment(32, 9)), glm::dvec3(0.0), 4);
}

TEST(EnvironmentLight, ChiSquareOfAPortal)
{
    // Oblique, close and a parallelogram.
    const Portal portal{{{-0.4, -0.3, -0.8}, {1.2, 0.1, 0.3}, {0.2, 0.9, -0.1}}};
    expectChiSquare(EnvironmentLight(roomLikeEnvironment(32, 9), {portal}), {0.2, 0.1, 0.3}, 32);
}

TEST(EnvironmentLight, ChiSquareOfALamp)
{
    expectChiSquare(EnvironmentLight({}, {}, {ceilingLamp()}), {0.4, 0.9, 0.1}, 32);
}

TEST(EnvironmentLight, ChiSquareOfTheMixture)
{
    AreaLamp wall{{{2.0, 0.2, -1.0}, {0.0, 0.0, 2.0}, {0.0, 1.5, 0.0}}, Rgb(1.0f), true};
    const Portal portal{{{-1.0, -1.0, -1.5}, {2.0, 0.0, 0.0}, {0.0, 2.0, 0.0}}};
    const EnvironmentLight light(roomLikeEnvironment(32, 21), {portal}, {ceilingLamp(), wall});
    expectChiSquare(light, {0.4, 0.3, 0.1}, 32);
    expectChiSquare(light, {0.0, 3.0, -3.0}, 32);  // behind lamp and portal
}

// The closed forms of a lamp: parallel and perpendicular receivers, and any other by Lambert's
// contour integral.
TEST(EnvironmentLight, LampIrradianceIsItsFormFactor)
{
    const AreaLamp lamp = ceilingLamp(3.0f);
    const EnvironmentLight light({}, {}, {lamp});
    const std::vector<glm::dvec3> outline = {
        {-0.5, 2.0, -0.25}, {-0.5, 2.0, 0.25}, {0.5, 2.0, 0.25}, {0.5, 2.0, -0.25}};
    const glm::dvec3 up(0.0, 1.0, 0.0);
    // Under the middle: four quarter rectangles with their corner straight above.
    const double parallel = 3.0 * pi * 4.0 * form_factor::parallelRectangle(0.5, 0.25, 2.0);
    EXPECT_NEAR(form_factor::polygonIrradiance(outline, glm::dvec3(0.0), up, 3.0),
                parallel,
                tolerance::kDouble * parallel);
    expectNear(irradianceOf(light, glm::dvec3(0.0), up, 40000), parallel, 0.001);
    // A wall beside it, and an oblique surface off the axis.
    for (const auto& [x, normal] :
         {std::pair{glm::dvec3(-1.0, 0.5, 0.1), glm::dvec3(1, 0, 0)},
          std::pair{glm::dvec3(1.0, 1.2, -0.7), glm::normalize(glm::dvec3(-1.0, 2.0, 0.5))}}) {
        const double truth = form_factor::polygonIrradiance(outline, x, normal, 3.0);
        ASSERT_GT(truth, 0.0);
        expectNear(irradianceOf(light, x, normal, 40000), truth, 0.01);
    }
}

TEST(EnvironmentLight, PortalsChangeNoiseButNotTheMean)
{
    const EnvironmentMap environment = roomLikeEnvironment(64, 5);
    const glm::dvec3 x(0.0, 1.0, 0.0);
    const glm::dvec3 normal(0.0, 0.0, -1.0);
    double truth = 0.0;
    const int rows = 1024;
    for (int row = 0; row < rows; ++row)
        for (int column = 0; column < 2 * rows; ++column) {
            const glm::dvec3 d =
                environmentDirectionFromUv({(column + 0.5) / (2 * rows), (row + 0.5) / rows});
            truth += static_cast<double>(luminance(lookUp(environment, d))) *
                     std::max(0.0, glm::dot(d, normal)) *
                     environmentTexelSolidAngle(2 * rows, rows, row);
        }
    const Portal portal{{{-1.0, 0.0, -1.0}, {2.0, 0.0, 0.0}, {0.0, 2.0, 0.0}}};
    expectNear(irradianceOf(EnvironmentLight(environment), x, normal, 50000), truth, 0.02);
    expectNear(
        irradianceOf(EnvironmentLight(environment, {portal}), x, normal, 400000), truth, 0.02);
}

TEST(EnvironmentLight, LampsHideWhatIsBehindThem)
{
    AreaLamp far_lamp = ceilingLamp(7.0f);
    far_lamp.quad.corner.y = 3.0;
    const EnvironmentLight light(constantEnvironment(1.0f), {}, {far_lamp, ceilingLamp(3.0f)});
    const IncidentLight up = light.incident(glm::dvec3(0.0), {0.0, 1.0, 0.0});
    EXPECT_EQ(up.radiance, Rgb(3.0f));
    EXPECT_DOUBLE_EQ(up.distance_m, 2.0);
    // Between the two only the farther is in front; seen from above neither is there.
    EXPECT_EQ(light.incident({0.0, 2.5, 0.0}, {0.0, 1.0, 0.0}).radiance, Rgb(7.0f));
    const IncidentLight from_above = light.incident({0.0, 4.0, 0.0}, {0.0, -1.0, 0.0});
    EXPECT_EQ(from_above.radiance, Rgb(1.0f));
    EXPECT_EQ(from_above.distance_m, std::numeric_limits<double>::infinity());
}

TEST(EnvironmentLight, TwoSidedLampShinesBothWays)
{
    AreaLamp lamp = ceilingLamp(3.0f);
    lamp.two_sided = true;
    const EnvironmentLight light({}, {}, {lamp});
    EXPECT_EQ(light.incident({0.0, 4.0, 0.0}, {0.0, -1.0, 0.0}).radiance, Rgb(3.0f));
    EXPECT_EQ(light.incident({0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}).radiance, Rgb(3.0f));
}

TEST(EnvironmentLight, NothingShinesInTheDark)
{
    for (const EnvironmentLight& light :
         {EnvironmentLight(EnvironmentMap{}), EnvironmentLight(constantEnvironment(0.0f))}) {
        EXPECT_FALSE(light.sample(glm::dvec3(0.0), 0.5f, glm::vec2(0.5f)).has_value());
        const IncidentLight incident = light.incident(glm::dvec3(0.0), {0.0, 1.0, 0.0});
        EXPECT_EQ(incident.radiance, Rgb(0.0f));
        EXPECT_EQ(incident.pdf, 0.0);
    }
}

TEST(EnvironmentLight, RefusesWhatCannotBeLight)
{
    EnvironmentMap broken = constantEnvironment(1.0f);
    broken.pixels(3, 2).g = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(EnvironmentLight{broken}, LogicError);
    broken.pixels(3, 2).g = -1.0f;
    EXPECT_THROW(EnvironmentLight{broken}, LogicError);
    AreaLamp flat = ceilingLamp();
    flat.quad.edge_v = flat.quad.edge_u * 2.0;
    EXPECT_THROW(EnvironmentLight({}, {}, {flat}), LogicError);
    EXPECT_THROW(EnvironmentLight({}, {Portal{flat.quad}}, {}), LogicError);
}

}  // namespace
}  // namespace insitu
