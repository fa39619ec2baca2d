#include "core/check.h"
#include "core/color.h"
#include "core/parallel.h"
#include "lighting/environment_light.h"
#include "render/path_tracer.h"
#include "tests/support/shapes.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

namespace insitu {
namespace {

constexpr int kSize = 24;

/// A box on a floor under a lamp and a sky, everything multiplied by `scale` and then moved. All
/// coordinates are multiples of 1/64, so that moving by thousands of metres is exact in float.
struct TestScene {
    ObjectScene objects;
    EnvironmentLight light;
    Camera camera;
};

TestScene testScene(float scale = 1.0f, glm::vec3 offset = glm::vec3(0.0f))
{
    TriangleMesh mesh = shapes::quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8});
    const TriangleMesh box = shapes::box({-0.5f, 0, -0.375f}, {0.25f, 0.75f, 0.5f});
    for (const glm::uvec3& t : box.triangles)
        mesh.triangles.push_back(t + static_cast<std::uint32_t>(mesh.positions.size()));
    mesh.positions.insert(mesh.positions.end(), box.positions.begin(), box.positions.end());
    mesh.material_of.assign(mesh.triangles.size(), 1u);
    mesh.material_of[0] = mesh.material_of[1] = 0u;
    for (glm::vec3& p : mesh.positions)
        p = scale * p + offset;
    Model model = shapes::model(std::move(mesh), shapes::lambert(Rgb(0.6f, 0.5f, 0.4f)));
    Material glossy;
    glossy.base_color = Rgb(0.2f, 0.4f, 0.7f);
    glossy.roughness = 0.4f;
    model.materials.push_back(glossy);
    std::vector<ObjectScene::Object> objects;
    objects.push_back({std::move(model)});

    EnvironmentMap sky{Image<Rgb>(16, 8, Rgb(0.2f, 0.3f, 0.5f))};
    sky.pixels(3, 1) = Rgb(20.0f, 18.0f, 15.0f);
    const double s = scale;
    const glm::dvec3 o(offset);
    const AreaLamp lamp{
        {glm::dvec3(-1.0, 2.5, -1.0) * s + o, {1.0 * s, 0.0, 0.0}, {0.0, 0.0, 1.0 * s}},
        Rgb(2.0f, 1.8f, 1.5f),
        false};
    return {ObjectScene(std::move(objects)),
            EnvironmentLight(sky, {}, {lamp}),
            Camera::lookAt(glm::dvec3(1.5, 1.25, 2.0) * s + o,
                           glm::dvec3(0.0, 0.25, 0.0) * s + o,
                           30.0,
                           kSize,
                           kSize)};
}

RenderedImage render(const TestScene& scene, int samples, std::uint64_t seed = 1)
{
    Progress silent;
    return renderScene(scene.objects,
                       scene.light,
                       scene.camera,
                       {.samples_per_pixel = samples, .seed = seed},
                       silent);
}

/// Root mean square difference of luminance, relative to the mean of `truth`.
double relativeError(const Image<Rgb>& image, const Image<Rgb>& truth)
{
    double squares = 0.0;
    double mean = 0.0;
    for (std::size_t i = 0; i < image.pixelCount(); ++i) {
        const auto a = static_cast<double>(luminance(image.pixels()[i]));
        const auto b = static_cast<double>(luminance(truth.pixels()[i]));
        squares += (a - b) * (a - b);
        mean += b;
    }
    const auto n = static_cast<double>(image.pixelCount());
    return std::sqrt(squares / n) / (mean / n);
}

TEST(RenderScene, SameBytesForAnyNumberOfThreads)
{
    const TestScene scene = testScene();
    setThreadCount(1);
    const RenderedImage one = render(scene, 4);
    setThreadCount(4);
    const RenderedImage four = render(scene, 4);
    setThreadCount(0);
    EXPECT_EQ(one.radiance, four.radiance);
    EXPECT_EQ(one.variance, four.variance);
}

TEST(RenderScene, SeedsDiffer)
{
    const TestScene scene = testScene();
    EXPECT_NE(render(scene, 2, 1).radiance, render(scene, 2, 2).radiance);
}

// Monte Carlo's law: the error falls as the inverse root of the samples.
TEST(RenderScene, ErrorFallsAsTheRootOfSamples)
{
    const TestScene scene = testScene();
    // Other seeds than those under test: independent truth, 16 times as many samples as the most.
    const RenderedImage truth = render(scene, 4096, 1000);
    std::vector<double> log_samples, log_error;
    for (const int samples : {4, 16, 64, 256}) {
        double squares = 0.0;
        for (const std::uint64_t seed : {1u, 2u, 3u})
            squares +=
                std::pow(relativeError(render(scene, samples, seed).radiance, truth.radiance), 2.0);
        log_samples.push_back(std::log(samples));
        log_error.push_back(0.5 * std::log(squares / 3.0));
    }
    double mean_x = 0.0, mean_y = 0.0, xy = 0.0, xx = 0.0;
    const auto n = static_cast<double>(log_samples.size());
    for (std::size_t i = 0; i < log_samples.size(); ++i) {
        mean_x += log_samples[i] / n;
        mean_y += log_error[i] / n;
    }
    for (std::size_t i = 0; i < log_samples.size(); ++i) {
        xy += (log_samples[i] - mean_x) * (log_error[i] - mean_y);
        xx += (log_samples[i] - mean_x) * (log_samples[i] - mean_x);
    }
    RecordProperty("slope", std::to_string(xy / xx));
    EXPECT_NEAR(xy / xx, -0.5, 0.05);
}

// The variance that comes with the picture is the spread over independent pictures.
TEST(RenderScene, TellsItsOwnVariance)
{
    const TestScene scene = testScene();
    constexpr int kPictures = 64;
    std::vector<double> sum(kSize * kSize, 0.0), squares(kSize * kSize, 0.0);
    double told = 0.0;
    for (int k = 0; k < kPictures; ++k) {
        const RenderedImage picture = render(scene, 8, static_cast<std::uint64_t>(k));
        for (std::size_t i = 0; i < sum.size(); ++i) {
            const auto value = static_cast<double>(luminance(picture.radiance.pixels()[i]));
            sum[i] += value;
            squares[i] += value * value;
            told += static_cast<double>(picture.variance.pixels()[i]) / kPictures;
        }
    }
    double spread = 0.0;
    for (std::size_t i = 0; i < sum.size(); ++i)
        spread += (squares[i] - sum[i] * sum[i] / kPictures) / (kPictures - 1);
    // 576 pixels of 64 pictures: the ratio's own error is a few per cent, more with heavy tails.
    EXPECT_NEAR(told / spread, 1.0, 0.1);
    EXPECT_EQ(render(scene, 1).variance, Image<float>(kSize, kSize, 0.0f));
}

// A scene in millimetres is the same scene.
TEST(RenderScene, DoesNotDependOnTheUnit)
{
    const RenderedImage metres = render(testScene(), 16);
    for (const float scale : {0.01f, 1000.0f})
        EXPECT_LT(relativeError(render(testScene(scale), 16).radiance, metres.radiance), 1e-3)
            << scale;
}

TEST(RenderScene, DoesNotDependOnThePlace)
{
    const RenderedImage here = render(testScene(), 16);
    const RenderedImage there = render(testScene(1.0f, {10000.0f, -10000.0f, 10000.0f}), 16);
    EXPECT_LT(relativeError(there.radiance, here.radiance), 1e-3);
}

TEST(RenderScene, ShowsTheLightWhereNoObjectIs)
{
    const EnvironmentLight light({Image<Rgb>(16, 8, Rgb(0.25f, 0.5f, 1.0f))});
    const Camera camera = Camera::lookAt({0, 0, 0}, {0, 0, -1}, 20.0, 8, 4);
    Progress silent;
    const RenderedImage image =
        renderScene(ObjectScene({}), light, camera, {.samples_per_pixel = 3}, silent);
    EXPECT_EQ(image.radiance, Image<Rgb>(8, 4, Rgb(0.25f, 0.5f, 1.0f)));
    EXPECT_EQ(image.samples_per_pixel, 3);
    EXPECT_FALSE(image.stopped_by_time);
}

TEST(RenderScene, StopsInTime)
{
    Progress silent;
    const TestScene scene = testScene();
    const RenderedImage image = renderScene(scene.objects,
                                            scene.light,
                                            scene.camera,
                                            {.samples_per_pixel = 100000, .max_seconds = 1e-6},
                                            silent);
    EXPECT_EQ(image.samples_per_pixel, 1);
    EXPECT_TRUE(image.stopped_by_time);
    EXPECT_EQ(image.radiance, render(scene, 1).radiance);
}

class Impatient : public Progress {
public:
    void report(std::string_view, double fraction) override { seen_ = fraction; }
    [[nodiscard]] bool cancelled() const override { return seen_ >= 0.5; }
    [[nodiscard]] double seen() const { return seen_; }

private:
    double seen_ = 0.0;
};

TEST(RenderScene, CanBeCancelled)
{
    Impatient progress;
    const TestScene scene = testScene();
    EXPECT_THROW((void)renderScene(
                     scene.objects, scene.light, scene.camera, {.samples_per_pixel = 4}, progress),
                 CancelledError);
    EXPECT_EQ(progress.seen(), 0.5);
}

TEST(RenderScene, RefusesSenselessOptions)
{
    Progress silent;
    const TestScene scene = testScene();
    EXPECT_THROW((void)renderScene(
                     scene.objects, scene.light, scene.camera, {.samples_per_pixel = 0}, silent),
                 LogicError);
    EXPECT_THROW((void)renderScene(scene.objects, scene.light, Camera{}, {}, silent), LogicError);
}

}  // namespace
}  // namespace insitu
