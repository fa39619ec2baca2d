#include "render/path_tracer.h"

#include "core/color.h"
#include "lighting/environment_light.h"
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

}  // namespace
}  // namespace insitu
