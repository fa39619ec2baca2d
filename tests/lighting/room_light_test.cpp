#include "lighting/room_light.h"

#include "core/random.h"
#include "lighting/sampling.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

EnvironmentMap environmentOf(int height, const std::function<Rgb(glm::dvec3)>& radiance)
{
    EnvironmentMap map{Image<Rgb>(2 * height, height)};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < 2 * height; ++x)
            map.pixels(x, y) = radiance(
                environmentDirectionFromUv({(x + 0.5) / (2.0 * height), (y + 0.5) / height}));
    return map;
}

RoomDescription closedRoom()
{
    RoomDescription room;
    room.boxes.push_back({{-2, 0, -3}, {2, 2.5, 2}, false, ""});
    return room;
}

RoomDescription roomWithWindow()
{
    RoomDescription room = closedRoom();
    room.openings.push_back({{{2, 1, -1}, {2, 1, 1}, {2, 2, 1}, {2, 2, -1}}});
    return room;
}

/// Large texels: the tests look at the light, not at its sharpness.
RoomLightOptions coarse()
{
    RoomLightOptions options;
    options.texel_m = 0.05;
    options.cell_m = 0.5;
    return options;
}

Progress g_silent;

TEST(RoomLight, WhiteFurnaceHasIrradiancePi)
{
    const SceneProxy proxy(closedRoom());
    const EnvironmentMap white = environmentOf(64, [](glm::dvec3) { return Rgb(1.0f); });
    const RoomLight light(proxy, white, {0.3, 1.0, -0.4}, std::nullopt, coarse(), g_silent);
    EXPECT_EQ(light.incident({1, 1, 1}, {0, 0, -1}).radiance, Rgb(1.0f));
    double mean = 0.0;
    const std::size_t count = light.cellIrradiance().size();
    for (std::size_t i = 0; i < count; ++i) {
        mean += light.cellIrradiance()[i].g / static_cast<double>(count);
        // 256 samples joined with light sampling scatter by about 2 %.
        EXPECT_NEAR(light.cellIrradiance()[i].g, pi, 0.3) << i;
    }
    EXPECT_NEAR(mean, pi, 0.01);
}

TEST(RoomLight, ALampOnTheWallIsNearAndNotAtInfinity)
{
    const SceneProxy proxy(closedRoom());
    const glm::dvec3 center(0.0, 1.0, 0.0);
    const glm::dvec3 lamp(-2.0, 1.5, 0.5);
    const glm::dvec3 towards = glm::normalize(lamp - center);
    const EnvironmentMap probe = environmentOf(256, [&](glm::dvec3 d) {
        return glm::dot(d, towards) > std::cos(0.05) ? Rgb(100.0f) : Rgb(0.1f);
    });
    const RoomLight light(proxy, probe, center, std::nullopt, coarse(), g_silent);
    const glm::dvec3 x(1.0, 0.2, -1.5);
    EXPECT_NEAR(light.incident(x, glm::normalize(lamp - x)).radiance.r, 100.0f, 1.0f);
    // In the probe's own direction there is only wall.
    EXPECT_NEAR(light.incident(x, towards).radiance.r, 0.1f, 1e-4f);
}

TEST(RoomLight, WhatIsSeenThroughAnOpeningStaysAtInfinity)
{
    const SceneProxy proxy(roomWithWindow());
    const glm::dvec3 center(0.0, 1.5, 0.0);
    // The fit would try to explain walls that are darker than any such window makes them.
    RoomLightOptions options = coarse();
    options.fit_unmeasured = false;
    // Outside, radiance depends on the direction; walls are dark.
    const EnvironmentMap probe = environmentOf(256, [&](glm::dvec3 d) {
        const bool window = d.x > 0 && std::abs(d.z / d.x) < 0.49 && std::abs(d.y / d.x) < 0.245;
        return window ? Rgb(static_cast<float>(10.0 + 5.0 * d.z)) : Rgb(0.2f);
    });
    const RoomLight light(proxy, probe, center, std::nullopt, options, g_silent);
    const glm::dvec3 d = glm::normalize(glm::dvec3(1.0, 0.1, 0.3));
    const float expected = static_cast<float>(10.0 + 5.0 * d.z);
    for (const glm::dvec3& x : {glm::dvec3(0, 1.4, 0), glm::dvec3(1, 1.5, -0.5)}) {
        const RoomLight::Arrival arrival = light.arrive(x, d);
        ASSERT_TRUE(arrival.hit && arrival.hit->opening);
        EXPECT_NEAR(arrival.light.radiance.r, expected, 0.05f);
    }
    // A direction the probe did not see through the window takes the nearest one that it did.
    const glm::dvec3 steep = glm::normalize(glm::dvec3(0.5, 0.6, 0.0));
    const RoomLight::Arrival extended = light.arrive({1.6, 1.1, 0.0}, steep);
    ASSERT_TRUE(extended.hit && extended.hit->opening);
    EXPECT_NEAR(extended.light.radiance.r, 10.0f, 0.2f);
}

TEST(RoomLight, ReprojectedLightKeepsTheProbesIrradiance)
{
    const SceneProxy proxy(roomWithWindow());
    const glm::dvec3 center(0.2, 1.2, -0.3);
    const EnvironmentMap probe = environmentOf(128, [](glm::dvec3 d) {
        return Rgb(static_cast<float>(1.0 + d.x), static_cast<float>(1.2 + d.y * d.y), 1.0f);
    });
    RoomLightOptions options = coarse();
    options.fit_unmeasured = false;
    const RoomLight light(proxy, probe, center, std::nullopt, options, g_silent);
    for (const glm::dvec3& normal : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0)}) {
        glm::dvec3 sum(0.0);
        const int height = 200;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < 2 * height; ++x) {
                const glm::dvec3 d =
                    environmentDirectionFromUv({(x + 0.5) / (2.0 * height), (y + 0.5) / height});
                const double cosine = glm::dot(d, normal);
                if (cosine > 0.0)
                    sum += glm::dvec3(light.incident(center, d).radiance) *
                           (cosine * environmentTexelSolidAngle(2 * height, height, y));
            }
        const glm::dvec3 expected = irradiance(probe, normal);
        // Texels of 5 cm at 1 m: half a per cent.
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(sum[c], expected[c], 0.005 * expected[c]);
    }
}

TEST(RoomLight, LightSamplingAgreesWithCosineSampling)
{
    const SceneProxy proxy(roomWithWindow());
    const EnvironmentMap probe = environmentOf(128, [](glm::dvec3 d) {
        return d.x > 0.85 ? Rgb(20.0f) : Rgb(static_cast<float>(0.6 + 0.5 * d.y));
    });
    const RoomLight light(proxy, probe, {0, 1.4, 0}, std::nullopt, coarse(), g_silent);
    const glm::dvec3 x(-0.6, 0.0, -0.9);
    const glm::dvec3 normal(0, 1, 0);
    const int count = 60000;
    double by_light = 0.0;
    double by_light_square = 0.0;
    double by_cosine = 0.0;
    double by_cosine_square = 0.0;
    for (int i = 0; i < count; ++i) {
        RandomStream random(7, 0, static_cast<std::uint64_t>(i));
        const double selector = random.uniformDouble();
        const auto drawn = light.sample(x, selector, random.uniform2());
        const double a = drawn ? drawn->radiance.g *
                                     std::max(0.0, glm::dot(drawn->direction, normal)) / drawn->pdf
                               : 0.0;
        const double b =
            light.incident(x, frameFromNormal(normal) * cosineHemisphere(random.uniform2()))
                .radiance.g *
            pi;
        by_light += a;
        by_light_square += a * a;
        by_cosine += b;
        by_cosine_square += b * b;
    }
    const auto varianceOfMean = [&](double sum, double square) {
        return (square / count - sum * sum / count / count) / count;
    };
    // Extended directions are drawn rarely but not never: both estimates are of the same integral.
    const double sigma = std::sqrt(varianceOfMean(by_light, by_light_square) +
                                   varianceOfMean(by_cosine, by_cosine_square));
    EXPECT_NEAR(by_light / count, by_cosine / count, tolerance::kStandardErrors * sigma);
    EXPECT_LT(sigma, 0.02 * by_cosine / count);
}

TEST(RoomLight, SurfacesNobodySawGatherLight)
{
    RoomDescription room = closedRoom();
    room.boxes.push_back({{-1, 0, -2}, {0, 1, -1}, true, "cupboard"});
    const SceneProxy proxy(room);
    const EnvironmentMap white = environmentOf(64, [](glm::dvec3) { return Rgb(1.0f); });
    const RoomLight light(proxy, white, {-0.5, 0.6, 1.0}, std::nullopt, coarse(), g_silent);
    EXPECT_TRUE(hasFinding(light.findings(), "light-unseen-surfaces"));
    // The cupboard's back looks at lit walls: it reflects some of it, never more than it gets.
    const Rgb back = light.incident({-0.5, 0.5, -2.9}, {0, 0, 1}).radiance;
    EXPECT_GT(back.g, 0.3f);
    EXPECT_LT(back.g, 1.0f);
}

TEST(RoomLight, PhotographStandsInForTheProbe)
{
    RoomDescription room = closedRoom();
    room.boxes.push_back({{-1, 0, -2}, {0, 1, -1}, true, "cupboard"});
    const SceneProxy proxy(room);
    const EnvironmentMap white = environmentOf(64, [](glm::dvec3) { return Rgb(1.0f); });
    // The probe stands before the cupboard, the camera beside it sees its +x side.
    const Camera camera = Camera::lookAt({1.8, 1.2, -1.6}, {0.0, 0.5, -1.5}, 300.0, 320, 240);
    const PhotographedRadiance photo{camera, Image<Rgb>(320, 240, Rgb(0.25f))};
    const RoomLight light(proxy, white, {-0.5, 0.6, 1.0}, photo, coarse(), g_silent);
    EXPECT_NEAR(light.incident({1.0, 0.5, -1.5}, {-1, 0, 0}).radiance.g, 0.25f, 1e-4f);
    EXPECT_EQ(light.probeRadiance(light.arrive({1.0, 0.5, -1.5}, {-1, 0, 0}).hit->face, {0.5, 0.5}),
              Rgb(0.0f));
}

// A blind of laths as a solid box before the window: the probe sees daylight through it, far
// brighter than laths could reflect, so light passes; a box that looks like a wall hides.
TEST(RoomLight, LightPassesThroughTheGapsThatTheProbeSaw)
{
    RoomDescription room = roomWithWindow();
    room.boxes.push_back({{1.2, 1.0, -0.9}, {1.3, 1.9, 0.9}, true, "blind"});
    const SceneProxy proxy(room);
    const glm::dvec3 center(0.0, 1.5, 0.0);
    const auto lightWith = [&](float through_blind) {
        const EnvironmentMap probe = environmentOf(128, [&](glm::dvec3 d) {
            const auto hit = proxy.intersect(center, d);
            const bool blind = hit && proxy.faces()[hit->face].solid;
            return Rgb(blind ? through_blind : 0.1f);
        });
        RoomLightOptions options = coarse();
        options.fit_unmeasured = false;
        return RoomLight(proxy, probe, center, std::nullopt, options, g_silent);
    };
    const glm::dvec3 x(-1.0, 1.5, 0.0);
    const RoomLight laths = lightWith(10.0f);
    EXPECT_TRUE(hasFinding(laths.findings(), "light-through-gaps"));
    const auto through = laths.intersect(x, {1, 0, 0});
    ASSERT_TRUE(through);
    EXPECT_TRUE(through->opening);
    EXPECT_NEAR(through->distance_m, 3.0, 1e-9);
    EXPECT_NEAR(laths.incident(x, {1, 0, 0}).radiance.g, 10.0f, 0.1f);

    const RoomLight board = lightWith(0.1f);
    EXPECT_FALSE(hasFinding(board.findings(), "light-through-gaps"));
    EXPECT_FALSE(board.intersect(x, {1, 0, 0})->opening);
}

// A plate under a bright ceiling that is not there, though the project says so: the floor below
// looks like the rest of the floor. Its irradiance is raised until its reflectance is the floor's.
TEST(RoomLight, ABoxThatExplainsNothingDoesNotDarken)
{
    RoomDescription room = closedRoom();
    room.boxes.push_back({{-0.8, 0.9, -2.0}, {0.8, 0.95, -0.4}, true, "plate"});
    const SceneProxy proxy(room);
    const glm::dvec3 center(0.0, 0.6, 1.0);
    const EnvironmentMap probe = environmentOf(128, [&](glm::dvec3 d) {
        const auto hit = proxy.intersect(center, d);
        return Rgb(hit && hit->point.y > 2.4 ? 10.0f : 0.5f);
    });
    const RoomLight light(proxy, probe, center, std::nullopt, coarse(), g_silent);
    const auto below = proxy.intersect({0.0, 0.5, -1.2}, {0, -1, 0});
    const auto beside = proxy.intersect({0.0, 0.5, 1.2}, {0, -1, 0});
    ASSERT_TRUE(below && beside && below->face == beside->face);

    const auto at = [&](const ProxyHit& hit) { return light.irradianceScale(hit.face, hit.uv).g; };
    EXPECT_GT(at(*below), 1.5f);
    EXPECT_NEAR(at(*beside), 1.0f, 0.15f);
    const auto reflectance = [&](const ProxyHit& hit) {
        return light.cellReflectance().lookUp(hit.face, hit.uv, Rgb(0.0f)).g;
    };
    // The upper bound leaves out what would bounce once more: most of the way, not all of it.
    EXPECT_LT(reflectance(*below) / reflectance(*beside), 1.3f);
}

/// A white room in which everything has radiance 1, and a sun through the window that the probe has
/// as radiance 20 at most: 50 times too little, as the patch on the floor shows when `patch`.
EnvironmentMap probeWithClippedSun(const SceneProxy& proxy, glm::dvec3 center, bool patch)
{
    constexpr double kSunRadiance = 20.0;
    constexpr double kTimes = 50.0;
    const glm::dvec3 to_sun = glm::normalize(glm::dvec3(1.5, 1.0, 0.2));
    const auto sun = [&](glm::dvec3 d) { return glm::dot(d, to_sun) > std::cos(0.03); };
    EnvironmentMap probe =
        environmentOf(256, [&](glm::dvec3 d) { return Rgb(sun(d) ? 20.0f : 1.0f); });
    probe.clipped = Image<float>(512, 256);
    double irradiance = 0.0;
    for (int y = 0; y < 256; ++y)
        for (int x = 0; x < 512; ++x) {
            const glm::dvec3 d = environmentDirectionFromUv({(x + 0.5) / 512, (y + 0.5) / 256});
            if (!sun(d)) continue;
            probe.clipped(x, y) = 1.0f;
            irradiance +=
                kTimes * kSunRadiance * to_sun.y * environmentTexelSolidAngle(512, 256, y);
        }
    for (int y = 0; patch && y < 256; ++y)
        for (int x = 0; x < 512; ++x) {
            const glm::dvec3 d = environmentDirectionFromUv({(x + 0.5) / 512, (y + 0.5) / 256});
            const auto floor = proxy.intersect(center, d);
            if (!floor || floor->normal.y < 0.5) continue;
            const auto above = proxy.intersect(floor->point, to_sun);
            if (above && above->opening)
                probe.pixels(x, y) = Rgb(1.0f + static_cast<float>(irradiance / pi));
        }
    return probe;
}

TEST(RoomLight, APatchOfSunTellsHowStrongAClippedSunIs)
{
    const SceneProxy proxy(roomWithWindow());
    // From here the sun is seen through the window.
    const glm::dvec3 center(0.2, 0.4, -0.2);
    const glm::dvec3 to_sun = glm::normalize(glm::dvec3(1.5, 1.0, 0.2));
    RoomLightOptions options = coarse();
    options.cell_m = 0.2;
    const RoomLight light(proxy,
                          probeWithClippedSun(proxy, center, /*patch=*/true),
                          center,
                          std::nullopt,
                          options,
                          g_silent);
    EXPECT_TRUE(hasFinding(light.findings(), "light-clipped-solved"));
    // The aim for a sun that the shortest exposures would have shown: within 10 %.
    EXPECT_NEAR(light.incident(center, to_sun).radiance.g, 1000.0f, 100.0f);
}

TEST(RoomLight, AClippedSunWithoutAPatchKeepsItsBound)
{
    RoomDescription room = roomWithWindow();
    const SceneProxy proxy(room);
    const glm::dvec3 center(0.2, 0.4, -0.2);
    const glm::dvec3 to_sun = glm::normalize(glm::dvec3(1.5, 1.0, 0.2));
    EnvironmentMap probe = probeWithClippedSun(proxy, center, /*patch=*/false);
    // Too few places to tell: the cells are as large as the floor's faces allow.
    RoomLightOptions options = coarse();
    options.cell_m = 1.5;
    const RoomLight light(proxy, probe, center, std::nullopt, options, g_silent);
    EXPECT_TRUE(hasFinding(light.findings(), "light-clipped-unsolved"));
    EXPECT_NEAR(light.incident(center, to_sun).radiance.g, 20.0f, 1.0f);
}

TEST(RoomLight, OptionsWithoutMeaningAreRefused)
{
    const SceneProxy proxy(closedRoom());
    const EnvironmentMap white = environmentOf(8, [](glm::dvec3) { return Rgb(1.0f); });
    RoomLightOptions options;
    options.texel_m = std::nan("");
    options.rays_per_cell = 0;
    EXPECT_EQ(options.validate().size(), 2u);
    EXPECT_THROW(RoomLight(proxy, white, {0, 1, 0}, std::nullopt, options, g_silent), InputError);
}

}  // namespace
}  // namespace insitu
