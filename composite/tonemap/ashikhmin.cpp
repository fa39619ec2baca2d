#include "composite/tonemap/ashikhmin.h"

#include "composite/tonemap/line_steps.h"
#include "composite/tonemap/neighbourhood_kernel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

// [Ashikhmin02] 3.1: three corners of the threshold, and between them its values and slopes.
constexpr double kDarkEnd = 0.0034;
constexpr double kRootEnd = 1.0;
constexpr double kWeberStart = 7.2444;
constexpr double kDarkThreshold = 0.0014;
constexpr double kMiddleThreshold = 0.4027;
constexpr double kWeberFraction = 0.0556;
constexpr double kCapacityDark = 2.4483;
constexpr double kCapacityMiddle = 16.5630;
constexpr double kCapacityWeber = 32.0693;

/// A scene without range.
constexpr float kMiddleGrey = 0.18f;

/// Everything that the curve's loop needs.
struct Curve {
    float white = 0.0f;             ///< cd/m²
    float white_inverse = 0.0f;     ///< 1 / white
    float black_capacity = 0.0f;    ///< C(Lmin)
    float steps_to_display = 0.0f;  ///< white / (C(Lmax) - C(Lmin))
};

INSITU_KERNEL float thresholdOf(float l)
{
    const float dim = l < static_cast<float>(kDarkEnd) ? static_cast<float>(kDarkThreshold)
                                                       : static_cast<float>(kMiddleThreshold) * l;
    const float bright = l < static_cast<float>(kWeberStart)
                             ? static_cast<float>(kMiddleThreshold)
                             : static_cast<float>(kWeberFraction) * l;
    return l < static_cast<float>(kRootEnd) ? dim : bright;
}

INSITU_KERNEL float capacityOf(float l, float dark_log, float weber_log)
{
    const float log = tonemap::logOf(l);
    const float dark = l * static_cast<float>(1.0 / kDarkThreshold);
    const float root = static_cast<float>(kCapacityDark) +
                       (log - dark_log) * static_cast<float>(1.0 / kMiddleThreshold);
    const float middle = static_cast<float>(kCapacityMiddle) +
                         (l - 1.0f) * static_cast<float>(1.0 / kMiddleThreshold);
    const float weber = static_cast<float>(kCapacityWeber) +
                        (log - weber_log) * static_cast<float>(1.0 / kWeberFraction);
    const float dim = l < static_cast<float>(kDarkEnd) ? dark : root;
    const float bright = l < static_cast<float>(kWeberStart) ? middle : weber;
    return l < static_cast<float>(kRootEnd) ? dim : bright;
}

struct CurveLine {
    const Curve& curve;
    const float* luminance;
    const float* adapted;
    float* display;
    std::ptrdiff_t count;
};

INSITU_KERNEL void applyAny(const CurveLine& line)
{
    const Curve c = line.curve;
    const auto dark_log = static_cast<float>(std::log(kDarkEnd));
    const auto weber_log = static_cast<float>(std::log(kWeberStart));
    const float* const luminance = line.luminance;
    const float* const adapted = line.adapted;
    float* __restrict const display = line.display;
    for (std::ptrdiff_t i = 0; i < line.count; ++i) {
        const float la = adapted[i];
        const float steps = capacityOf(la, dark_log, weber_log) - c.black_capacity;
        const float base = std::max(steps, 0.0f) * c.steps_to_display;
        const float gain = thresholdOf(base) / thresholdOf(la);
        const float shown = base + gain * (luminance[i] - la);
        display[i] = std::min(std::max(shown * c.white_inverse, 0.0f), 1.0f);
    }
}

void applyBase(const CurveLine& line)
{
    applyAny(line);
}
#if defined(__x86_64__)
INSITU_TARGET_AVX2 void applyAvx2(const CurveLine& line)
{
    applyAny(line);
}
INSITU_TARGET_AVX512 void applyAvx512(const CurveLine& line)
{
    applyAny(line);
}
#endif

class CapacityCurve : public ToneCurve {
public:
    CapacityCurve(const ViewingOptions& viewing, const SceneStatistics& statistics)
        : scale_(static_cast<float>(viewing.scale(statistics)))
    {
        const double black = perceptualCapacity(viewing.scale(statistics) * statistics.smallest);
        const double range =
            perceptualCapacity(viewing.scale(statistics) * statistics.largest) - black;
        curve_.white = static_cast<float>(viewing.display_white_cd_m2);
        curve_.white_inverse = static_cast<float>(1.0 / viewing.display_white_cd_m2);
        curve_.black_capacity = static_cast<float>(black);
        has_range_ = range > 0.0;
        if (has_range_)
            curve_.steps_to_display = static_cast<float>(viewing.display_white_cd_m2 / range);
    }

    [[nodiscard]] float scale() const override { return scale_; }

    void apply(const float* luminance,
               const float* adapted,
               float* display,
               std::ptrdiff_t count) const override
    {
        if (!has_range_) {
            std::fill_n(display, count, kMiddleGrey);
            return;
        }
        const CurveLine line{curve_, luminance, adapted, display, count};
#if defined(__x86_64__)
        const InstructionSet set = bestInstructionSet();
        if (set == InstructionSet::Avx512) return applyAvx512(line);
        if (set == InstructionSet::Avx2) return applyAvx2(line);
#endif
        applyBase(line);
    }

private:
    Curve curve_;
    float scale_;
    bool has_range_ = false;
};

class UniformNeighbourhood : public LocalAdaptation {
public:
    explicit UniformNeighbourhood(double threshold) : threshold_(static_cast<float>(threshold)) {}

    [[nodiscard]] int halo() const override { return tonemap::kNeighbourhoodHalo; }
    void adapt(const LuminancePatch& patch,
               const WantedBlocks& blocks,
               float* adapted) const override
    {
        tonemap::adaptToNeighbourhood(bestInstructionSet(), patch, blocks, threshold_, adapted);
    }

private:
    float threshold_;
};

class Ashikhmin : public SeparableOperator {
public:
    explicit Ashikhmin(const AshikhminOptions& options) : options_(options) {}

    [[nodiscard]] std::unique_ptr<ToneCurve> curve(const SceneStatistics& statistics) const override
    {
        return std::make_unique<CapacityCurve>(options_.viewing, statistics);
    }
    [[nodiscard]] std::unique_ptr<LocalAdaptation> local() const override
    {
        return std::make_unique<UniformNeighbourhood>(options_.contrast_threshold);
    }

private:
    AshikhminOptions options_;
};

}  // namespace

double visibleThreshold(double luminance)
{
    if (luminance < kDarkEnd) return kDarkThreshold;
    if (luminance < kRootEnd) return kMiddleThreshold * luminance;
    if (luminance < kWeberStart) return kMiddleThreshold;
    return kWeberFraction * luminance;
}

double perceptualCapacity(double luminance)
{
    if (luminance < kDarkEnd) return luminance / kDarkThreshold;
    if (luminance < kRootEnd)
        return kCapacityDark + std::log(luminance / kDarkEnd) / kMiddleThreshold;
    if (luminance < kWeberStart) return kCapacityMiddle + (luminance - 1.0) / kMiddleThreshold;
    return kCapacityWeber + std::log(luminance / kWeberStart) / kWeberFraction;
}

double ViewingOptions::scale(const SceneStatistics& statistics) const
{
    if (scene_white_cd_m2) return *scene_white_cd_m2;
    return statistics.log_average > 0.0 ? kUnknownLogAverage / statistics.log_average : 1.0;
}

Findings ViewingOptions::validate() const
{
    Findings findings;
    const auto require = [&](double value, const char* code, const char* what) {
        if (!std::isfinite(value) || value <= 0.0)
            findings.push_back(
                {Severity::Error,
                 code,
                 fmt::format(
                     "the luminance of {} is {} cd/m²; give a number above 0", what, value)});
    };
    require(scene_white_cd_m2.value_or(1.0), "tonemap-scene-white", "scene value 1");
    require(display_white_cd_m2, "tonemap-display-white", "the display's white");
    return findings;
}

Findings AshikhminOptions::validate() const
{
    Findings findings = viewing.validate();
    if (!(contrast_threshold > 0.0 && contrast_threshold < 1.0))
        findings.push_back(
            {Severity::Error,
             "tonemap-contrast-threshold",
             fmt::format("the contrast threshold is {}; give a number between 0 and 1",
                         contrast_threshold)});
    return findings;
}

std::unique_ptr<SeparableOperator> makeAshikhmin(const AshikhminOptions& options)
{
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<Ashikhmin>(options);
}

}  // namespace insitu
