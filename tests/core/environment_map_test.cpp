#include "core/environment_map.h"

#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

TEST(EnvironmentMap, SixAxisDirections)
{
    // Centre column along -z, +x a quarter to the right of it, +y on the top row.
    const std::vector<std::pair<glm::dvec3, glm::dvec2>> cases = {
        {{0, 0, -1}, {0.5, 0.5}}, {{1, 0, 0}, {0.75, 0.5}}, {{-1, 0, 0}, {0.25, 0.5}}};
    for (const auto& [direction, uv] : cases) {
        const glm::dvec2 seen = environmentUvFromDirection(direction);
        EXPECT_NEAR(seen.x, uv.x, tolerance::kDouble);
        EXPECT_NEAR(seen.y, uv.y, tolerance::kDouble);
        EXPECT_NEAR(glm::length(environmentDirectionFromUv(uv) - direction), 0.0, 1e-15 * 10);
    }
    const double back = environmentUvFromDirection({0, 0, 1}).x;  // the seam: 0 or 1
    EXPECT_NEAR(std::abs(back - 0.5), 0.5, tolerance::kDouble);
    EXPECT_NEAR(environmentUvFromDirection({0, 1, 0}).y, 0.0, tolerance::kDouble);
    EXPECT_NEAR(environmentUvFromDirection({0, -1, 0}).y, 1.0, tolerance::kDouble);
}

TEST(EnvironmentMap, MappingIsInverse)
{
    RandomStream random(8, 0, 0);
    for (int i = 0; i < 1000; ++i) {
        const glm::dvec2 uv(random.uniformDouble(), 0.001 + 0.998 * random.uniformDouble());
        const glm::dvec3 direction = environmentDirectionFromUv(uv);
        EXPECT_NEAR(glm::length(direction), 1.0, tolerance::kDouble);
        const glm::dvec2 back = environmentUvFromDirection(direction);
        EXPECT_NEAR(back.x, uv.x, 1e-9);  // acos loses half the digits near the poles
        EXPECT_NEAR(back.y, uv.y, 1e-9);
    }
}

TEST(EnvironmentMap, TexelsTileTheSphere)
{
    for (const int height : {1, 7, 64}) {
        const int width = 2 * height;
        double sum = 0.0;
        for (int y = 0; y < height; ++y)
            sum += width * environmentTexelSolidAngle(width, height, y);
        EXPECT_NEAR(sum, 4.0 * pi, 4.0 * pi * tolerance::kDouble);
    }
}

TEST(EnvironmentMap, LookUpInterpolatesAndWraps)
{
    EnvironmentMap map{Image<Rgb>(8, 4)};
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 8; ++x)
            map.pixels(x, y) = Rgb(x, y, 1.0f);
    const auto at = [&](double x, double y) {
        return lookUp(map, environmentDirectionFromUv({x / 8.0, y / 4.0}));
    };
    EXPECT_NEAR(at(2.5, 1.5).r, 2.0, tolerance::kFloat);
    EXPECT_NEAR(at(3.0, 2.0).r, 2.5, tolerance::kFloat);
    EXPECT_NEAR(at(3.0, 2.0).g, 1.5, tolerance::kFloat);
    // On the seam: halfway between the last column and the first.
    EXPECT_NEAR(at(0.0, 1.5).r, 3.5, tolerance::kFloat);
    EXPECT_NEAR(at(8.0, 1.5).r, 3.5, tolerance::kFloat);
    EXPECT_NEAR(at(7.75, 1.5).r, 0.75 * 7.0, tolerance::kFloat);
    // Above the first row's centre: clamped.
    EXPECT_NEAR(at(2.5, 0.1).g, 0.0, tolerance::kFloat);
}

// E = pi L for a uniform sphere of radiance L, in any direction.
TEST(EnvironmentMap, IrradianceOfAUniformSphere)
{
    const EnvironmentMap map{Image<Rgb>(128, 64, Rgb(1.0f, 2.0f, 0.5f))};
    for (const glm::dvec3 normal :
         {glm::dvec3(0, 1, 0), glm::dvec3(0, -1, 0), glm::normalize(glm::dvec3(1, 2, -3))}) {
        const glm::dvec3 e = irradiance(map, normal);
        // Midpoint rule over 64 rows: the error is of second order, (pi/64)²/24 each way.
        constexpr double kMidpoint = 4e-4;
        EXPECT_NEAR(e.r, pi, pi * kMidpoint);
        EXPECT_NEAR(e.g, 2.0 * pi, 2.0 * pi * kMidpoint);
        EXPECT_NEAR(e.b, 0.5 * pi, 0.5 * pi * kMidpoint);
    }
}

// A cap of half angle a about the normal gives E = pi L sin² a.
TEST(EnvironmentMap, IrradianceOfACapOverhead)
{
    EnvironmentMap map{Image<Rgb>(256, 128)};
    constexpr int kRows = 32;  // a = 45°
    for (int y = 0; y < kRows; ++y)
        for (Rgb& texel : map.pixels.row(y))
            texel = Rgb(3.0f);
    const double expected = pi * 3.0 * 0.5;
    EXPECT_NEAR(irradiance(map, {0, 1, 0}).g, expected, expected * tolerance::kQuadrature);
    EXPECT_EQ(irradiance(map, {0, -1, 0}).g, 0.0);
}

}  // namespace
}  // namespace insitu
