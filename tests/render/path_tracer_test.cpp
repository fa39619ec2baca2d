#include "render/path_tracer.h"

#include "core/color.h"
#include "lighting/environment_light.h"
#include "tests/support/form_factor.h"
#include "tests/support/shapes.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

EnvironmentMap constantEnvironment(Rgb radiance)
{
    return {Image<Rgb>(16, 8, radiance)};
}

ObjectScene sceneOf(Model model)
{
    std::vector<ObjectScene::Object> objects;
    objects.push_back({std::move(model)});
    return ObjectScene(std::move(objects));
}

struct Estimate {
    double mean = 0.0;
    double standard_error = 0.0;
};

/// Mean luminance of tracePath() where a ray hits.
Estimate traceMany(const ObjectScene& scene,
                   const LightSource& light,
                   glm::dvec3 origin,
                   glm::dvec3 direction,
                   int samples,
                   const PathOptions& options = {})
{
    double sum = 0.0;
    double squares = 0.0;
    const std::optional<SurfacePoint> point = scene.intersect(origin, glm::normalize(direction));
    EXPECT_TRUE(point.has_value());
    if (!point) return {};
    for (int i = 0; i < samples; ++i) {
        RandomStream random(7, 0, static_cast<std::uint64_t>(i));
        const auto value = static_cast<double>(luminance(
            tracePath(scene, light, *point, -glm::normalize(direction), options, random)));
        sum += value;
        squares += value * value;
    }
    const double n = samples;
    return {sum / n, std::sqrt(std::max(0.0, squares - sum * sum / n) / (n * (n - 1.0)))};
}

Model emitter(TriangleMesh mesh, Material material, Rgb emission)
{
    material.emissive = emission;
    return shapes::model(std::move(mesh), std::move(material));
}

AreaLamp ceilingLamp()
{
    return {{{-0.5, 2.0, -0.25}, {1.0, 0.0, 0.0}, {0.0, 0.0, 0.5}}, Rgb(3.0f), false};
}

// A white Lambert body under uniform light reflects exactly as much as it receives.
TEST(PathTracer, WhiteFurnaceOfAConvexBody)
{
    const ObjectScene scene =
        sceneOf(shapes::model(shapes::box({-1, -1, -1}, {1, 1, 1}), shapes::lambert(Rgb(1.0f))));
    const EnvironmentLight light(constantEnvironment(Rgb(1.0f)));
    const Estimate e = traceMany(scene, light, {0.3, 5.0, 0.2}, {0.0, -1.0, 0.0}, 4000);
    EXPECT_NEAR(e.mean, 1.0, tolerance::kStandardErrors * e.standard_error + 1e-6);
    EXPECT_LT(e.standard_error, 0.02);
}

// So does a concave one, whatever its surface: here a half-open box, white, matt and glossy.
TEST(PathTracer, WhiteFurnaceOfAConcaveBody)
{
    TriangleMesh mesh = shapes::box({-1, -1, -1}, {1, 1, 1});
    mesh.triangles.erase(mesh.triangles.begin() + 2, mesh.triangles.begin() + 4);  // no top
    mesh.material_of.resize(mesh.triangles.size());
    const EnvironmentLight light(constantEnvironment(Rgb(1.0f)));
    const PathOptions options{.max_bounces = 1000, .roulette_start = 4};
    Material glossy;
    glossy.base_color = Rgb(1.0f);
    glossy.roughness = 0.5f;
    for (const Material& material : {shapes::lambert(Rgb(1.0f)), glossy}) {
        const ObjectScene scene = sceneOf(shapes::model(mesh, material));
        const Estimate e =
            traceMany(scene, light, {0.3, 5.0, 0.2}, {0.1, -1.0, 0.05}, 4000, options);
        // The glossy coat's table is good to 4e-3 a bounce, over a few bounces.
        EXPECT_NEAR(e.mean, 1.0, tolerance::kStandardErrors * e.standard_error + 1e-2);
        EXPECT_LT(e.standard_error, 0.02);
    }
}

TEST(PathTracer, GreySphereReflectsItsAlbedo)
{
    const ObjectScene scene =
        sceneOf(shapes::model(shapes::sphere({0, 0, 0}, 1.0f, 24), shapes::lambert(Rgb(0.5f))));
    const EnvironmentLight light(constantEnvironment(Rgb(2.0f)));
    const Estimate e = traceMany(scene, light, {0.3, 5.0, 0.2}, {0.0, -1.0, 0.0}, 4000);
    // Light between the shading horizon and the facet's is refused: a thousandth of it here.
    EXPECT_NEAR(e.mean, 1.0, tolerance::kStandardErrors * e.standard_error + 2e-3);
}

// Inside a closed body whose walls glow with e and reflect half: L = e + e/2 + e/4 + … = 2e.
// Russian roulette must not change it, nor where it starts.
TEST(PathTracer, ClosedGlowingBodyIsAGeometricSeries)
{
    const ObjectScene scene = sceneOf(
        emitter(shapes::box({-1, -2, -1}, {1, 1, 3}), shapes::lambert(Rgb(0.5f)), Rgb(1.0f)));
    const EnvironmentLight dark(EnvironmentMap{});
    for (const int start : {0, 4, 100}) {
        const PathOptions options{.max_bounces = 60, .roulette_start = start};
        const Estimate e = traceMany(scene, dark, {0.1, 0.2, 0.3}, {0.3, -1.0, 0.2}, 4000, options);
        EXPECT_NEAR(e.mean, 2.0, tolerance::kStandardErrors * e.standard_error + 1e-5) << start;
    }
    // Bounces are counted: e, e + e/2, … exactly.
    const PathOptions one{.max_bounces = 1, .roulette_start = 4};
    EXPECT_NEAR(traceMany(scene, dark, {0.1, 0.2, 0.3}, {0.3, -1.0, 0.2}, 10, one).mean, 1.5, 1e-6);
    const PathOptions two{.max_bounces = 2, .roulette_start = 4};
    EXPECT_NEAR(
        traceMany(scene, dark, {0.1, 0.2, 0.3}, {0.3, -1.0, 0.2}, 10, two).mean, 1.75, 1e-6);
}

// A floor under a lamp: radiance = albedo/π · π · form factor · lamp.
TEST(PathTracer, FloorUnderALampIsItsFormFactor)
{
    const ObjectScene scene = sceneOf(shapes::model(
        shapes::quad({-5, 0, 5}, {10, 0, 0}, {0, 0, -10}), shapes::lambert(Rgb(0.6f))));
    const EnvironmentLight light({}, {}, {ceilingLamp()});
    const Estimate e = traceMany(scene, light, {0.0, 1.0, 0.0}, {0.0, -1.0, 0.0}, 20000);
    const double truth = 0.6 * 3.0 * 4.0 * form_factor::parallelRectangle(0.5, 0.25, 2.0);
    EXPECT_NEAR(e.mean, truth, tolerance::kStandardErrors * e.standard_error + 1e-6);
    EXPECT_LT(e.standard_error, 0.01 * truth);
}

// The same with a glossy floor, against the integral over the lamp's area by the midpoint rule:
// both ways of sampling must find the highlight, and not count it twice.
TEST(PathTracer, HighlightOfALampMatchesQuadrature)
{
    const EnvironmentLight light({}, {}, {ceilingLamp()});
    const glm::dvec3 eye = glm::dvec3(0.3, 2.0, 1.0) * 0.7;
    const glm::dvec3 wo = glm::normalize(eye);
    for (const float roughness : {0.15f, 0.4f, 0.8f}) {
        Material material;
        material.base_color = Rgb(0.3f);
        material.roughness = roughness;
        const ObjectScene scene =
            sceneOf(shapes::model(shapes::quad({-5, 0, 5}, {10, 0, 0}, {0, 0, -10}), material));
        const SurfaceMaterial surface{
            .base_color = Rgb(0.3f), .metallic = 0.0f, .roughness = roughness};
        double truth = 0.0;
        constexpr int kSteps = 400;
        for (int i = 0; i < kSteps; ++i)
            for (int j = 0; j < kSteps; ++j) {
                const glm::dvec3 p(
                    -0.5 + (i + 0.5) / kSteps, 2.0, -0.25 + 0.5 * (j + 0.5) / kSteps);
                const double distance = glm::length(p);
                const glm::dvec3 wi = p / distance;
                const double area = 0.5 / (kSteps * kSteps);
                truth += 3.0 *
                         static_cast<double>(luminance(evaluateBsdf(surface, {0, 1, 0}, wo, wi))) *
                         wi.y * wi.y * area / (distance * distance);
            }
        const Estimate e = traceMany(scene, light, eye, -wo, 20000);
        EXPECT_NEAR(e.mean, truth, tolerance::kStandardErrors * e.standard_error + 1e-4 * truth)
            << roughness;
        EXPECT_LT(e.standard_error, 0.02 * truth) << roughness;
    }
}

// A closed room with a window: light found by chance, and by drawing points in the window.
TEST(PathTracer, PortalsDoNotChangeTheMean)
{
    TriangleMesh room;  // 4 x 4 x 4, open over half of the wall at -z
    shapes::addQuad(room, {-2, 0, -2}, {0, 0, 4}, {4, 0, 0});
    shapes::addQuad(room, {-2, 4, -2}, {4, 0, 0}, {0, 0, 4});
    shapes::addQuad(room, {-2, 0, -2}, {4, 0, 0}, {0, 2, 0});
    shapes::addQuad(room, {-2, 0, 2}, {0, 4, 0}, {4, 0, 0});
    shapes::addQuad(room, {-2, 0, -2}, {0, 4, 0}, {0, 0, 4});
    shapes::addQuad(room, {2, 0, -2}, {0, 0, 4}, {0, 4, 0});
    const ObjectScene scene = sceneOf(shapes::model(room, shapes::lambert(Rgb(0.5f))));
    const EnvironmentMap sky = constantEnvironment(Rgb(1.0f));
    const Portal window{{{-2, 2, -2}, {4, 0, 0}, {0, 2, 0}}};
    const glm::dvec3 eye(0.0, 1.5, 0.0);
    const glm::dvec3 down(0.2, -1.0, 0.3);
    const Estimate plain = traceMany(scene, EnvironmentLight(sky), eye, down, 20000);
    const Estimate guided = traceMany(scene, EnvironmentLight(sky, {window}), eye, down, 20000);
    EXPECT_NEAR(
        plain.mean,
        guided.mean,
        tolerance::kStandardErrors * std::hypot(plain.standard_error, guided.standard_error));
    EXPECT_LT(guided.standard_error, 0.7 * plain.standard_error);
}

// A sheet that is cut out everywhere casts no shadow.
TEST(PathTracer, CutOutsCastNoShadow)
{
    Model model = shapes::model(shapes::quad({-5, 0, 5}, {10, 0, 0}, {0, 0, -10}),
                                shapes::lambert(Rgb(0.6f)));
    shapes::addQuad(model.mesh, {-5, 1.5f, 5}, {10, 0, 0}, {0, 0, -10});
    model.mesh.material_of[2] = model.mesh.material_of[3] = 1;
    Material sheet = shapes::lambert(Rgb(0.5f));
    sheet.alpha_mask = true;
    sheet.alpha = 0.2f;
    model.materials.push_back(sheet);
    const EnvironmentLight light({}, {}, {ceilingLamp()});
    const Estimate open = traceMany(sceneOf(model), light, {0, 1, 0}, {0, -1, 0}, 2000);
    EXPECT_GT(open.mean, 0.05);
    model.materials[1].alpha_mask = false;
    EXPECT_EQ(traceMany(sceneOf(model), light, {0, 1, 0}, {0, -1, 0}, 2000).mean, 0.0);
    model.materials[1].alpha_mask = true;
    model.mesh.triangles.resize(2);
    model.mesh.material_of.resize(2);
    EXPECT_EQ(traceMany(sceneOf(model), light, {0, 1, 0}, {0, -1, 0}, 2000).mean, open.mean);
}

}  // namespace
}  // namespace insitu
