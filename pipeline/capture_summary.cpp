#include "pipeline/capture_summary.h"

#include "core/color.h"
#include "core/quantile.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace insitu {

namespace {

constexpr double kStepsPerStop = 4.0;
constexpr double kDeviationStepsPerStop = 2.0;
constexpr std::size_t kFewestPixels = 50;

double frameWeight(const CapturedRadiance& captured, std::size_t frame, int channel, double level)
{
    const ResponseCurve& response = captured.response;
    const double exposure = level * captured.frames[frame].used_exposure;
    const auto& table = response.exposure[static_cast<std::size_t>(channel)];
    if (exposure >= table[255]) return 0.0;
    const double code = response.encode(channel, exposure);
    if (code > 255.0 * captured.clip_fraction) return 0.0;
    if (frame > 0 && code < 255.0 * captured.black_fraction) return 0.0;
    const double t = captured.frames[frame].used_exposure;
    const double variance = captured.merged.noise.variance(response, channel, code);
    return variance > 0.0 ? t * t / variance : 0.0;
}

}  // namespace

WeightCurve mergeWeights(const CapturedRadiance& captured, int channel)
{
    WeightCurve curve;
    if (captured.frames.empty()) return curve;
    const auto& table = captured.response.exposure[static_cast<std::size_t>(channel)];
    constexpr double kLowestCode = 1.0;
    const double darkest =
        captured.response.decode(channel, kLowestCode) / captured.frames.front().used_exposure;
    const double brightest = table[255] / captured.frames.back().used_exposure;
    const double first = std::floor(std::log2(std::max(darkest, brightest * 0x1p-30)));
    const auto steps =
        static_cast<int>(std::ceil((std::log2(brightest) - first) * kStepsPerStop)) + 1;
    curve.weight.resize(captured.frames.size());
    for (int i = 0; i < steps; ++i) {
        const double level = std::exp2(first + i / kStepsPerStop);
        curve.radiance.push_back(level);
        double sum = 0.0;
        for (std::size_t k = 0; k < captured.frames.size(); ++k) {
            curve.weight[k].push_back(frameWeight(captured, k, channel, level));
            sum += curve.weight[k].back();
        }
        for (auto& weight : curve.weight)
            if (sum > 0.0) weight.back() /= sum;
    }
    return curve;
}

std::vector<DeviationStep> mergedDeviations(const MergeResult& merged)
{
    std::map<int, std::vector<double>> by_step;
    const auto pixels = merged.radiance.pixels.pixels();
    // A megapixel tells as much as all of them.
    const std::size_t stride = 1 + pixels.size() / 1'000'000;
    for (std::size_t i = 0; i < pixels.size(); i += stride) {
        const double level = luminance(pixels[i]);
        if (!(level > 0.0) || (merged.validity.pixels()[i] & kMergeClipped) != 0) continue;
        double variance = 0.0;
        for (int c = 0; c < 3; ++c) {
            const double weight = kLuminanceWeights[static_cast<std::size_t>(c)];
            variance += weight * weight * merged.variance.pixels()[i][c];
        }
        const int step = static_cast<int>(std::floor(std::log2(level) * kDeviationStepsPerStop));
        by_step[step].push_back(std::sqrt(variance) / level);
    }
    std::vector<DeviationStep> steps;
    for (auto& [step, values] : by_step) {
        if (values.size() < kFewestPixels) continue;
        steps.push_back({std::exp2((step + 0.5) / kDeviationStepsPerStop),
                         quantile(values, 0.1),
                         quantile(values, 0.5),
                         quantile(values, 0.9),
                         values.size() * stride});
    }
    return steps;
}

}  // namespace insitu
