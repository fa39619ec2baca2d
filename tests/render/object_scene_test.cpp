#include "render/object_scene.h"

#include "core/check.h"
#include "core/color.h"
#include "tests/support/shapes.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace insitu {
namespace {

const glm::dvec3 kDown(0.0, -1.0, 0.0);

ObjectScene sceneOf(Model model)
{
    std::vector<ObjectScene::Object> objects;
    objects.push_back({std::move(model)});
    return ObjectScene(std::move(objects));
}

/// A floor of two metres; texture coordinate (0, 0) at its corner (-1, ., -1), u along x, v along
/// z.
Model floor(Material material)
{
    Model model = shapes::model(shapes::quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}), material);
    model.mesh.texcoords = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    return model;
}

/// Left half one colour, right half another, with their alphas; sharp away from the middle.
Texture halves(glm::u8vec4 left, glm::u8vec4 right, bool srgb)
{
    Texture texture;
    texture.srgb = srgb;
    texture.clamp_s = texture.clamp_t = true;
    texture.texels = Image<glm::u8vec4>(8, 8);
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x)
            texture.texels(x, y) = x < 4 ? left : right;
    return texture;
}

TEST(ObjectScene, LooksUpTheBaseColour)
{
    Material material = shapes::lambert(Rgb(1.0f, 0.5f, 1.0f));
    material.base_color_texture = 0;
    Model model = floor(material);
    model.textures.push_back(halves({255, 255, 255, 255}, {188, 188, 0, 255}, true));
    const ObjectScene scene = sceneOf(std::move(model));
    const auto left = scene.intersect({-0.6, 1.0, 0.3}, kDown);
    const auto right = scene.intersect({0.6, 1.0, 0.3}, kDown);
    ASSERT_TRUE(left && right);
    EXPECT_EQ(left->material.base_color, Rgb(1.0f, 0.5f, 1.0f));
    const auto linear = static_cast<float>(linearFromSrgb(188.0 / 255.0));
    EXPECT_NEAR(right->material.base_color.r, linear, tolerance::kFloat);
    EXPECT_NEAR(right->material.base_color.g, 0.5f * linear, tolerance::kFloat);
    EXPECT_EQ(right->material.base_color.b, 0.0f);
    EXPECT_DOUBLE_EQ(left->distance_m, 1.0);
    EXPECT_NEAR(glm::length(left->position - glm::dvec3(-0.6, 0.0, 0.3)), 0.0, tolerance::kDouble);
}

TEST(ObjectScene, LooksUpRoughnessMetallicAndEmission)
{
    Material material;
    material.roughness = 0.5f;
    material.metallic = 1.0f;
    material.emissive = Rgb(2.0f);
    material.metallic_roughness_texture = 0;
    material.emissive_texture = 1;
    Model model = floor(material);
    model.textures.push_back(halves({255, 102, 51, 255}, {0, 255, 0, 255}, false));
    model.textures.push_back(halves({0, 0, 0, 255}, {255, 0, 255, 255}, true));
    const ObjectScene scene = sceneOf(std::move(model));
    const auto left = scene.intersect({-0.6, 1.0, 0.3}, kDown);
    const auto right = scene.intersect({0.6, 1.0, 0.3}, kDown);
    ASSERT_TRUE(left && right);
    EXPECT_NEAR(left->material.roughness, 0.5 * 0.4, tolerance::kFloat);  // green
    EXPECT_NEAR(left->material.metallic, 0.2, tolerance::kFloat);         // blue
    EXPECT_EQ(left->material.emissive, Rgb(0.0f));
    EXPECT_NEAR(right->material.roughness, 0.5, tolerance::kFloat);
    EXPECT_EQ(right->material.metallic, 0.0f);
    EXPECT_EQ(right->material.emissive, Rgb(2.0f, 0.0f, 2.0f));
}

TEST(ObjectScene, CutOutsLetRaysPass)
{
    Material material = shapes::lambert(Rgb(0.5f));
    material.alpha_mask = true;
    material.base_color_texture = 0;
    Model model = floor(material);
    model.textures.push_back(halves({255, 255, 255, 0}, {255, 255, 255, 255}, true));
    const ObjectScene scene = sceneOf(model);
    EXPECT_FALSE(scene.intersect({-0.6, 1.0, 0.3}, kDown).has_value());
    EXPECT_FALSE(scene.occluded({-0.6, 1.0, 0.3}, kDown));
    EXPECT_TRUE(scene.intersect({0.6, 1.0, 0.3}, kDown).has_value());
    EXPECT_TRUE(scene.occluded({0.6, 1.0, 0.3}, kDown));
    // The factor counts too: 0.4 of 255 is below the cut-off of one half.
    model.materials[0].alpha = 0.4f;
    EXPECT_FALSE(sceneOf(model).occluded({0.6, 1.0, 0.3}, kDown));
    // Without the mask alpha means nothing.
    model.materials[0].alpha_mask = false;
    EXPECT_TRUE(sceneOf(model).occluded({-0.6, 1.0, 0.3}, kDown));
}

TEST(ObjectScene, NormalsFaceTheRay)
{
    const ObjectScene scene = sceneOf(floor(shapes::lambert(Rgb(0.5f))));
    const auto above = scene.intersect({0.1, 1.0, 0.2}, kDown);
    const auto below = scene.intersect({0.1, -1.0, 0.2}, -kDown);
    ASSERT_TRUE(above && below);
    EXPECT_EQ(above->geometric_normal, glm::dvec3(0.0, 1.0, 0.0));
    EXPECT_EQ(below->geometric_normal, glm::dvec3(0.0, -1.0, 0.0));
    EXPECT_EQ(above->shading_normal, above->geometric_normal);
    EXPECT_EQ(below->shading_normal, below->geometric_normal);
}

TEST(ObjectScene, InterpolatesNormals)
{
    const glm::dvec3 center(0.2, 0.5, -0.1);
    const ObjectScene scene = sceneOf(
        shapes::model(shapes::sphere(glm::vec3(center), 0.5f, 12), shapes::lambert(Rgb(0.5f))));
    int different = 0;
    for (int i = 0; i < 100; ++i) {
        const double azimuth = 0.0628 * i;
        const glm::dvec3 out(std::cos(azimuth), 0.3, std::sin(azimuth));
        const auto point = scene.intersect(center + 3.0 * out, -glm::normalize(out));
        ASSERT_TRUE(point.has_value());
        // Twelve rows: facets of 15 degrees. Interpolation leaves a few tenths of a degree.
        EXPECT_GT(glm::dot(point->shading_normal, glm::normalize(point->position - center)),
                  std::cos(0.01));
        EXPECT_NEAR(glm::length(point->shading_normal), 1.0, tolerance::kDouble);
        if (glm::dot(point->shading_normal, point->geometric_normal) < std::cos(0.03)) ++different;
        // The same from inside, on the other side.
        const auto inside = scene.intersect(center, glm::normalize(out));
        ASSERT_TRUE(inside.has_value());
        EXPECT_LT(glm::dot(inside->shading_normal, glm::normalize(out)), 0.0);
    }
    EXPECT_GT(different, 10) << "the geometric normals were meant to differ";
}

// A normal that leans away from a grazing viewer: left alone for Lambert, lifted for gloss.
TEST(ObjectScene, GlossyNormalsStayAboveTheViewersHorizon)
{
    const glm::vec3 leaning = glm::normalize(glm::vec3(1.0f, 1.0f, 0.0f));
    const glm::dvec3 ray = glm::normalize(glm::dvec3(1.0, -0.3, 0.0));
    Model model = floor(shapes::lambert(Rgb(0.5f)));
    model.mesh.normals.assign(4, leaning);
    const auto matte = sceneOf(model).intersect(glm::dvec3(0.0) - ray, ray);
    model.materials[0].specular = 1.0f;
    const auto glossy = sceneOf(model).intersect(glm::dvec3(0.0) - ray, ray);
    ASSERT_TRUE(matte && glossy);
    EXPECT_NEAR(glm::length(matte->shading_normal - glm::dvec3(leaning)), 0.0, 1e-6);
    EXPECT_LT(glm::dot(matte->shading_normal, -ray), 0.0);
    EXPECT_GT(glm::dot(glossy->shading_normal, -ray), 0.0);
    EXPECT_GT(glm::dot(glossy->shading_normal, glossy->geometric_normal), 0.0);
}

TEST(ObjectScene, BrokenVertexNormalsFallBackToTheTriangle)
{
    Model model = floor(shapes::lambert(Rgb(0.5f)));
    model.mesh.normals.assign(4, glm::vec3(0.0f));
    const auto point = sceneOf(std::move(model)).intersect({0.1, 1.0, 0.2}, kDown);
    ASSERT_TRUE(point.has_value());
    EXPECT_EQ(point->shading_normal, glm::dvec3(0.0, 1.0, 0.0));
}

TEST(ObjectScene, KeepsObjectsApart)
{
    std::vector<ObjectScene::Object> objects;
    objects.push_back({floor(shapes::lambert(Rgb(0.1f)))});
    objects.push_back({Model{}});
    objects.push_back(
        {shapes::model(shapes::box({0, 0, 0}, {1, 1, 1}), shapes::lambert(Rgb(0.9f)))});
    const ObjectScene scene(std::move(objects));
    EXPECT_FALSE(scene.empty());
    ASSERT_EQ(scene.bounds().size(), 3u);
    EXPECT_EQ(scene.bounds()[2].max, glm::dvec3(1.0));
    const auto on_box = scene.intersect({0.5, 3.0, 0.4}, kDown);
    const auto on_floor = scene.intersect({-0.5, 3.0, 0.4}, kDown);
    ASSERT_TRUE(on_box && on_floor);
    EXPECT_EQ(on_box->object, 2u);
    EXPECT_EQ(on_box->material.base_color, Rgb(0.9f));
    EXPECT_EQ(on_floor->object, 0u);
    EXPECT_FALSE(scene.intersect({0.5, 3.0, 0.4}, kDown, 1.9).has_value());
    EXPECT_TRUE(ObjectScene({}).empty());
}

TEST(ObjectScene, RefusesBrokenModels)
{
    const Model good = floor(shapes::lambert(Rgb(0.5f)));
    Model bad = good;
    bad.mesh.material_of[0] = 1;
    EXPECT_THROW(sceneOf(bad), LogicError);
    bad = good;
    bad.mesh.material_of.clear();
    EXPECT_THROW(sceneOf(bad), LogicError);
    bad = good;
    bad.mesh.normals.resize(1);
    EXPECT_THROW(sceneOf(bad), LogicError);
    bad = good;
    bad.mesh.texcoords.resize(1);
    EXPECT_THROW(sceneOf(bad), LogicError);
    bad = good;
    bad.materials[0].base_color_texture = 0;
    EXPECT_THROW(sceneOf(bad), LogicError);
    bad.textures.emplace_back();  // without texels
    EXPECT_THROW(sceneOf(bad), LogicError);
}

}  // namespace
}  // namespace insitu
