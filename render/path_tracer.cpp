#include "render/path_tracer.h"

#include "core/check.h"
#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

/// A shadow ray stops this share of its way before the source: a lamp that lies on a wall, or the
/// room's own surface, must not hide itself.
constexpr double kShadowReach = 1.0 - 1e-4;

bool isFinite(const Rgb& c)
{
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}

/// One draw of light, weighted against the chance that BSDF sampling finds the same direction.
Rgb directLight(const ObjectScene& objects,
                const LightSource& light,
                const SurfacePoint& point,
                glm::dvec3 wo,
                float selector,
                glm::vec2 u)
{
    const std::optional<LightSample> drawn = light.sample(point.position, selector, u);
    if (!drawn || drawn->radiance == Rgb(0.0f)) return Rgb(0.0f);
    const double cosine = glm::dot(point.shading_normal, drawn->direction);
    if (cosine <= 0.0 || glm::dot(point.geometric_normal, drawn->direction) <= 0.0)
        return Rgb(0.0f);
    const Rgb f = evaluateBsdf(point.material, point.shading_normal, wo, drawn->direction);
    if (f == Rgb(0.0f)) return Rgb(0.0f);
    if (objects.occluded(objects.leave(point, drawn->direction),
                         drawn->direction,
                         drawn->distance_m * kShadowReach))
        return Rgb(0.0f);
    // Balance heuristic: f·L·cos/p · p/(p + p_bsdf).
    const double other = bsdfPdf(point.material, point.shading_normal, wo, drawn->direction);
    return f * drawn->radiance * static_cast<float>(cosine / (drawn->pdf + other));
}

/// Russian roulette: the chance that a path goes on.
double survival(const Rgb& throughput)
{
    return std::min(0.95,
                    static_cast<double>(std::max({throughput.r, throughput.g, throughput.b})));
}

/// Running sums of one pixel.
struct PixelSum {
    glm::dvec3 radiance{0.0};
    double luminance = 0.0;
    double luminance_squared = 0.0;
};

Rgb samplePixel(const ObjectScene& objects,
                const LightSource& light,
                const Camera& camera,
                glm::ivec2 pixel,
                const PathOptions& options,
                RandomStream& random)
{
    const glm::dvec2 jitter(random.uniform2());
    const glm::dvec3 direction = camera.rayDirection(glm::dvec2(pixel) + jitter);
    const std::optional<SurfacePoint> point = objects.intersect(camera.position_m, direction);
    const IncidentLight background = light.incident(camera.position_m, direction);
    if (!point || background.distance_m < point->distance_m) return background.radiance;
    return tracePath(objects, light, *point, -direction, options, random);
}

RenderedImage develop(const std::vector<PixelSum>& sums, const Camera& camera, int samples)
{
    RenderedImage image;
    image.radiance = Image<Rgb>(camera.width, camera.height);
    image.variance = Image<float>(camera.width, camera.height);
    image.samples_per_pixel = samples;
    const double n = samples;
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const PixelSum& sum = sums[i];
        image.radiance.pixels()[i] = Rgb(sum.radiance / n);
        if (samples < 2) continue;
        const double spread = sum.luminance_squared - sum.luminance * sum.luminance / n;
        image.variance.pixels()[i] = static_cast<float>(std::max(0.0, spread) / (n * (n - 1.0)));
    }
    return image;
}

}  // namespace

Rgb tracePath(const ObjectScene& objects,
              const LightSource& light,
              const SurfacePoint& first,
              glm::dvec3 wo,
              const PathOptions& options,
              RandomStream& random)
{
    INSITU_DCHECK(options.max_bounces >= 1, "{} bounces", options.max_bounces);
    SurfacePoint point = first;
    Rgb throughput(1.0f);
    Rgb radiance = point.material.emissive;
    for (int bounce = 1;; ++bounce) {
        // Ask the light where it shines from.
        const float light_selector = random.uniform();
        const glm::vec2 light_u = random.uniform2();
        radiance += throughput * directLight(objects, light, point, wo, light_selector, light_u);

        // Ask the surface where it reflects from.
        const float bsdf_selector = random.uniform();
        const glm::vec2 bsdf_u = random.uniform2();
        const std::optional<BsdfSample> drawn =
            sampleBsdf(point.material, point.shading_normal, wo, bsdf_selector, bsdf_u);
        if (!drawn || glm::dot(point.geometric_normal, drawn->direction) <= 0.0) break;
        throughput *= drawn->weight;

        // Collect the light found there, unless an object is in front of it.
        const IncidentLight arriving = light.incident(point.position, drawn->direction);
        const std::optional<SurfacePoint> next =
            objects.intersect(objects.leave(point, drawn->direction), drawn->direction, kInfinity);
        if (!next || next->distance_m >= arriving.distance_m * kShadowReach) {
            const double weight = drawn->pdf / (drawn->pdf + arriving.pdf);
            radiance += throughput * arriving.radiance * static_cast<float>(weight);
            break;
        }
        radiance += throughput * next->material.emissive;
        if (bounce >= options.max_bounces) break;

        // Let faint paths end by chance.
        if (bounce > options.roulette_start) {
            const double chance = survival(throughput);
            if (static_cast<double>(random.uniform()) >= chance) break;
            throughput /= static_cast<float>(chance);
        }
        wo = -drawn->direction;
        point = *next;
    }
    INSITU_DCHECK(
        isFinite(radiance), "path radiance ({}, {}, {})", radiance.r, radiance.g, radiance.b);
    return radiance;
}

RenderedImage renderScene(const ObjectScene& objects,
                          const LightSource& light,
                          const Camera& camera,
                          const RenderOptions& options,
                          Progress& progress)
{
    INSITU_CHECK(options.samples_per_pixel > 0 && options.path.max_bounces >= 1,
                 "{} samples, {} bounces",
                 options.samples_per_pixel,
                 options.path.max_bounces);
    INSITU_CHECK(
        camera.width > 0 && camera.height > 0, "{}x{} pixels", camera.width, camera.height);
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    const auto width = static_cast<std::size_t>(camera.width);
    std::vector<PixelSum> sums(width * static_cast<std::size_t>(camera.height));
    int done = 0;
    bool out_of_time = false;
    while (done < options.samples_per_pixel && !out_of_time) {
        progress.checkpoint();
        parallelFor(0, camera.height, [&](std::int64_t y) {
            for (std::size_t x = 0; x < width; ++x) {
                const std::size_t pixel = static_cast<std::size_t>(y) * width + x;
                RandomStream random(options.seed, pixel, static_cast<std::uint64_t>(done));
                const Rgb sample =
                    samplePixel(objects, light, camera, {x, y}, options.path, random);
                INSITU_CHECK(isFinite(sample), "pixel ({}, {}), sample {}", x, y, done);
                const auto y_709 = static_cast<double>(luminance(sample));
                sums[pixel].radiance += glm::dvec3(sample);
                sums[pixel].luminance += y_709;
                sums[pixel].luminance_squared += y_709 * y_709;
            }
        });
        ++done;
        progress.report("rendering", static_cast<double>(done) / options.samples_per_pixel);
        const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
        out_of_time = options.max_seconds > 0.0 && seconds >= options.max_seconds &&
                      done < options.samples_per_pixel;
    }
    RenderedImage image = develop(sums, camera, done);
    image.stopped_by_time = out_of_time;
    return image;
}

}  // namespace insitu
