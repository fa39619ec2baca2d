#include "core/parallel.h"
#include "lighting/light_spots.h"
#include "lighting/place_light.h"
#include "render/renderer.h"
#include "tests/render/insertion_rooms.h"
#include "tests/support/shapes.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

/// A dim sky with one bright texel 45 degrees above the horizon, towards +x.
EnvironmentMap sunny()
{
    EnvironmentMap sky = uniform(0.1f);
    const glm::ivec2 at = environmentTexelAt(128, 64, glm::normalize(glm::dvec3(1.0, 1.0, 0.0)));
    sky.pixels(at.x, at.y) = Rgb(500.0f);
    return sky;
}

RoomDescription floorOnly()
{
    RoomDescription room;
    room.floors.push_back({});
    return room;
}

RoomLight lightOf(const SceneProxy& proxy, const EnvironmentMap& probe)
{
    return RoomLight(proxy, probe, {0, 1, 0}, std::nullopt, coarse(), g_silent);
}

struct Ball {
    glm::vec3 center{0.0f};
    float radius = 0.5f;
};
ObjectScene balls(const std::vector<Ball>& wanted, float albedo)
{
    std::vector<ObjectScene::Object> objects;
    for (const Ball& ball : wanted)
        objects.push_back({shapes::model(shapes::sphere(ball.center, ball.radius, 24),
                                         shapes::lambert(glm::vec3(albedo)))});
    return ObjectScene(std::move(objects));
}

/// Coarse enough for tests to be quick.
InsertionOptions fiv()
{
    InsertionOptions options = coarseFiv();
    options.fiv.receiver_node_spacing_m = 1.0;
    return options;
}

/// Looks down at the floor around the origin.
Camera above()
{
    return Camera::lookAt({0.3, 4.0, 0.3}, {0.31, 0.0, 0.2}, 30.0, 48, 48);
}

glm::dvec3 floorAt(const Camera& camera, int x, int y)
{
    const glm::dvec3 d = camera.rayDirection({x + 0.5, y + 0.5});
    return camera.position_m - d * (camera.position_m.y / d.y);
}

double ratioAt(const RenderLayers& layers, int x, int y)
{
    return static_cast<double>(layers.irradiance_with(x, y).g) /
           static_cast<double>(layers.irradiance_without(x, y).g);
}

/// Cells of 5.6 degrees and silhouettes of 48 texels: what these leave of a closed form.
constexpr double kTables = 0.02;

// Black balls of radius r under a uniform sky hide (r/d)² cos φ of the floor's irradiance each, as
// long as none is in front of another.
TEST(RenderFiv, BlackBallsOverTheFloorCastTheClosedFormShadow)
{
    const SceneProxy proxy(floorOnly());
    const RoomLight light = lightOf(proxy, uniform(1.0f));
    const Camera camera = above();
    InsertionOptions options = fiv();
    options.interreflection.enabled = false;
    for (const std::vector<Ball>& scene :
         {std::vector<Ball>{{{0, 1.0f, 0}, 0.5f}},
          std::vector<Ball>{{{-0.9f, 0.8f, 0}, 0.4f}, {{0.9f, 0.8f, 0}, 0.4f}},
          // Two in one place hide no more than one.
          std::vector<Ball>{{{0, 1.0f, 0}, 0.5f}, {{0, 1.0f, 0}, 0.5f}}}) {
        const ObjectScene objects = balls(scene, 0.0f);
        const RenderLayers layers =
            renderInsertion(camera, light, objects, options, g_silent).layers;
        const bool twice = scene.size() == 2 && scene[0].center == scene[1].center;
        int compared = 0;
        for (int y = 0; y < 48; y += 3)
            for (int x = 0; x < 48; x += 3) {
                if (layers.alpha(x, y) > 0.0f) continue;
                const glm::dvec3 p = floorAt(camera, x, y);
                double hidden = 0.0;
                bool apart = true;
                for (std::size_t i = 0; i < (twice ? 1 : scene.size()); ++i) {
                    const glm::dvec3 way = glm::dvec3(scene[i].center) - p;
                    const double d2 = glm::dot(way, way);
                    const double r2 = scene[i].radius * scene[i].radius;
                    hidden += r2 / d2 * way.y / std::sqrt(d2);
                    // Between and beside two balls: seen from farther out one hides the other.
                    apart = apart && (scene.size() == 1 || twice || std::abs(p.x) < 0.9);
                }
                if (!apart) continue;
                ++compared;
                EXPECT_NEAR(ratioAt(layers, x, y), 1.0 - hidden, kTables) << p.x << ' ' << p.z;
            }
        EXPECT_GT(compared, 20);
    }
}

TEST(RenderFiv, WhiteBallInAWhiteFurnaceChangesLittle)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light = lightOf(proxy, uniform(1.0f));
    const ObjectScene ball = balls({{{0, 0.6f, 0}, 0.4f}}, 1.0f);
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.4, 0}, 50.0, 48, 36);
    const RenderLayers layers = renderInsertion(camera, light, ball, fiv(), g_silent).layers;
    for (int y = 0; y < 36; ++y)
        for (int x = 0; x < 48; ++x) {
            // Two rounds of light among objects and one of the room, not all of them.
            if (layers.alpha(x, y) == 1.0f) {
                EXPECT_NEAR(layers.object(x, y).g, 1.0, 0.05) << x << ' ' << y;
            } else if (layers.alpha(x, y) == 0.0f) {
                EXPECT_NEAR(ratioAt(layers, x, y), 1.0, 0.03) << x << ' ' << y;
            }
        }
}

// The sun is lost where the ball is in the way, and its shadow lies where geometry says.
TEST(RenderFiv, AConcentratedLightCastsItsOwnShadow)
{
    const SceneProxy proxy(floorOnly());
    const RoomLight light = lightOf(proxy, sunny());
    const LightSpots spots(light, {0, 1, 0}, {});
    ASSERT_FALSE(spots.spots().empty());
    for (const LightSpot& spot : spots.spots())
        EXPECT_GT(glm::dot(spot.at, glm::normalize(glm::dvec3(1.0, 1.0, 0.0))), 0.99);

    const ObjectScene ball = balls({{{0, 1.0f, 0}, 0.3f}}, 0.0f);
    InsertionOptions options = fiv();
    options.interreflection.enabled = false;
    const Camera camera = Camera::lookAt({-1.2, 4.0, 0.3}, {-1.19, 0.0, 0.2}, 40.0, 48, 48);
    const RenderLayers layers = renderInsertion(camera, light, ball, options, g_silent).layers;
    int dark = 0;
    for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 48; ++x) {
            if (layers.alpha(x, y) > 0.0f) continue;
            const glm::dvec3 p = floorAt(camera, x, y);
            // Distance of the ball's centre from the ray towards the sun.
            const glm::dvec3 sun = glm::normalize(glm::dvec3(1.0, 1.0, 0.0));
            const double off = glm::length(glm::cross(glm::dvec3(0, 1, 0) - p, sun));
            const double ratio = ratioAt(layers, x, y);
            if (off < 0.2) {
                EXPECT_LT(ratio, 0.6) << p.x << ' ' << p.z;
                ++dark;
            } else if (off > 0.42) {
                EXPECT_GT(ratio, 0.9) << p.x << ' ' << p.z;
            }
        }
    EXPECT_GT(dark, 5);
}

TEST(RenderFiv, AgreesWithTheReferenceInARoom)
{
    const SceneProxy proxy(closedRoom());
    EnvironmentMap probe = uniform(0.3f);
    // A bright wall towards +x.
    for (int y = 24; y < 40; ++y)
        for (int x = 90; x < 104; ++x)
            probe.pixels(x, y) = Rgb(6.0f, 5.0f, 4.0f);
    const RoomLight light = lightOf(proxy, probe);
    const ObjectScene scene = balls({{{0, 0.4f, 0}, 0.4f}, {{0.3f, 0.2f, 0.7f}, 0.2f}}, 0.5f);
    const Camera camera = Camera::lookAt({-1.2, 1.6, 1.6}, {0, 0.3, 0}, 26.0, 28, 20);
    InsertionOptions reference;
    reference.max_samples = reference.min_samples = 128;
    reference.interreflection.samples_per_cell = 32;
    const RenderLayers truth = renderInsertion(camera, light, scene, reference, g_silent).layers;
    const InsertionResult quick = renderInsertion(camera, light, scene, fiv(), g_silent);
    EXPECT_EQ(quick.technique, Technique::Fiv);
    EXPECT_GT(quick.table_bytes, 0u);
    double ratio_square = 0.0;
    double object_square = 0.0;
    double object_level = 0.0;
    int receivers = 0;
    for (int y = 0; y < 20; ++y)
        for (int x = 0; x < 28; ++x) {
            // 4 rays a pixel, 16 where these differ, against 128.
            EXPECT_NEAR(quick.layers.alpha(x, y), truth.alpha(x, y), 0.25);
            if (truth.alpha(x, y) == 0.0f) {
                ratio_square += std::pow(ratioAt(quick.layers, x, y) - ratioAt(truth, x, y), 2);
                ++receivers;
            } else if (truth.alpha(x, y) == 1.0f) {
                object_square += std::pow(quick.layers.object(x, y).g - truth.object(x, y).g, 2);
                object_level += std::pow(truth.object(x, y).g, 2);
                EXPECT_NEAR(quick.layers.depth_m(x, y), truth.depth_m(x, y), 0.05);
            }
        }
    // The reference's own noise is 1 to 2 %.
    EXPECT_LT(std::sqrt(ratio_square / receivers), 0.025);
    EXPECT_LT(std::sqrt(object_square / object_level), 0.06);
}

TEST(RenderAuto, TakesTheQuickPictureIfAndOnlyIfItKeepsTheBound)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light = lightOf(proxy, uniform(1.0f));
    const ObjectScene ball = balls({{{0, 0.4f, 0}, 0.4f}}, 0.5f);
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.3, 0}, 24.0, 32, 24);
    InsertionOptions options = fiv();
    options.technique = Technique::Auto;
    options.max_samples = options.min_samples = 4;
    options.interreflection.samples_per_cell = 8;
    options.target_error = 0.1;
    const InsertionResult loose = renderInsertion(camera, light, ball, options, g_silent);
    EXPECT_EQ(loose.technique, Technique::Fiv);
    EXPECT_TRUE(hasFinding(loose.findings, "technique-chosen"));
    EXPECT_EQ(loose.fiv_error.pixels, 256);
    EXPECT_LE(loose.fiv_error.rms, loose.fiv_error.upper);
    EXPECT_LE(loose.fiv_error.upper, 0.1);
    options.target_error = 1e-4;
    const InsertionResult strict = renderInsertion(camera, light, ball, options, g_silent);
    EXPECT_EQ(strict.technique, Technique::Reference);
    EXPECT_GT(strict.fiv_error.upper, 1e-4);
    // Without shadows the estimate sees what is missing.
    options.technique = Technique::Auto;
    options.target_error = 10.0;
    options.fiv.light = FivLight::Cube;
    const InsertionResult cube = renderInsertion(camera, light, ball, options, g_silent);
    EXPECT_GT(cube.fiv_error.rms, 1.2 * loose.fiv_error.rms);
}

TEST(RenderFiv, SameBytesForOneAndManyThreads)
{
    const SceneProxy proxy(closedRoom());
    const ObjectScene ball = balls({{{0, 0.4f, 0}, 0.4f}}, 0.5f);
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.5, 0}, 30.0, 32, 24);
    const RoomLight light = lightOf(proxy, sunny());
    const auto render = [&](int threads) {
        setThreadCount(threads);
        return renderInsertion(camera, light, ball, fiv(), g_silent).layers;
    };
    const RenderLayers one = render(1);
    const RenderLayers many = render(4);
    setThreadCount(0);
    EXPECT_EQ(one.object, many.object);
    EXPECT_EQ(one.alpha, many.alpha);
    EXPECT_EQ(one.irradiance_with, many.irradiance_with);
    EXPECT_EQ(one.irradiance_without, many.irradiance_without);
    EXPECT_EQ(one.depth_m, many.depth_m);
}

TEST(RenderFiv, WhatIsFarFromTheObjectsStaysAsItIs)
{
    const SceneProxy proxy(floorOnly());
    const RoomLight light = lightOf(proxy, uniform(1.0f));
    const ObjectScene ball = balls({{{-8.0f, 0.01f, -8.0f}, 0.01f}}, 0.5f);
    const RenderLayers layers = renderInsertion(above(), light, ball, fiv(), g_silent).layers;
    EXPECT_EQ(layers.irradiance_with, layers.irradiance_without);
    EXPECT_GT(layers.irradiance_without(24, 24).g, 3.0f);
}

// A partition of the room stands between the ball and the half that the camera sees.
TEST(RenderFiv, FurnitureHidesObjectsFromReceivers)
{
    RoomDescription room = closedRoom();
    room.boxes.push_back({{-0.9, 0.0, -3.0}, {-0.8, 2.5, 2.0}, true, ""});
    const SceneProxy proxy(room);
    const RoomLight light = lightOf(proxy, uniform(1.0f));
    const ObjectScene ball = balls({{{0.4f, 0.5f, 0.0f}, 0.5f}}, 0.1f);
    const Camera camera = Camera::lookAt({-1.0, 1.0, 0.0}, {-2.0, 0.8, 0.0}, 70.0, 24, 18);
    InsertionOptions options = fiv();
    // The room's cells are coarser than the partition is thick.
    options.interreflection.enabled = false;
    const RenderLayers layers = renderInsertion(camera, light, ball, options, g_silent).layers;
    EXPECT_EQ(layers.irradiance_with, layers.irradiance_without);
    EXPECT_GT(layers.irradiance_without(12, 9).g, 0.1f);
}

TEST(RenderFiv, AnEmptySceneChangesNothing)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light = lightOf(proxy, uniform(1.0f));
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.5, 0}, 60.0, 16, 12);
    const RenderLayers layers =
        renderInsertion(camera, light, ObjectScene({}), fiv(), g_silent).layers;
    EXPECT_EQ(layers.irradiance_with, layers.irradiance_without);
    EXPECT_EQ(layers.alpha, Image<float>(16, 12));
    // A white furnace: π times the radiance.
    EXPECT_NEAR(layers.irradiance_without(8, 6).g, pi, 0.05 * pi);
}

TEST(RenderFiv, ABlackEnvironmentGivesBlackLayers)
{
    const SceneProxy proxy(floorOnly());
    const RoomLight light = lightOf(proxy, uniform(0.0f));
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.3, 0}, 24.0, 16, 12);
    const RenderLayers layers =
        renderInsertion(camera, light, balls({{{0, 0.4f, 0}, 0.4f}}, 0.5f), fiv(), g_silent).layers;
    const Image<Rgb> black(16, 12);
    EXPECT_EQ(layers.object, black);
    EXPECT_EQ(layers.irradiance_with, black);
    EXPECT_EQ(layers.irradiance_without, black);
    EXPECT_EQ(layers.alpha(8, 6), 1.0f);
}

TEST(RenderFiv, ValidateNamesEveryMistake)
{
    InsertionOptions options = fiv();
    EXPECT_TRUE(options.validate().empty());
    options.fiv.object_face_size = 0;
    options.fiv.receiver_node_spacing_m = 0.0;
    options.fiv.object_node_spacing_m = -1.0;
    options.fiv.interpolation_tolerance = -1.0;
    options.fiv.object_samples = 0;
    options.fiv.atlas.resolution = 1;
    EXPECT_EQ(options.validate().size(), 6u);
}

TEST(PlaceLight, SeesTheFurnaceAndItsChange)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light = lightOf(proxy, uniform(2.0f));
    const auto geometry = std::make_shared<CellGeometry>(DirectionCells{16});
    PlaceLight seen = lookAround(light, {}, {0.2, 1.0, 0.1}, geometry);
    FaceGrid<Rgb> change = light.cellIrradiance();
    for (std::size_t i = 0; i < change.size(); ++i)
        change[i] = Rgb(-0.5f);
    seen.setChange(change);
    const auto [without, changed] = seen.irradiance({0.6f, 0.8f, 0.0f});
    // The midpoint rule on cells of 5.6 degrees.
    EXPECT_NEAR(without.g, 2.0 * pi, 0.005 * pi);
    EXPECT_NEAR(changed.g, -0.5 * pi, 0.005 * pi);
    EXPECT_EQ(seen.inside_share, 0.0);
}

TEST(LightSpots, ALampKeepsItsPlaceAndAnEvenRoomHasNone)
{
    const SceneProxy proxy(closedRoom());
    EXPECT_TRUE(LightSpots(lightOf(proxy, uniform(1.0f)), {0, 0.5, 0}, {}).spots().empty());

    // A texel of the probe straight ahead at the wall z = −3.
    EnvironmentMap probe = uniform(0.01f);
    for (int y = 31; y <= 32; ++y)
        for (int x = 63; x <= 64; ++x)
            probe.pixels(x, y) = Rgb(1000.0f);
    const RoomLight light = lightOf(proxy, probe);
    const LightSpots lamps(light, {0, 0.5, 0}, {});
    ASSERT_FALSE(lamps.spots().empty());
    glm::dvec3 power(0.0);
    for (const LightSpot& spot : lamps.spots()) {
        EXPECT_FALSE(spot.far);
        EXPECT_NEAR(spot.at.z, -3.0, 1e-9);
        EXPECT_NEAR(spot.at.x, 0.0, 0.4);
        EXPECT_NEAR(spot.at.y, 1.0, 0.4);
        power += spot.power;
    }
    // From twice as near, straight ahead, four times the irradiance.
    const auto near = reach(light, lamps.spots().front(), {0, 1, -2.0});
    const auto far = reach(light, lamps.spots().front(), {0, 1, -1.0});
    ASSERT_TRUE(near && far);
    EXPECT_NEAR(near->irradiance.g / far->irradiance.g, 4.0, 0.9);
    // Nothing passes a solid box.
    RoomDescription blocked = closedRoom();
    blocked.boxes.push_back({{-1, 0, -2.5}, {1, 2, -2.4}, true, "screen"});
    const SceneProxy with_screen(blocked);
    const RoomLight behind = lightOf(with_screen, probe);
    EXPECT_FALSE(reach(behind, lamps.spots().front(), {0, 1, 0}));
}

}  // namespace
}  // namespace insitu
