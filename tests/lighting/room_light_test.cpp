#include "lighting/room_light.h"

#include "core/random.h"
#include "lighting/sampling.h"
#include "tests/support/form_factor.h"
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
        EXPECT_NEAR(arrival.radiance.r, expected, 0.05f);
    }
    // A direction the probe did not see through the window takes the nearest one that it did.
    const glm::dvec3 steep = glm::normalize(glm::dvec3(0.5, 0.6, 0.0));
    const RoomLight::Arrival extended = light.arrive({1.6, 1.1, 0.0}, steep);
    ASSERT_TRUE(extended.hit && extended.hit->opening);
    EXPECT_NEAR(extended.radiance.r, 10.0f, 0.2f);
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
    probe.clipped = Image<Rgb>(512, 256);
    double irradiance = 0.0;
    for (int y = 0; y < 256; ++y)
        for (int x = 0; x < 512; ++x) {
            const glm::dvec3 d = environmentDirectionFromUv({(x + 0.5) / 512, (y + 0.5) / 256});
            if (!sun(d)) continue;
            probe.clipped(x, y) = probe.pixels(x, y);
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

/// A black room with a grey carpet below two lamps on the ceiling, one of them clipped, whose edges
/// lie within texels. All light on it is known in closed form.
struct LampRoom {
    static constexpr double kBound = 2.0;
    static constexpr double kLamp = 100.0;
    static constexpr double kPanel = 3.0;
    static constexpr double kHeight = 2.5;
    glm::dvec3 center{0.3, 1.2, -0.4};
    /// x and z of two corners.
    glm::dvec4 lamp{-0.53, -0.72, 0.08, -0.11};
    glm::dvec4 panel{0.6, -2.6, 1.8, 1.6};

    [[nodiscard]] static double onFloor(const glm::dvec4& r, glm::dvec3 x, double radiance)
    {
        return form_factor::polygonIrradiance(
            {{r.x, kHeight, r.y}, {r.z, kHeight, r.y}, {r.z, kHeight, r.w}, {r.x, kHeight, r.w}},
            x,
            {0, 1, 0},
            radiance);
    }
    [[nodiscard]] static bool in(const glm::dvec4& r, glm::dvec3 p)
    {
        return p.y > kHeight - 1e-6 && p.x > r.x && p.x < r.z && p.z > r.y && p.z < r.w;
    }
    /// Grey up to two decimetres before the walls, which would take some of it from its texels.
    [[nodiscard]] static bool carpet(glm::dvec3 p)
    {
        return std::abs(p.x) < 1.8 && p.z > -2.8 && p.z < 1.8;
    }
    [[nodiscard]] double lampOn(glm::dvec3 x) const { return onFloor(lamp, x, kLamp); }
    /// What the probe sees, the lamp as kBound; texels are averages.
    [[nodiscard]] EnvironmentMap probe(const SceneProxy& proxy) const
    {
        constexpr int kRows = 256;
        constexpr int kGrid = 4;
        EnvironmentMap map{Image<Rgb>(2 * kRows, kRows)};
        map.clipped = map.pixels;
        for (int y = 0; y < kRows * kGrid; ++y)
            for (int x = 0; x < 2 * kRows * kGrid; ++x) {
                const glm::dvec3 p =
                    proxy
                        .intersect(center,
                                   environmentDirectionFromUv({(x + 0.5) / (2.0 * kRows * kGrid),
                                                               (y + 0.5) / (kRows * kGrid)}))
                        ->point;
                double radiance = in(lamp, p) ? kBound : in(panel, p) ? kPanel : 0.0;
                if (p.y < 1e-6 && carpet(p))
                    radiance = 0.4 * (lampOn(p) + onFloor(panel, p, kPanel)) / pi;
                const Rgb part(static_cast<float>(radiance / (kGrid * kGrid)));
                map.pixels(x / kGrid, y / kGrid) += part;
                if (in(lamp, p)) map.clipped(x / kGrid, y / kGrid) += part;
            }
        return map;
    }
    /// Irradiance of the floor at x from the ceiling, by quadrature.
    [[nodiscard]] double ceilingOn(const RoomLight& light, glm::dvec3 x) const
    {
        constexpr double kStep = 0.01;
        double sum = 0.0;
        for (double px = -1.0; px < 0.5; px += kStep)
            for (double pz = -1.2; pz < 0.4; pz += kStep) {
                const glm::dvec3 way = glm::dvec3(px, kHeight, pz) - x;
                const double d2 = glm::dot(way, way);
                sum += light.incident(x, way / std::sqrt(d2)).radiance.g * way.y * way.y /
                       (d2 * d2) * kStep * kStep;
            }
        return sum;
    }
};

// Texels of 5 cm at the lamp's rim are covered in part: only that part is stronger than it looks.
// The light of one place is given, so that nothing depends on how well the carpet tells it.
TEST(RoomLight, AClippedLampIsSolvedWithItsRim)
{
    const LampRoom lamp;
    const RoomDescription room = closedRoom();
    const SceneProxy proxy(room);
    RoomLightOptions options = coarse();
    const glm::dvec3 at(0.4, 0.0, 0.3);
    const double all = lamp.lampOn(at) + LampRoom::onFloor(lamp.panel, at, LampRoom::kPanel);
    options.references = {
        {.name = "the given irradiance", .places = {{at, {0, 1, 0}, glm::dvec3(all), 0.01}}}};
    const RoomLight light(proxy, lamp.probe(proxy), lamp.center, std::nullopt, options, g_silent);
    EXPECT_TRUE(hasFinding(light.findings(), "light-clipped-solved"));
    for (const glm::dvec3& x : {glm::dvec3(0, 0, 0), glm::dvec3(-1.2, 0, -1.8)})
        EXPECT_NEAR(lamp.ceilingOn(light, x) / lamp.lampOn(x), 1.0, 0.015);
}

// The same lamp by its light on the carpet: 8 % too strong at 256 rays a cell, 5 % at 4096
// (docs/validation.md).
TEST(RoomLight, ACarpetTellsHowStrongAClippedLampIs)
{
    const LampRoom lamp;
    const RoomDescription room = closedRoom();
    const SceneProxy proxy(room);
    RoomLightOptions options = coarse();
    options.cell_m = 0.2;
    const RoomLight light(proxy, lamp.probe(proxy), lamp.center, std::nullopt, options, g_silent);
    EXPECT_TRUE(hasFinding(light.findings(), "light-clipped-solved"));
    EXPECT_NEAR(lamp.ceilingOn(light, {0, 0, 0}) / lamp.lampOn({0, 0, 0}), 1.0, 0.1);
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
