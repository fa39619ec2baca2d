#include "pipeline/photo_balance.h"

#include "composite/differential.h"
#include "core/io/image_io.h"
#include "core/random.h"
#include "pipeline/camera_simulator.h"
#include "pipeline/insert.h"
#include "pipeline/simulated_room.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

namespace insitu {
namespace {

const glm::dvec3 kCenter(0.3, 1.0, -0.4);

RoomDescription closedRoom()
{
    RoomDescription room;
    room.boxes.push_back({{-2, 0, -3}, {2, 2.5, 2}, false, ""});
    return room;
}

/// What a place of the room's surfaces shines, whoever looks at it.
Rgb radianceAt(glm::dvec3 p)
{
    return Rgb(0.3 + 0.1 * std::sin(1.7 * p.x), 0.35 + 0.1 * std::sin(1.3 * p.y), 0.3 + 0.05 * p.z);
}

EnvironmentMap probeOf(const SceneProxy& proxy)
{
    EnvironmentMap map{Image<Rgb>(512, 256)};
    for (int y = 0; y < 256; ++y)
        for (int x = 0; x < 512; ++x)
            map.pixels(x, y) = radianceAt(
                proxy
                    .intersect(kCenter,
                               environmentDirectionFromUv({(x + 0.5) / 512.0, (y + 0.5) / 256.0}))
                    ->point);
    return map;
}

Camera camera()
{
    return Camera::lookAt({1.5, 1.4, 1.6}, {-0.5, 0.8, -2.0}, 250.0, 320, 240);
}

/// The same room with gains of the photograph, and 3 % of noise.
Image<Rgb> photoOf(const SceneProxy& proxy, const std::function<glm::dvec3(glm::dvec3 p)>& gains)
{
    const Camera view = camera();
    Image<Rgb> photo(view.width, view.height);
    for (int y = 0; y < view.height; ++y)
        for (int x = 0; x < view.width; ++x) {
            RandomStream random(3, static_cast<std::uint64_t>(y), static_cast<std::uint64_t>(x));
            const glm::dvec3 p =
                proxy.intersect(view.position_m, view.rayDirection({x + 0.5, y + 0.5}))->point;
            photo(x, y) = radianceAt(p) * Rgb(gains(p) * (1.0 + 0.03 * random.normal()));
        }
    return photo;
}

struct Scene {
    RoomDescription room = closedRoom();
    SceneProxy proxy{room};
    EnvironmentMap probe = probeOf(proxy);

    [[nodiscard]] PhotoBalance measure(const std::function<glm::dvec3(glm::dvec3 p)>& gains) const
    {
        return measurePhotoBalance(
            photoOf(proxy, gains), glm::dvec3(2.0), camera(), proxy, probe, kCenter);
    }
};

PhotoBalance chosen(PhotoBalance balance, ProjectWhiteBalance wanted, bool unit_known = true)
{
    choosePhotoBalance(wanted, unit_known, balance);
    return balance;
}

using Mode = ProjectWhiteBalance::Mode;

TEST(PhotoBalance, GainsAreRecovered)
{
    const Scene scene;
    const glm::dvec3 gains(1.3, 0.9, 0.7);
    const PhotoBalance measured = scene.measure([&](glm::dvec3) { return gains; });
    ASSERT_GT(measured.pixels, 10000u);
    for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(measured.measured[c], gains[c], 0.005 * gains[c]);  // the aim is 2 %
        EXPECT_NEAR(measured.spread[c], 0.6745 * 0.03, 0.005);
    }
    // Colour that is off shows that EXIF does not tell how much light each channel got.
    const PhotoBalance by_color = chosen(measured, {});
    EXPECT_TRUE(hasFinding(by_color.findings, "photo-white-balance-solved"));
    const PhotoBalance all = chosen(measured, {Mode::Solved, {}});
    const PhotoBalance none = chosen(measured, {Mode::None, {}});
    const PhotoBalance given = chosen(measured, {Mode::Given, {2.0, 3.0, 4.0}});
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(all.used[c], gains[c], 0.005 * gains[c]);
    EXPECT_EQ(by_color.used, all.used);
    EXPECT_EQ(none.used, glm::dvec3(1.0));
    EXPECT_EQ(given.used, glm::dvec3(2.0, 3.0, 4.0));
}

TEST(PhotoBalance, AnEqualBalanceIsLeftAlone)
{
    const Scene scene;
    const PhotoBalance measured = scene.measure([](glm::dvec3) { return glm::dvec3(1.0); });
    const PhotoBalance balance = chosen(measured, {});
    EXPECT_EQ(balance.used, glm::dvec3(1.0));
    EXPECT_TRUE(balance.findings.empty());
}

TEST(PhotoBalance, ExposureIsToldOrTakenWhereUnknown)
{
    const Scene scene;
    const PhotoBalance measured = scene.measure([](glm::dvec3) { return glm::dvec3(1.5); });
    const PhotoBalance known = chosen(measured, {});
    EXPECT_TRUE(hasFinding(known.findings, "light-photo-mismatch"));
    EXPECT_EQ(known.used, glm::dvec3(1.0));
    const PhotoBalance unknown = chosen(measured, {}, /*unit_known=*/false);
    EXPECT_TRUE(hasFinding(unknown.findings, "light-scale-from-photograph"));
    EXPECT_NEAR(unknown.used.g, 1.5, 0.01);
}

// The floor is redder and the walls are bluer: no white balance does that.
TEST(PhotoBalance, SurfacesThatDisagreeChangeNothing)
{
    const Scene scene;
    const PhotoBalance measured = scene.measure([](glm::dvec3 p) {
        return p.y < 1e-6 ? glm::dvec3(1.3, 1.0, 0.8) : glm::dvec3(0.85, 1.0, 1.1);
    });
    const PhotoBalance balance = chosen(measured, {});
    EXPECT_TRUE(hasFinding(balance.findings, "photo-white-balance-doubtful"));
    EXPECT_EQ(balance.used, glm::dvec3(1.0));
}

TEST(PhotoBalance, ABlackChannelIsNotSolved)
{
    const Scene scene;
    const PhotoBalance measured = scene.measure([](glm::dvec3) { return glm::dvec3(1, 1, 0); });
    EXPECT_EQ(chosen(measured, {}).used.b, 1.0);
}

TEST(PhotoBalance, NothingInCommonIsTold)
{
    const Scene scene;
    const PhotoBalance measured = measurePhotoBalance(Image<Rgb>(320, 240, Rgb(5.0f)),  // clipped
                                                      glm::dvec3(2.0),
                                                      camera(),
                                                      scene.proxy,
                                                      scene.probe,
                                                      kCenter);
    EXPECT_EQ(measured.pixels, 0u);
    EXPECT_TRUE(chosen(measured, {}).findings.empty());
    EXPECT_TRUE(
        hasFinding(chosen(measured, {Mode::Solved, {}}).findings, "photo-white-balance-doubtful"));
}

TEST(ScaleLight, IntoThePhotographsBalance)
{
    RenderLayers layers;
    layers.object = layers.irradiance_with = layers.irradiance_without = layers.probe_radiance =
        Image<Rgb>(2, 1, Rgb(1.0f));
    layers.object_variance = Image<float>(2, 1, 1.0f);
    scaleLight(layers, {2.0, 1.0, 0.5});
    for (const auto* image : {&layers.object,
                              &layers.irradiance_with,
                              &layers.irradiance_without,
                              &layers.probe_radiance})
        EXPECT_EQ((*image)(1, 0), Rgb(2.0f, 1.0f, 0.5f));
    // 0.2126 · 2 + 0.7152 + 0.0722 · 0.5, squared.
    EXPECT_NEAR(layers.object_variance(0, 0), 1.1765 * 1.1765, 1e-3);
}

// The simulated room's photograph, tinted in front of the sensor: codes to exposures by the
// camera's true curve, times gains, and back to 8 bit.
TEST(PhotoBalance, ATintedPhotographOfTheSimulatedRoom)
{
    const std::filesystem::path sample =
        std::filesystem::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";
    const Project project = readProject(sample / "project.json");
    const Photo photo = readPhoto(project.photo.path);
    const Camera view = solveCamera(project, photo, true).camera;
    const SceneProxy proxy(project.room);
    const CapturedLight light = captureLight(project, proxy, view, {});
    ASSERT_TRUE(light.response_known);
    const double exposure = *photo.metadata.exposure.relative();
    const ToneCurve curve = readSimulatedRoom(sample / "room.json").body.response;
    const auto measured = [&](glm::dvec3 gains) {
        EncodedImage tinted = photo.image;
        for (glm::u16vec3& code : tinted.codes.pixels())
            for (int c = 0; c < 3; ++c)
                code[c] = static_cast<std::uint16_t>(std::lround(
                    255.0 *
                    encodeTone(curve, c, gains[c] * decodeTone(curve, c, code[c] / 255.0))));
        glm::dvec3 clip;
        for (int c = 0; c < 3; ++c)
            clip[c] =
                gains[c] * light.response.exposure[static_cast<std::size_t>(c)][255] / exposure;
        return measurePhotoBalance(photographedRadiance(tinted, light.response, exposure),
                                   clip,
                                   view,
                                   proxy,
                                   light.environment,
                                   light.center_m);
    };
    EXPECT_EQ(chosen(measured(glm::dvec3(1.0)), {}).used, glm::dvec3(1.0));
    const glm::dvec3 gains(0.95, 0.8, 0.6);
    const PhotoBalance balance = chosen(measured(gains), {});
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(balance.used[c] / gains[c], 1.0, 0.02) << c;  // the aim
}

}  // namespace
}  // namespace insitu
