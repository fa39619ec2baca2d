// Rays per second of RayScene, and paths per second of the path tracer.

#include "core/random.h"
#include "lighting/environment_light.h"
#include "reconstruct/ray_scene.h"
#include "render/path_tracer.h"
#include "tests/support/shapes.h"

#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

namespace insitu {
namespace {

struct Ray {
    glm::dvec3 origin{0.0};
    glm::dvec3 direction{0.0};
};

/// Rays from points around a unit ball towards points in the ball: incoherent, half of them hit.
std::vector<Ray> raysAtBall(int count)
{
    std::vector<Ray> rays;
    RandomStream random(1, 0, 0);
    const auto direction = [&] {
        return glm::normalize(glm::dvec3(random.normal(), random.normal(), random.normal()));
    };
    for (int i = 0; i < count; ++i) {
        const glm::dvec3 origin = 2.0 * direction();
        rays.push_back({origin, glm::normalize(1.2 * direction() - origin)});
    }
    return rays;
}

/// rows² · 4 triangles, about.
TriangleMesh ball(int rows)
{
    return shapes::sphere({0, 0, 0}, 1.0f, rows);
}

constexpr int kRays = 1 << 16;

void closestHit(benchmark::State& state)
{
    const TriangleMesh mesh = ball(static_cast<int>(state.range(0)));
    const TriangleMesh* const pointer = &mesh;
    const RayScene scene(std::span<const TriangleMesh* const>(&pointer, 1));
    const std::vector<Ray> rays = raysAtBall(kRays);
    for (auto _ : state)
        for (const Ray& ray : rays)
            benchmark::DoNotOptimize(scene.intersect(ray.origin, ray.direction));
    state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
    state.SetItemsProcessed(state.iterations() * kRays);
}
BENCHMARK(closestHit)->Arg(8)->Arg(64)->Arg(400)->Unit(benchmark::kMillisecond);

void anyHit(benchmark::State& state)
{
    const TriangleMesh mesh = ball(static_cast<int>(state.range(0)));
    const TriangleMesh* const pointer = &mesh;
    const RayScene scene(std::span<const TriangleMesh* const>(&pointer, 1));
    const std::vector<Ray> rays = raysAtBall(kRays);
    for (auto _ : state)
        for (const Ray& ray : rays)
            benchmark::DoNotOptimize(scene.occluded(ray.origin, ray.direction));
    state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
    state.SetItemsProcessed(state.iterations() * kRays);
}
BENCHMARK(anyHit)->Arg(8)->Arg(64)->Arg(400)->Unit(benchmark::kMillisecond);

void build(benchmark::State& state)
{
    const TriangleMesh mesh = ball(static_cast<int>(state.range(0)));
    const TriangleMesh* const pointer = &mesh;
    for (auto _ : state)
        benchmark::DoNotOptimize(RayScene(std::span<const TriangleMesh* const>(&pointer, 1)));
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(mesh.triangles.size()));
}
BENCHMARK(build)->Arg(64)->Arg(400)->Unit(benchmark::kMillisecond);

/// A camera sample of a ball on a floor under a sky of 512 x 256 texels; range 0: matt, 1: glossy.
void cameraSample(benchmark::State& state)
{
    Material material = shapes::lambert(Rgb(0.5f));
    if (state.range(0) == 1) {
        material.specular = 1.0f;
        material.roughness = 0.4f;
    }
    std::vector<ObjectScene::Object> objects;
    objects.push_back({shapes::model(ball(64), material)});
    objects.push_back({shapes::model(shapes::quad({-4, -1, 4}, {8, 0, 0}, {0, 0, -8}), material)});
    const ObjectScene scene(std::move(objects));
    EnvironmentMap sky{Image<Rgb>(512, 256, Rgb(0.5f))};
    sky.pixels(100, 60) = Rgb(5000.0f);
    const EnvironmentLight light(std::move(sky));
    const Camera camera = Camera::lookAt({2, 1, 3}, {0, -0.5, 0}, 128.0, 128, 128);
    Progress silent;
    RenderOptions options;
    options.samples_per_pixel = 1;
    for (auto _ : state) {
        benchmark::DoNotOptimize(renderScene(scene, light, camera, options, silent));
        ++options.seed;
    }
    state.SetItemsProcessed(state.iterations() * 128 * 128);
}
BENCHMARK(cameraSample)->Arg(0)->Arg(1)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace insitu
