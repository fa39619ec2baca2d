// What lies nearer than the atlas can tell from a surface itself.
#include "render/renderer.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/render/insertion_rooms.h"
#include "tests/support/shapes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace insitu {
namespace {

constexpr float kAlbedo = 0.05f;
constexpr float kSlot = 0.02f;  ///< width and depth, metres; a texel is about 0.03

/// A slab of 1 m with a slot through its top, along z.
ObjectScene slottedSlab()
{
    TriangleMesh mesh = shapes::box({-0.5f, 0.5f, -0.5f}, {0.5f, 0.6f, 0.5f});
    shapes::append(mesh, shapes::box({-0.5f, 0.6f, -0.5f}, {-0.5f * kSlot, 0.6f + kSlot, 0.5f}));
    shapes::append(mesh, shapes::box({0.5f * kSlot, 0.6f, -0.5f}, {0.5f, 0.6f + kSlot, 0.5f}));
    std::vector<ObjectScene::Object> objects;
    objects.push_back({shapes::model(mesh, shapes::lambert(glm::vec3(kAlbedo)))});
    return ObjectScene(std::move(objects));
}

// Under an even sky the middle of a long slot's bottom receives the sine of the half angle that it
// sees the sky under: of atan(1/2) for one as deep as wide. Its top receives all.
TEST(FivCreases, ASlotThinnerThanATexelIsDark)
{
    RoomDescription room;
    room.floors.push_back({});
    const SceneProxy proxy(room);
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    InsertionOptions options;
    options.technique = Technique::Fiv;
    options.fiv.atlas = {16, 48, 2};
    options.fiv.object_face_size = 8;
    options.fiv.receiver_node_spacing_m = 1.0;
    options.interreflection.enabled = false;
    // 2 mm a pixel.
    const Camera camera = Camera::lookAt({0.0, 2.6, 1e-4}, {0.0, 0.62, 0.0}, 1000.0, 64, 32);
    const RenderLayers layers =
        renderInsertion(camera, light, slottedSlab(), options, g_silent).layers;
    const auto received = [&](int x) {
        return static_cast<double>(layers.object(x, 16).g / (kAlbedo * layers.alpha(x, 16)));
    };
    const double closed_form = std::sin(std::atan(0.5));
    double bottom = 0.0;
    for (const int x : {31, 32})
        bottom += 0.5 * received(x);
    EXPECT_NEAR(bottom, closed_form, 0.05);
    for (const int x : {3, 10, 54, 60})
        EXPECT_NEAR(received(x), 1.0, 0.02) << "nothing is near the flat top";
}

/// The lower half of a sphere, open at the top.
ObjectScene bowl(float albedo)
{
    TriangleMesh mesh = shapes::sphere({0.0f, 1.0f, 0.0f}, 0.5f, 32);
    std::erase_if(mesh.triangles, [&](const glm::uvec3& t) {
        for (int k = 0; k < 3; ++k)
            if (mesh.positions[t[k]].y > 1.0f + 1e-3f) return true;
        return false;
    });
    mesh.normals.clear();
    mesh.material_of.assign(mesh.triangles.size(), 0);
    std::vector<ObjectScene::Object> objects;
    objects.push_back({shapes::model(mesh, shapes::lambert(glm::vec3(albedo)))});
    return ObjectScene(std::move(objects));
}

// Inside a sphere every part of it sends every point the same share of light. Under an even sky a
// half receives f = 1/2 of it and, again and again, (1 - f) of what it sends: f / (1 - ρ (1 - f)).
// Its outside, which is bright, it does not see.
TEST(FivCreases, ABowlIsLitByItsInsideAndTheSky)
{
    RoomDescription room;
    room.floors.push_back({});
    const SceneProxy proxy(room);
    const RoomLight light(proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent);
    InsertionOptions options;
    options.technique = Technique::Fiv;
    options.fiv.atlas = {16, 48, 2};
    options.fiv.object_face_size = 16;
    options.fiv.receiver_node_spacing_m = 1.0;
    options.fiv.object_samples = 256;
    const Camera camera = Camera::lookAt({0.0, 3.0, 1e-4}, {0.0, 0.5, 0.0}, 60.0, 32, 24);
    for (const float albedo : {0.4f, 0.8f}) {
        const RenderLayers layers =
            renderInsertion(camera, light, bowl(albedo), options, g_silent).layers;
        double received = 0.0;
        int pixels = 0;
        // Not its rim, where the atlas's texels blur in from out.
        for (int y = 7; y < 17; ++y)
            for (int x = 11; x < 21; ++x, ++pixels)
                received += static_cast<double>(layers.object(x, y).g / albedo);
        EXPECT_NEAR(received / pixels, 0.5 / (1.0 - 0.5 * static_cast<double>(albedo)), 0.04)
            << albedo;
    }
}

}  // namespace
}  // namespace insitu
