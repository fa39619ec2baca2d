/// Glossy objects by technique `fiv`.

#include "render/bsdf/ggx_albedo.h"
#include "render/renderer.h"
#include "tests/render/insertion_rooms.h"
#include "tests/support/shapes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace insitu {
namespace {

Material metal(float roughness)
{
    Material material;
    material.base_color = {0.9f, 0.6f, 0.3f};
    material.metallic = 1.0f;
    material.roughness = roughness;
    return material;
}

InsertionOptions fiv()
{
    InsertionOptions options = coarseFiv();
    options.fiv.object_samples = 128;
    return options;
}

class GlossyObjects : public ::testing::TestWithParam<float> {
protected:
    /// Bright on one side, as by a window.
    [[nodiscard]] static EnvironmentMap lopsided()
    {
        EnvironmentMap sky = uniform(0.5f);
        for (int y = 12; y < 32; ++y)
            for (int x = 20; x < 40; ++x)
                sky.pixels(x, y) = Rgb(8.0f, 7.0f, 6.0f);
        return sky;
    }
    [[nodiscard]] static RenderLayers rendered(const EnvironmentMap& probe,
                                               const RoomDescription& room,
                                               std::vector<ObjectScene::Object> objects,
                                               glm::dvec3 at,
                                               const InsertionOptions& options)
    {
        const SceneProxy proxy(room);
        const RoomLight light(proxy, probe, {0, 1, 0}, std::nullopt, coarse(), g_silent);
        const Camera camera = Camera::lookAt({0.9, 1.3, 1.6}, at, 90.0, 48, 48);
        return renderInsertion(camera, light, ObjectScene(std::move(objects)), options, g_silent)
            .layers;
    }
};

TEST_P(GlossyObjects, ReflectAnEvenLightAsTheClosedFormSays)
{
    InsertionOptions options = fiv();
    options.interreflection.enabled = false;
    RoomDescription room;
    room.floors.push_back({});
    const Material material = metal(GetParam());
    const RenderLayers layers =
        rendered(uniform(1.0f),
                 room,
                 {{shapes::model(shapes::sphere({0, 0.45f, 0}, 0.4f, 48), material), {}}},
                 {0, 0.45, 0},
                 options);
    // Where the camera looks along the normal, all of the lobe is above the horizon.
    const ggx::Albedo albedo = ggx::directionalAlbedo(material.roughness, 1.0);
    for (int c = 0; c < 3; ++c) {
        const double expected = albedo.of(static_cast<double>(material.base_color[c]), 1.0);
        EXPECT_NEAR(layers.object(24, 24)[c], expected, 0.02 * expected) << "channel " << c;
    }
}

TEST_P(GlossyObjects, LookAsTheReferenceRendersThem)
{
    // A box beside a ball: what they show each other counts.
    const auto objects = [&] {
        std::vector<ObjectScene::Object> made;
        made.push_back(
            {shapes::model(shapes::sphere({-0.2f, 0.3f, 0}, 0.3f, 32), metal(GetParam())), {}});
        made.push_back(
            {shapes::model(shapes::box({0.2f, 0, -0.3f}, {0.7f, 0.7f, 0.2f}), metal(GetParam())),
             {}});
        return made;
    };
    const glm::dvec3 middle(0.15, 0.3, 0.0);
    InsertionOptions truth;
    truth.technique = Technique::Reference;
    truth.max_samples = truth.min_samples = 256;
    const RenderLayers expected = rendered(lopsided(), closedRoom(), objects(), middle, truth);
    const RenderLayers found = rendered(lopsided(), closedRoom(), objects(), middle, fiv());
    // Means of 4 x 4 pixels: the noise of either is not what is asked for.
    double off = 0.0;
    double level = 0.0;
    int squares = 0;
    for (int top = 0; top < 48; top += 4)
        for (int left = 0; left < 48; left += 4) {
            glm::dvec3 one(0.0);
            glm::dvec3 other(0.0);
            bool covered = true;
            for (int y = top; y < top + 4; ++y)
                for (int x = left; x < left + 4; ++x) {
                    covered = covered && expected.alpha(x, y) > 0.99f;
                    one += glm::dvec3(expected.object(x, y));
                    other += glm::dvec3(found.object(x, y));
                }
            if (!covered) continue;
            ++squares;
            off += glm::dot(one - other, one - other);
            level += glm::dot(one, one);
        }
    EXPECT_GT(squares, 20);
    RecordProperty("off", fmt::format("{:.4f}", std::sqrt(off / level)));
    // 0.065 to 0.082: the objects see each other as mattly lit, once.
    EXPECT_LT(std::sqrt(off / level), 0.1);
}

// A few directions a pixel hit the window or do not: no pixel may show it.
TEST(GlossyObject, IsSmooth)
{
    EnvironmentMap sky = uniform(0.5f);
    for (int y = 16; y < 24; ++y)
        for (int x = 24; x < 32; ++x)
            sky.pixels(x, y) = Rgb(100.0f);
    const SceneProxy proxy(closedRoom());
    const RoomLight light(proxy, sky, {0, 1, 0}, std::nullopt, coarse(), g_silent);
    const Camera camera = Camera::lookAt({0.9, 1.3, 1.6}, {0, 0.45, 0}, 220.0, 48, 48);
    for (const float roughness : {0.4f, 0.7f}) {
        std::vector<ObjectScene::Object> objects;
        objects.push_back(
            {shapes::model(shapes::sphere({0, 0.45f, 0}, 0.4f, 64), metal(roughness)), {}});
        const RenderLayers layers =
            renderInsertion(camera, light, ObjectScene(std::move(objects)), fiv(), g_silent).layers;
        // Second differences along rows in the ball's middle, beside its level.
        double bend = 0.0;
        double level = 0.0;
        for (int y = 18; y < 30; ++y)
            for (int x = 18; x < 30; ++x) {
                const auto at = [&](int u) { return static_cast<double>(layers.object(u, y).g); };
                bend += std::pow(at(x - 1) - 2.0 * at(x) + at(x + 1), 2.0);
                level += at(x) * at(x);
            }
        // Unsmoothed it is above 1.
        EXPECT_LT(std::sqrt(bend / level), 0.1) << roughness;
    }
}

INSTANTIATE_TEST_SUITE_P(Roughnesses, GlossyObjects, ::testing::Values(0.05f, 0.2f, 0.4f, 0.8f));

}  // namespace
}  // namespace insitu
