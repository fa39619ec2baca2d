/// What technique `fiv` makes of objects that are moved and of objects with holes.

#include "render/cut_outs.h"
#include "render/renderer.h"
#include "tests/render/insertion_rooms.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

double areaOf(const TriangleMesh& mesh)
{
    double area = 0.0;
    for (const glm::uvec3& t : mesh.triangles)
        area += 0.5 * glm::length(glm::cross(
                          glm::dvec3(mesh.positions[t.y]) - glm::dvec3(mesh.positions[t.x]),
                          glm::dvec3(mesh.positions[t.z]) - glm::dvec3(mesh.positions[t.x])));
    return area;
}

/// A square of one metre, 0.4 m above the floor, with a texture whose holes are `isHole`.
template <class IsHole>
Model screen(int texels, const IsHole& isHole)
{
    Model model = shapes::model(shapes::quad({-0.5f, 0.4f, -0.5f}, {0, 0, 1}, {1, 0, 0}),
                                shapes::lambert(glm::vec3(0.5f)));
    model.mesh.texcoords = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    Texture texture;
    texture.texels = Image<glm::u8vec4>(texels, texels);
    for (int y = 0; y < texels; ++y)
        for (int x = 0; x < texels; ++x)
            texture.texels(x, y) = {255, 255, 255, isHole(x, y) ? 0 : 255};
    model.textures.push_back(std::move(texture));
    model.materials[0].base_color_texture = 0;
    model.materials[0].alpha_mask = true;
    return model;
}

InsertionOptions fiv()
{
    InsertionOptions options = coarseFiv();
    options.fiv.atlas.resolution = 64;
    return options;
}

/// An open floor under an even sky; what lies below 0.4 m is seen from the side.
struct Floor {
    SceneProxy proxy = [] {
        RoomDescription room;
        room.floors.push_back({});
        return SceneProxy(room);
    }();
    RoomLight light{proxy, uniform(1.0f), {0, 1, 0}, std::nullopt, coarse(), g_silent};
    Camera camera = Camera::lookAt({1.4, 0.35, 1.2}, {0.0, 0.0, 0.0}, 40.0, 32, 32);

    [[nodiscard]] InsertionResult with(std::vector<ObjectScene::Object> objects,
                                       const InsertionOptions& options) const
    {
        return renderInsertion(camera, light, ObjectScene(std::move(objects)), options, g_silent);
    }
    /// Share of the floor's light that is lost, over the pixels that show floor only.
    [[nodiscard]] static double lost(const RenderLayers& layers)
    {
        double without = 0.0;
        double with = 0.0;
        for (int y = 0; y < layers.alpha.height(); ++y)
            for (int x = 0; x < layers.alpha.width(); ++x) {
                if (layers.alpha(x, y) > 0.0f) continue;
                without += static_cast<double>(layers.irradiance_without(x, y).g);
                with += static_cast<double>(layers.irradiance_with(x, y).g);
            }
        return 1.0 - with / without;
    }
};

TEST(CutOuts, LeaveTheAreaThatIsThere)
{
    // A half, a chequered quarter, nothing and all of it.
    const double edge = 1.0 / 64.0;
    EXPECT_NEAR(
        areaOf(withoutCutOuts(screen(64, [](int x, int) { return x < 32; }), edge)), 0.5, 0.01);
    EXPECT_NEAR(
        areaOf(withoutCutOuts(
            screen(64, [](int x, int y) { return (x / 8 + y / 8) % 2 == 0 || y >= 32; }), edge)),
        0.25,
        0.01);
    EXPECT_EQ(areaOf(withoutCutOuts(screen(4, [](int, int) { return true; }), edge)), 0.0);
    EXPECT_NEAR(areaOf(withoutCutOuts(screen(4, [](int, int) { return false; }), edge)),
                1.0,
                tolerance::kFloat);
}

TEST(CutOuts, OfAWholeMaterialNeedNoTexture)
{
    Model model =
        shapes::model(shapes::box(glm::vec3(0), glm::vec3(1)), shapes::lambert(glm::vec3(0.5f)));
    model.materials[0].alpha_mask = true;
    EXPECT_EQ(withoutCutOuts(model, 0.1).triangles.size(), 12u);
    model.materials[0].alpha = 0.4f;
    EXPECT_TRUE(withoutCutOuts(model, 0.1).triangles.empty());
    model.materials[0].alpha_mask = false;
    EXPECT_EQ(withoutCutOuts(model, 0.1).triangles.size(), 12u);
}

TEST(CutOuts, StayWithinBounds)
{
    // A texture of 2048² on a square, asked for a ten thousandth of its side.
    const Model fine = screen(2048, [](int x, int y) { return (x / 512 + y / 512) % 2 == 0; });
    const TriangleMesh mesh = withoutCutOuts(fine, 1e-4);
    EXPECT_LT(mesh.triangles.size(), 4'000'000u);
    EXPECT_NEAR(areaOf(mesh), 0.5, 0.002);
}

TEST(RenderFiv, SeesThroughCutOutsAsTheReferenceDoes)
{
    const Floor floor;
    const auto holes = [](int x, int y) { return (x / 8 + y / 8) % 2 == 0; };
    const Model with_holes = screen(64, holes);
    Model solid = with_holes;
    solid.materials[0].alpha_mask = false;
    InsertionOptions truth;
    truth.technique = Technique::Reference;
    truth.max_samples = truth.min_samples = 128;
    const double expected = Floor::lost(floor.with({{with_holes, {}}}, truth).layers);
    const double found = Floor::lost(floor.with({{with_holes, {}}}, fiv()).layers);
    const double closed = Floor::lost(floor.with({{solid, {}}}, fiv()).layers);
    // A board with holes in half of it takes half the light, though less of the floor is seen.
    EXPECT_NEAR(found, expected, 0.05 * expected);
    EXPECT_GT(closed, 1.5 * found);
}

TEST(RenderFiv, AnObjectThatIsCutAwayLeavesTheRoomAsItWas)
{
    const Floor floor;
    const RenderLayers layers =
        floor.with({{screen(4, [](int, int) { return true; }), {}}}, fiv()).layers;
    EXPECT_EQ(layers.irradiance_with, layers.irradiance_without);
    EXPECT_EQ(*std::ranges::max_element(layers.alpha.pixels()), 0.0f);
}

class KeptAtlas : public ::testing::Test {
protected:
    TemporaryFolder folder_;
    InsertionOptions options_ = [this] {
        InsertionOptions options = fiv();
        options.fiv.atlas_folder = folder_.path();
        return options;
    }();
    Floor floor_;

    [[nodiscard]] static ObjectScene::Object at(const TriangleMesh& mesh,
                                                glm::dvec3 place,
                                                double turned_rad,
                                                double scale = 1.0)
    {
        return {shapes::model(mesh, shapes::lambert(glm::vec3(0.5f))),
                {{0.05, 0.0, 0.1}, scale, turned_rad, place}};
    }
    [[nodiscard]] std::size_t files() const
    {
        using Iterator = std::filesystem::directory_iterator;
        return static_cast<std::size_t>(std::distance(Iterator(folder_.path()), Iterator()));
    }
};

TEST_F(KeptAtlas, ServesTheObjectWhereverItStands)
{
    const TriangleMesh mesh = shapes::box({-0.3f, 0, -0.1f}, {0.3f, 0.8f, 0.1f});
    (void)floor_.with({at(mesh, {0, 0, 0}, 0.0)}, options_);
    const std::size_t one_object = files();
    EXPECT_GT(one_object, 0u);
    (void)floor_.with({at(mesh, {0.123, 0.0, -0.377}, 0.7, 1.3)}, options_);
    EXPECT_EQ(files(), one_object);
    // Two that are moved and turned together.
    const double turn = 0.37;
    const glm::dvec3 between(0.5 * std::cos(turn), 0.0, -0.5 * std::sin(turn));
    (void)floor_.with({at(mesh, {0, 0, 0}, 0.2), at(mesh, {0.5, 0, 0}, 0.4)}, options_);
    const std::size_t two_objects = files();
    EXPECT_GT(two_objects, one_object);
    const glm::dvec3 place(0.2, 0.0, 0.1);
    (void)floor_.with({at(mesh, place, 0.2 + turn), at(mesh, place + between, 0.4 + turn)},
                      options_);
    EXPECT_EQ(files(), two_objects);
    (void)floor_.with({at(mesh, {0, 0, 0}, 0.2), at(mesh, {0.6, 0, 0}, 0.4)}, options_);
    EXPECT_GT(files(), two_objects);
}

TEST_F(KeptAtlas, GivesATurnedObjectTheShadowOfItsTurnedMesh)
{
    const TriangleMesh mesh = shapes::box({-0.3f, 0, -0.1f}, {0.3f, 0.8f, 0.1f});
    const ObjectScene::Object turned = at(mesh, {0.1, 0.0, -0.2}, 0.6);
    // The same in the world from the start: other directions, the same light within their size.
    const ObjectScene::Object in_world = {
        shapes::model(placed(mesh, turned.placement), shapes::lambert(glm::vec3(0.5f))), {}};
    const RenderLayers a = floor_.with({turned}, options_).layers;
    const RenderLayers b = floor_.with({in_world}, options_).layers;
    EXPECT_EQ(a.alpha, b.alpha);
    double largest = 0.0;
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x)
            largest = std::max(largest,
                               static_cast<double>(std::abs(a.irradiance_with(x, y).g -
                                                            b.irradiance_with(x, y).g)));
    EXPECT_LT(largest, 0.02 * pi);
    EXPECT_NEAR(Floor::lost(a), Floor::lost(b), 0.02 * Floor::lost(b));
}

}  // namespace
}  // namespace insitu
