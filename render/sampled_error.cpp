#include "render/sampled_error.h"

#include "core/color.h"
#include "render/reference_renderer.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kPixels = 256;
constexpr int kSamples = 128;
/// Receivers farther away whose light changes less are left out: they would make any error look
/// small.
constexpr float kLeastChange = 0.01f;
/// Of the inter-reflection, whose noise the sampled pixels share.
constexpr int kSamplesPerCell = 24;
/// One-sided 95 % of a normal distribution.
constexpr double kSigmas = 1.645;

float changeOf(const RenderLayers& layers, std::size_t i)
{
    const float base = luminance(layers.irradiance_without.pixels()[i]);
    return base > 0.0f ? luminance(layers.irradiance_with.pixels()[i]) / base - 1.0f : 0.0f;
}

/// Pixels around the objects, as far as these are wide and high.
struct PixelBox {
    glm::ivec2 min{0};
    glm::ivec2 max{-1};

    [[nodiscard]] bool holds(int pixel, int width) const
    {
        const int x = pixel % width;
        const int y = pixel / width;
        return x >= min.x && x <= max.x && y >= min.y && y <= max.y;
    }
};
PixelBox aroundObjects(const Image<float>& alpha)
{
    PixelBox box{{alpha.width(), alpha.height()}, {-1, -1}};
    for (int y = 0; y < alpha.height(); ++y)
        for (int x = 0; x < alpha.width(); ++x)
            if (alpha(x, y) > 0.0f)
                box = {glm::min(box.min, glm::ivec2(x, y)), glm::max(box.max, glm::ivec2(x, y))};
    if (box.max.x < 0) return {};
    const glm::ivec2 size = (box.max - box.min + 1) / 2;
    return {box.min - size, box.max + size};
}

}  // namespace

SampledError sampleError(const Camera& camera,
                         const RoomLight& room,
                         const ObjectScene& objects,
                         const InsertionOptions& options,
                         const RenderLayers& layers,
                         Progress& progress)
{
    // Pixels that count; edges, where both are seen, do not. Receivers around the objects count
    // whatever the layers say, since a shadow that is missing must be seen to be missing.
    const PixelBox around = aroundObjects(layers.alpha);
    std::vector<std::size_t> changed;
    double level = 0.0;
    std::size_t covered = 0;
    for (std::size_t i = 0; i < layers.alpha.pixelCount(); ++i) {
        const float alpha = layers.alpha.pixels()[i];
        if (alpha == 1.0f) {
            level += luminance(layers.object.pixels()[i]);
            ++covered;
        }
        const bool receives =
            alpha == 0.0f && luminance(layers.irradiance_without.pixels()[i]) > 0.0f;
        if (alpha == 1.0f || (receives && (around.holds(static_cast<int>(i), camera.width) ||
                                           std::abs(changeOf(layers, i)) > kLeastChange)))
            changed.push_back(i);
    }
    if (changed.empty()) return {};
    level /= static_cast<double>(std::max<std::size_t>(covered, 1));

    RandomStream random(options.seed, 0, 0);
    std::vector<std::size_t> chosen;
    std::vector<glm::ivec2> pixels;
    for (int k = 0; k < kPixels; ++k) {
        chosen.push_back(changed[random.below(static_cast<std::uint32_t>(changed.size()))]);
        const int at = static_cast<int>(chosen.back());
        pixels.emplace_back(at % camera.width, at / camera.width);
    }
    InsertionOptions sampling = options;
    sampling.interreflection.enabled = true;
    sampling.interreflection.rounds = std::min(options.interreflection.rounds, 1);
    sampling.interreflection.samples_per_cell =
        std::min(options.interreflection.samples_per_cell, kSamplesPerCell);
    const std::vector<PixelEstimate> truth =
        referencePixels(camera, room, objects, sampling, pixels, kSamples, progress);

    double sum = 0.0;
    double square = 0.0;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
        const std::size_t i = chosen[k];
        double difference = 0.0;
        double noise = 0.0;
        if (layers.alpha.pixels()[i] == 1.0f) {
            if (!(level > 0.0)) continue;
            difference = (luminance(layers.object.pixels()[i]) - truth[k].object) / level;
            noise = truth[k].object_variance / (level * level);
        } else {
            difference = changeOf(layers, i) - truth[k].change;
            noise = truth[k].change_variance;
        }
        const double excess = difference * difference - noise;
        sum += excess;
        square += excess * excess;
    }
    const double n = static_cast<double>(chosen.size());
    const double mean = sum / n;
    const double deviation = std::sqrt(std::max(0.0, square / n - mean * mean) / (n - 1.0));
    return {kPixels,
            std::sqrt(std::max(0.0, mean)),
            std::sqrt(std::max(0.0, mean + kSigmas * deviation))};
}

}  // namespace insitu
