#include "core/parallel.h"
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

ObjectScene sphereScene(glm::vec3 center, float radius, float albedo)
{
    std::vector<ObjectScene::Object> objects;
    objects.push_back(
        {shapes::model(shapes::sphere(center, radius, 48), shapes::lambert(glm::vec3(albedo)))});
    return ObjectScene(std::move(objects));
}

InterreflectionOptions noRounds()
{
    InterreflectionOptions options;
    options.rounds = 0;
    return options;
}

/// Mean and standard error of with/without at a floor point.
struct RatioEstimate {
    double ratio = 0.0;
    double sigma = 0.0;
};
RatioEstimate floorRatio(const RoomWithObjects& scene, glm::dvec3 x, int count)
{
    double without = 0.0;
    double change = 0.0;
    double change_square = 0.0;
    for (int i = 0; i < count; ++i) {
        RandomStream random(11, 3, static_cast<std::uint64_t>(i));
        const ReceiverSample s = scene.sampleReceiver(x, {0, 1, 0}, PathOptions{}, random);
        without += s.without.g;
        change += s.with.g - s.without.g;
        change_square += (s.with.g - s.without.g) * (s.with.g - s.without.g);
    }
    const double mean = change / count;
    return {1.0 + change / without,
            std::sqrt((change_square / count - mean * mean) / count) / (without / count)};
}

// A black ball of radius r whose centre is h above a floor point, under a uniform sky, hides
// sin²θ = (r/h)² of its irradiance: the form factor of a sphere that does not cut the horizon.
TEST(RoomWithObjects, BlackBallOverTheFloorCastsTheClosedFormShadow)
{
    RoomDescription room;
    room.floors.push_back({});
    const SceneProxy proxy(room);
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const ObjectScene ball = sphereScene({0, 1.0f, 0}, 0.5f, 0.0f);
    const RoomWithObjects scene(light, ball, noRounds(), g_silent);
    for (const double aside : {0.0, 0.4, 1.5}) {
        // A ball seen at angle φ from the normal: (r/d)² cos φ.
        const double d2 = 1.0 + aside * aside;
        const double expected = 1.0 - 0.25 / d2 / std::sqrt(d2);
        const RatioEstimate estimate = floorRatio(scene, {aside, 0.0, 0.0}, 40000);
        // 48 rows of triangles inscribed in the ball are smaller by 0.2 % in area.
        EXPECT_NEAR(estimate.ratio,
                    expected,
                    tolerance::kStandardErrors * estimate.sigma + 0.002 * (1.0 - expected))
            << aside;
        EXPECT_LT(estimate.sigma, 0.004) << aside;
    }
}

TEST(RoomWithObjects, WhiteBallInAWhiteFurnaceChangesNothing)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const ObjectScene ball = sphereScene({0, 0.5f, 0}, 0.5f, 1.0f);
    const RoomWithObjects scene(light, ball, noRounds(), g_silent);
    for (const double aside : {0.1, 0.8}) {
        const RatioEstimate estimate = floorRatio(scene, {aside, 0.0, 0.0}, 4000);
        EXPECT_NEAR(estimate.ratio, 1.0, tolerance::kStandardErrors * estimate.sigma + 0.002)
            << aside;
    }
}

TEST(RoomWithObjects, InterreflectionDarkensTheRoomAroundABlackBall)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const ObjectScene ball = sphereScene({0, 1.0f, 0}, 0.5f, 0.0f);
    const RoomWithObjects scene(light, ball, InterreflectionOptions{}, g_silent);
    const Rgb below =
        scene.incident({1.5, 2.0, 1.0}, glm::normalize(glm::dvec3(-1.5, -2.0, -0.8))).radiance;
    EXPECT_LT(below.g, 0.98f);
    EXPECT_GT(below.g, 0.4f);
}

TEST(RenderInsertion, SameBytesForOneAndManyThreads)
{
    const SceneProxy proxy(closedRoom());
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.5, 0}, 60.0, 64, 48);
    const ObjectScene ball = sphereScene({0, 0.4f, 0}, 0.4f, 0.5f);
    InsertionOptions options;
    options.max_samples = 24;
    options.min_samples = 8;
    options.interreflection.samples_per_cell = 16;
    const auto render = [&](int threads) {
        setThreadCount(threads);
        const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
        return renderInsertion(camera, light, ball, options, g_silent).layers;
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

TEST(RenderInsertion, ASolidBoxInFrontHidesTheObject)
{
    RoomDescription room = closedRoom();
    room.boxes.push_back({{-1, 0, 0.6}, {1, 2, 0.8}, true, "screen"});
    const SceneProxy proxy(room);
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 1.5}, std::nullopt, coarse(), g_silent);
    const ObjectScene ball = sphereScene({0, 0.4f, 0}, 0.4f, 0.5f);
    const Camera camera = Camera::lookAt({0, 0.5, 1.9}, {0, 0.4, 0}, 60.0, 32, 24);
    InsertionOptions options;
    options.max_samples = options.min_samples = 4;
    options.interreflection = noRounds();
    const InsertionResult result = renderInsertion(camera, light, ball, options, g_silent);
    for (const float alpha : result.layers.alpha.pixels())
        EXPECT_EQ(alpha, 0.0f);
}

TEST(RenderInsertion, StandardErrorIsTheScatterOverSeeds)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const ObjectScene ball = sphereScene({0, 0.45f, 0}, 0.4f, 0.1f);
    const Camera camera = Camera::lookAt({0.9, 1.6, 1.6}, {0.5, 0, 0.2}, 120.0, 16, 12);
    InsertionOptions options;
    options.max_samples = options.min_samples = 64;
    options.target_error = 0.0;
    options.interreflection = noRounds();
    options.filter.levels = 0;
    double scatter = 0.0;
    double stated = 0.0;
    std::vector<RenderLayers> runs;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        options.seed = seed;
        runs.push_back(renderInsertion(camera, light, ball, options, g_silent).layers);
    }
    const auto ratioOf = [](const RenderLayers& layers, std::size_t i) {
        return layers.irradiance_with.pixels()[i].g / layers.irradiance_without.pixels()[i].g;
    };
    for (std::size_t i = 0; i < runs[0].alpha.pixelCount(); ++i) {
        if (runs[0].alpha.pixels()[i] > 0.0f) continue;
        double mean = 0.0;
        for (const RenderLayers& run : runs)
            mean += ratioOf(run, i) / double(runs.size());
        for (const RenderLayers& run : runs) {
            const double off = ratioOf(run, i) - mean;
            scatter += off * off / double(runs.size() - 1);
            stated += run.ratio_variance.pixels()[i] / double(runs.size());
        }
    }
    // The stated variance leaves out that of the denominator, which is common to both.
    EXPECT_GT(stated, 0.6 * scatter);
    EXPECT_LT(stated, 1.6 * scatter);
}

TEST(InsertionOptions, ValidateNamesEveryMistake)
{
    InsertionOptions options;
    EXPECT_TRUE(options.validate().empty());
    options.max_samples = 0;
    options.target_error = -1.0;
    EXPECT_GE(options.validate().size(), 2u);
}

}  // namespace
}  // namespace insitu
