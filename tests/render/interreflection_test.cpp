#include "render/renderer.h"
#include "tests/render/insertion_rooms.h"
#include "tests/support/shapes.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

InsertionOptions optionsOf(Technique technique)
{
    InsertionOptions options = coarseFiv();
    options.technique = technique;
    options.fiv.receiver_node_spacing_m = 1.0;
    options.max_samples = options.min_samples = 96;
    options.target_error = 0.0;
    options.interreflection.samples_per_cell = 32;
    return options;
}

/// Ball of 0.3 m that touches nothing.
ObjectScene ball(float albedo, float emission)
{
    Material material = shapes::lambert(glm::vec3(albedo));
    material.emissive = glm::vec3(emission);
    return ObjectScene({{shapes::model(shapes::sphere({0, 0.6f, 0}, 0.3f, 32), material), {}}});
}

class EachTechnique : public testing::TestWithParam<Technique> {};

// A black ball of radiance L puts π L (r/d)² cos φ onto the floor, and hides (r/d)² cos φ of the
// even light there: what objects emit is no inter-reflection.
TEST_P(EachTechnique, ALampStillLightsTheFloor)
{
    constexpr double kEmission = 4.0;
    RoomDescription room;
    room.floors.push_back({});
    const SceneProxy proxy(room);
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const Camera camera = Camera::lookAt({0.4, 3.0, 0.4}, {0.41, 0.0, 0.3}, 20.0, 24, 24);
    InsertionOptions options = optionsOf(GetParam());
    options.interreflection.enabled = false;
    const RenderLayers layers =
        renderInsertion(camera, light, ball(0.0f, kEmission), options, g_silent).layers;
    int compared = 0;
    for (int y = 1; y < 24; y += 2)
        for (int x = 1; x < 24; x += 2) {
            if (layers.alpha(x, y) > 0.0f) continue;
            const glm::dvec3 d = camera.rayDirection({x + 0.5, y + 0.5});
            const glm::dvec3 p = camera.position_m - d * (camera.position_m.y / d.y);
            const glm::dvec3 way = glm::dvec3(0.0, 0.6, 0.0) - p;
            const double form = 0.09 / glm::dot(way, way) * way.y / glm::length(way);
            const double expected = 1.0 + (kEmission - 1.0) * form;
            const double received =
                layers.irradiance_with(x, y).g / layers.irradiance_without(x, y).g;
            // Coarse silhouettes, or 96 paths.
            EXPECT_NEAR(received, expected, 0.06 * expected) << p.x << ' ' << p.z;
            ++compared;
        }
    EXPECT_GT(compared, 100);
}

// A white ball lights the room no more than a black one does, and what that costs is told.
TEST_P(EachTechnique, ObjectsAreBlackToAllButTheCamera)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const Camera camera = Camera::lookAt({1.2, 1.4, 1.6}, {0, 0.3, 0}, 24.0, 32, 24);
    InsertionOptions options = optionsOf(GetParam());
    const auto meanRatio = [](const RenderLayers& layers) {
        double with = 0.0;
        double without = 0.0;
        for (std::size_t i = 0; i < layers.alpha.pixelCount(); ++i) {
            if (layers.alpha.pixels()[i] > 0.0f) continue;
            with += layers.irradiance_with.pixels()[i].g;
            without += layers.irradiance_without.pixels()[i].g;
        }
        return with / without;
    };
    const InsertionResult full = renderInsertion(camera, light, ball(0.9f, 0), options, g_silent);
    EXPECT_EQ(full.no_interreflection_error.pixels, 0);
    EXPECT_FALSE(hasFinding(full.findings, "no-interreflection"));
    options.interreflection.enabled = false;
    const InsertionResult white = renderInsertion(camera, light, ball(0.9f, 0), options, g_silent);
    const InsertionResult black = renderInsertion(camera, light, ball(0.0f, 0), options, g_silent);
    EXPECT_NEAR(meanRatio(white.layers), meanRatio(black.layers), 1e-6);
    EXPECT_LT(meanRatio(white.layers), meanRatio(full.layers) - 0.02);
    EXPECT_TRUE(hasFinding(white.findings, "no-interreflection"));
    EXPECT_EQ(white.no_interreflection_error.pixels, 256);
    EXPECT_GT(white.no_interreflection_error.rms, 0.02);
    EXPECT_GE(white.no_interreflection_error.upper, white.no_interreflection_error.rms);
}

/// A box with a plate that glows, or does not, before its side to the right.
ObjectScene boxWithGlowingSide(float emission)
{
    Material plate = shapes::lambert(glm::vec3(0.0f));
    plate.emissive = glm::vec3(emission);
    std::vector<ObjectScene::Object> objects;
    objects.push_back({shapes::model(shapes::box({-0.25f, 0.0f, -0.25f}, {0.25f, 0.5f, 0.25f}),
                                     shapes::lambert(glm::vec3(0.0f))),
                       {}});
    objects.push_back(
        {shapes::model(shapes::box({0.25f, 0.01f, -0.24f}, {0.26f, 0.49f, 0.24f}), plate), {}});
    return ObjectScene(std::move(objects));
}

// The floor before the front of a box faces none of its sides: what these send does not get there.
TEST_P(EachTechnique, ASideLightsNotTheFloorBeforeTheFront)
{
    RoomDescription room;
    room.floors.push_back({});
    const SceneProxy proxy(room);
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const Camera camera = Camera::lookAt({-0.05, 3.0, 0.31}, {-0.05, 0.0, 0.30}, 300.0, 24, 12);
    const auto meanRatio = [&](float emission) {
        const RenderLayers layers =
            renderInsertion(
                camera, light, boxWithGlowingSide(emission), optionsOf(GetParam()), g_silent)
                .layers;
        double sum = 0.0;
        int count = 0;
        for (std::size_t i = 0; i < layers.alpha.pixelCount(); ++i) {
            if (layers.alpha.pixels()[i] > 0.0f) continue;
            sum += layers.irradiance_with.pixels()[i].g / layers.irradiance_without.pixels()[i].g;
            ++count;
        }
        EXPECT_GT(count, 100);
        return sum / count;
    };
    const double dark = meanRatio(0.0f);
    EXPECT_NEAR(meanRatio(4.0f), dark, 0.0015);
}

std::string nameOf(const testing::TestParamInfo<Technique>& info)
{
    return info.param == Technique::Fiv ? "Fiv" : "Reference";
}

INSTANTIATE_TEST_SUITE_P(Interreflection,
                         EachTechnique,
                         testing::Values(Technique::Reference, Technique::Fiv),
                         nameOf);

// Two balls of metal that show each other: both techniques see black there.
TEST(Interreflection, BothTechniquesLeaveOutTheSame)
{
    const SceneProxy proxy(closedRoom());
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    Material metal;
    metal.metallic = 1.0f;
    metal.roughness = 0.05f;
    std::vector<ObjectScene::Object> objects;
    for (const float x : {-0.32f, 0.32f})
        objects.push_back({shapes::model(shapes::sphere({x, 0.4f, 0}, 0.3f, 32), metal), {}});
    const ObjectScene scene(std::move(objects));
    const Camera camera = Camera::lookAt({0.2, 0.9, 1.8}, {0, 0.4, 0}, 40.0, 40, 24);
    const auto rendered = [&](Technique technique, bool interreflection) {
        InsertionOptions options = optionsOf(technique);
        options.interreflection.enabled = interreflection;
        return renderInsertion(camera, light, scene, options, g_silent).layers;
    };
    const RenderLayers full = rendered(Technique::Reference, true);
    const RenderLayers reference = rendered(Technique::Reference, false);
    const RenderLayers fiv = rendered(Technique::Fiv, false);
    double off = 0.0;
    double cost = 0.0;
    double level = 0.0;
    for (std::size_t i = 0; i < full.alpha.pixelCount(); ++i) {
        if (full.alpha.pixels()[i] < 1.0f || fiv.alpha.pixels()[i] < 1.0f) continue;
        off += std::abs(fiv.object.pixels()[i].g - reference.object.pixels()[i].g);
        cost += std::abs(full.object.pixels()[i].g - reference.object.pixels()[i].g);
        level += full.object.pixels()[i].g;
    }
    EXPECT_LT(off, 0.04 * level);
    EXPECT_GT(cost, 2.0 * off);
}

}  // namespace
}  // namespace insitu
