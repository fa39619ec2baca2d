#include "render/reference_renderer.h"

#include "core/color.h"
#include "core/parallel.h"
#include "lighting/see_through.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

/// Samples between two looks at a pixel's error.
constexpr int kBatch = 8;

/// Receivers may be this much noisier than the target: their neighbours are averaged afterwards,
/// which takes a factor of ten and more.
constexpr double kReceiverSlack = 3.0;

/// Sums of one pixel's samples.
struct PixelSums {
    int count = 0;
    int covered = 0;
    glm::dvec3 object{0.0};
    double object_square = 0.0;  ///< of luminance
    double depth = kInfinity;
    int receivers = 0;
    glm::dvec3 without{0.0};
    glm::dvec3 with{0.0};
    double without_square = 0.0;  ///< of luminance
    double change = 0.0;          ///< luminance of with − without
    double change_square = 0.0;
    std::int32_t surface = -1;  ///< the face most recently seen; one a pixel but at edges
    glm::dvec3 probe{0.0};
    int probe_count = 0;

    /// Variance of the mean of the object's luminance.
    [[nodiscard]] double objectVariance() const
    {
        if (count < 2) return 0.0;
        const double mean = static_cast<double>(luminance(Rgb(object))) / count;
        return std::max(0.0, object_square / count - mean * mean) / (count - 1);
    }
    [[nodiscard]] double withoutVariance() const
    {
        if (receivers < 2) return 0.0;
        const double mean = static_cast<double>(luminance(Rgb(without))) / receivers;
        return std::max(0.0, without_square / receivers - mean * mean) / (receivers - 1);
    }
    [[nodiscard]] double changeVariance() const
    {
        if (receivers < 2) return 0.0;
        const double mean = change / receivers;
        return std::max(0.0, change_square / receivers - mean * mean) / (receivers - 1);
    }
    /// Variance of the mean change over the mean irradiance.
    [[nodiscard]] double ratioVariance() const
    {
        const double base = luminance(Rgb(without));
        if (receivers < 2 || !(base > 0.0)) return 0.0;
        const double mean_base = base / receivers;
        return changeVariance() / (mean_base * mean_base);
    }
    [[nodiscard]] bool quiet(double target) const
    {
        const double object_mean = static_cast<double>(luminance(Rgb(object))) / count;
        const double scale = std::max(object_mean, 1e-12);
        const double ratio_target = kReceiverSlack * target;
        return ratioVariance() <= ratio_target * ratio_target &&
               objectVariance() <= target * target * scale * scale;
    }
};

class PixelSampler {
public:
    PixelSampler(const Camera& camera,
                 const RoomWithObjects& scene,
                 const InsertionOptions& options)
        : camera_(camera), scene_(scene), options_(options)
    {
    }

    void add(int x, int y, PixelSums& sums) const
    {
        const std::uint64_t pixel = static_cast<std::uint64_t>(y) * camera_.width + x;
        RandomStream random(options_.seed, pixel, static_cast<std::uint64_t>(sums.count));
        const glm::vec2 jitter = random.uniform2();
        const glm::dvec3 direction = camera_.rayDirection(
            {x + static_cast<double>(jitter.x), y + static_cast<double>(jitter.y)});
        const RoomLight& room = scene_.room();
        const auto surface = room.seesThrough(x, y)
                                 ? intersectBehindBoxes(room.proxy(), camera_.position_m, direction)
                                 : room.proxy().intersect(camera_.position_m, direction);
        const auto point = scene_.objects().intersect(
            camera_.position_m, direction, surface ? surface->distance_m : kInfinity);
        ++sums.count;
        if (point) {
            const glm::dvec3 radiance(
                scene_.sampleObject(*point, -direction, options_.path, random));
            const double value = luminance(Rgb(radiance));
            sums.object += radiance;
            sums.object_square += value * value;
            sums.depth = std::min(sums.depth, point->distance_m);
            ++sums.covered;
            return;
        }
        if (!surface || surface->opening) return;
        ReceiverSample drawn =
            scene_.sampleReceiver(surface->point, surface->normal, options_.path, random);
        const glm::dvec3 scale(room.irradianceScale(surface->face, surface->uv));
        const glm::dvec3 corrected = scale * drawn.without;
        drawn.with += corrected - drawn.without;
        drawn.without = corrected;
        const double change = luminance(Rgb(drawn.with - drawn.without));
        const double base = luminance(Rgb(drawn.without));
        sums.surface = static_cast<std::int32_t>(surface->face);
        sums.without += drawn.without;
        sums.without_square += base * base;
        sums.with += drawn.with;
        sums.change += change;
        sums.change_square += change * change;
        ++sums.receivers;
        const Rgb probe = room.probeRadiance(surface->face, surface->uv);
        if (probe != Rgb(0.0f)) {
            sums.probe += glm::dvec3(probe);
            ++sums.probe_count;
        }
    }

private:
    const Camera& camera_;
    const RoomWithObjects& scene_;
    const InsertionOptions& options_;
};

/// Pixels that need more samples: the noisy ones and those around them, since a pixel may seem
/// quiet because it drew no light by chance. All of them when the target is negative.
Image<std::uint8_t> noisyPixels(const std::vector<PixelSums>& sums,
                                int width,
                                int height,
                                double target)
{
    constexpr int kReach = 2;
    if (target < 0.0) return Image<std::uint8_t>(width, height, 1);
    Image<std::uint8_t> noisy(width, height);
    for (std::size_t i = 0; i < sums.size(); ++i)
        noisy.pixels()[i] = !sums[i].quiet(target);
    Image<std::uint8_t> grown(width, height);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x)
            for (int qy = std::max(0, y - kReach); qy <= std::min(height - 1, y + kReach); ++qy)
                for (int qx = std::max(0, x - kReach); qx <= std::min(width - 1, x + kReach); ++qx)
                    grown(x, y) |= noisy(qx, qy);
    });
    return grown;
}

void store(const PixelSums& sums, int x, int y, RenderLayers& layers)
{
    layers.object(x, y) = Rgb(sums.object / static_cast<double>(sums.count));
    layers.alpha(x, y) = static_cast<float>(sums.covered) / static_cast<float>(sums.count);
    layers.depth_m(x, y) = sums.covered > 0 ? static_cast<float>(sums.depth) : 0.0f;
    layers.object_variance(x, y) = static_cast<float>(sums.objectVariance());
    if (sums.probe_count > 0)
        layers.probe_radiance(x, y) = Rgb(sums.probe / static_cast<double>(sums.probe_count));
}

/// Irradiances of all receivers, smoothed as far as their noise allows; the change by itself, so
/// that a shadow's edge is not taken for noise of the light around it.
void storeIrradiance(const std::vector<PixelSums>& sums,
                     const IrradianceFilterOptions& filter,
                     RenderLayers& layers)
{
    const int width = layers.alpha.width();
    const int height = layers.alpha.height();
    Image<Rgb> without(width, height);
    Image<Rgb> change(width, height);
    Image<float> without_variance(width, height);
    Image<float> change_variance(width, height);
    Image<std::int32_t> surface(width, height, -1);
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const PixelSums& pixel = sums[i];
        // A pixel that is nearly all window and only just touches the wall has no irradiance to
        // tell.
        if (pixel.receivers == 0 || (pixel.covered == 0 && 4 * pixel.receivers < pixel.count))
            continue;
        const double n = pixel.receivers;
        surface.pixels()[i] = pixel.surface;
        without.pixels()[i] = Rgb(pixel.without / n);
        change.pixels()[i] = Rgb((pixel.with - pixel.without) / n);
        without_variance.pixels()[i] = static_cast<float>(pixel.withoutVariance());
        change_variance.pixels()[i] = static_cast<float>(pixel.changeVariance());
    }
    filterIrradiance(without, without_variance, surface, filter);
    filterIrradiance(change, change_variance, surface, filter);
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const Rgb base = without.pixels()[i];
        const float level = luminance(base);
        layers.irradiance_without.pixels()[i] = base;
        layers.irradiance_with.pixels()[i] = glm::max(base + change.pixels()[i], Rgb(0.0f));
        if (level > 0.0f)
            layers.ratio_variance.pixels()[i] = change_variance.pixels()[i] / (level * level);
    }
}

}  // namespace

InsertionResult renderReference(const Camera& camera,
                                const RoomLight& room,
                                const ObjectScene& objects,
                                const InsertionOptions& options,
                                Progress& progress)
{
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    const auto outOfTime = [&] {
        return options.max_seconds > 0.0 &&
               std::chrono::duration<double>(Clock::now() - start).count() > options.max_seconds;
    };
    const RoomWithObjects scene(room, objects, options.interreflection, progress);
    const PixelSampler sampler(camera, scene, options);

    // All pixels take their fewest samples, whatever the time limit; then those that are still
    // noisy go on, pass by pass, until they are done or time is up.
    const int width = camera.width;
    const int height = camera.height;
    std::vector<PixelSums> sums(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    InsertionResult result;
    std::atomic<bool> cut_short = false;
    int reached = 0;
    while (reached < options.max_samples) {
        const int goal = std::min(
            options.max_samples,
            reached == 0 ? options.min_samples : std::max(reached + kBatch, reached * 5 / 4));
        const Image<std::uint8_t> active =
            noisyPixels(sums, width, height, reached == 0 ? -1.0 : options.target_error);
        parallelFor(0, height, [&](std::int64_t y) {
            if (reached > 0 && outOfTime()) cut_short = true;
            if (progress.cancelled() || cut_short) return;
            for (int x = 0; x < width; ++x) {
                if (!active(x, static_cast<int>(y))) continue;
                PixelSums& pixel = sums[static_cast<std::size_t>(y * width + x)];
                while (pixel.count < goal)
                    sampler.add(x, static_cast<int>(y), pixel);
            }
        });
        progress.checkpoint();
        result.stopped_by_time = cut_short || (outOfTime() && goal < options.max_samples);
        reached = goal;
        progress.report("render", static_cast<double>(reached) / options.max_samples);
        if (result.stopped_by_time) break;
    }

    result.layers = emptyLayers(width, height);
    double samples = 0.0;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const PixelSums& pixel = sums[static_cast<std::size_t>(y) * width + x];
            store(pixel, x, y, result.layers);
            samples += pixel.count;
        }
    }
    storeIrradiance(sums, options.filter, result.layers);
    double variance = 0.0;
    double receivers = 0.0;
    for (std::size_t i = 0; i < sums.size(); ++i) {
        if (sums[i].receivers == 0) continue;
        variance += result.layers.ratio_variance.pixels()[i];
        receivers += 1.0;
    }
    result.mean_samples = samples / (static_cast<double>(width) * height);
    result.ratio_error = receivers > 0.0 ? std::sqrt(variance / receivers) : 0.0;
    return result;
}

std::vector<PixelEstimate> referencePixels(const Camera& camera,
                                           const RoomLight& room,
                                           const ObjectScene& objects,
                                           const InsertionOptions& options,
                                           std::span<const glm::ivec2> pixels,
                                           int samples,
                                           Progress& progress)
{
    const RoomWithObjects scene(room, objects, options.interreflection, progress);
    const PixelSampler sampler(camera, scene, options);
    std::vector<PixelEstimate> estimates(pixels.size());
    parallelFor(0, static_cast<std::int64_t>(pixels.size()), [&](std::int64_t number) {
        const std::size_t i = static_cast<std::size_t>(number);
        PixelSums sums;
        while (sums.count < samples && !progress.cancelled())
            sampler.add(pixels[i].x, pixels[i].y, sums);
        PixelEstimate& estimate = estimates[i];
        if (sums.covered > 0) {
            const double share = static_cast<double>(sums.covered) / sums.count;
            estimate.object = luminance(Rgb(sums.object / static_cast<double>(sums.covered)));
            estimate.object_variance = sums.objectVariance() / (share * share);
        }
        const double base = luminance(Rgb(sums.without));
        if (sums.receivers > 0 && base > 0.0) {
            estimate.change = sums.change / base;
            estimate.change_variance = sums.ratioVariance();
        }
    });
    progress.checkpoint();
    return estimates;
}

}  // namespace insitu
