#include "composite/tonemap/histogram_adjustment.h"

#include "composite/tonemap/acuity_pyramid.h"
#include "composite/tonemap/eye_model.h"
#include "composite/tonemap/foveal_image.h"
#include "composite/tonemap/histogram_curve.h"
#include "composite/tonemap/line_steps.h"
#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>
#include <span>

namespace insitu {

namespace {

using tonemap::AcuityPyramid;
using tonemap::HistogramCurve;

/// What a place of the foveal image tells the pixels around it.
struct Place {
    Rgb veil{0.0f};      ///< scattered light, already times its share
    float level = 0.0f;  ///< of the pyramid
};

Place mix(const Place& a, const Place& b, float share)
{
    return {a.veil + share * (b.veil - a.veil), a.level + share * (b.level - a.level)};
}

/// Position of pixel `i` of `pixels` among `places`: index, and share of the next.
struct Between {
    int index;
    int next;
    float share;
};
Between between(int i, int pixels, int places)
{
    const float position = std::clamp(
        (static_cast<float>(i) + 0.5f) * static_cast<float>(places) / static_cast<float>(pixels) -
            0.5f,
        0.0f,
        static_cast<float>(places - 1));
    const int index = static_cast<int>(position);
    return {index, std::min(index + 1, places - 1), position - static_cast<float>(index)};
}

/// Display luminance over luminance, from the curve; below its first point a straight line to
/// black.
class Gain {
public:
    explicit Gain(const HistogramCurve& curve)
        : curve_(curve.display),
          first_(static_cast<float>(curve.log_first)),
          per_log_(static_cast<float>(1.0 / curve.log_step)),
          last_(static_cast<float>(curve.display.size() - 1)),
          darkest_(curve.display.front() / std::exp(first_))
    {
    }
    [[nodiscard]] float of(float luminance) const
    {
        const float log = tonemap::logOf(luminance);
        if (!(luminance > 0.0f) || log <= first_) return darkest_;
        const float position = std::min((log - first_) * per_log_, last_);
        const auto i = static_cast<std::size_t>(std::min(position, last_ - 1.0f));
        const float share = position - static_cast<float>(i);
        return (curve_[i] + share * (curve_[i + 1] - curve_[i])) / luminance;
    }

private:
    std::span<const float> curve_;
    float first_, per_log_, last_, darkest_;
};

/// Luminance from which on the eye resolves this many cycles per degree; infinite when it never
/// does.
float resolvingLuminance(double cycles_per_degree)
{
    double low = -12.0;
    double high = 12.0;
    if (acuity(std::pow(10.0, high)) < cycles_per_degree)
        return std::numeric_limits<float>::infinity();
    for (int step = 0; step < 60; ++step) {
        const double middle = 0.5 * (low + high);
        (acuity(std::pow(10.0, middle)) < cycles_per_degree ? low : high) = middle;
    }
    return static_cast<float>(std::pow(10.0, high));
}

/// Below it not all is seen by cones.
constexpr float kCones = 5.6f;

/// Cones fade out and rods, which see no colour, take over.
Rgb mesopic(const Rgb& color)
{
    const auto cones = static_cast<float>(coneShare(static_cast<double>(luminance(color))));
    return cones * color + (1.0f - cones) * Rgb(static_cast<float>(scotopicLuminance(color)));
}

/// One frame's observer.
struct Observer {
    Image<Place> places;
    HistogramCurve curve;
    float direct = 1.0f;   ///< share of the light that does not scatter
    float scale = 1.0f;    ///< to cd/m²
    float deepest = 0.0f;  ///< level of the pyramid
};

/// The veil's kernel of the last size that was asked for: frames share it.
class KeptKernel {
public:
    [[nodiscard]] std::shared_ptr<const tonemap::VeilKernel> of(const Image<Rgb>& foveal)
    {
        const std::lock_guard lock(mutex_);
        if (!kernel_ || !kernel_->isFor(foveal))
            kernel_ = std::make_shared<const tonemap::VeilKernel>(foveal.width(), foveal.height());
        return kernel_;
    }

private:
    std::mutex mutex_;
    std::shared_ptr<const tonemap::VeilKernel> kernel_;
};

class HistogramMapping : public SceneMapping {
public:
    HistogramMapping(const HistogramAdjustmentOptions& options,
                     std::shared_ptr<KeptKernel> kernels,
                     int width,
                     int height,
                     const SceneStatistics& statistics)
        : options_(options),
          kernels_(std::move(kernels)),
          width_(width),
          foveal_(width, height, options.field_of_view_deg * std::numbers::pi / 180.0)
    {
        observer_.scale = static_cast<float>(options_.viewing.scale(statistics));
    }

    [[nodiscard]] int passes() const override { return 1; }
    void gather(int /*pass*/, const SceneStrip& strip) override { foveal_.add(strip); }
    void endPass(int /*pass*/) override { observe(foveal_.image()); }

    /// The pyramid's levels are looked up a place of theirs to each side.
    [[nodiscard]] int reach() const override { return levels() > 0 ? 2 * alignment() : 0; }
    [[nodiscard]] int alignment() const override { return 1 << levels(); }
    void map(const SceneStrip& strip,
             int top,
             Image<Rgb>& display,
             Progress& progress) const override
    {
        const AcuityPyramid pyramid(strip, levels());
        progress.checkpoint();
        std::vector<Between> across;
        for (int x = 0; x < strip.width(); ++x)
            across.push_back(between(x, strip.width(), observer_.places.width()));
        const Gain gain(observer_.curve);
        parallelFor(0, display.height(), [&](std::int64_t row) {
            mapRow(pyramid,
                   strip,
                   across,
                   gain,
                   top + static_cast<int>(row),
                   display.row(static_cast<int>(row)));
        });
    }

private:
    [[nodiscard]] int levels() const { return static_cast<int>(std::ceil(observer_.deepest)); }

    void observe(Image<Rgb> foveal)
    {
        Observer& observer = observer_;
        for (Rgb& place : foveal.pixels())
            place *= observer.scale;
        observer.places = Image<Place>(foveal.width(), foveal.height());
        if (options_.veil) {
            observer.direct = 1.0f - tonemap::kScattered;
            const auto kernel = kernels_->of(foveal);
            const Image<Rgb> veil = kernel->veil(foveal);
            for (std::size_t i = 0; i < foveal.pixelCount(); ++i) {
                observer.places.pixels()[i].veil = tonemap::kScattered * veil.pixels()[i];
                foveal.pixels()[i] =
                    observer.direct * foveal.pixels()[i] + observer.places.pixels()[i].veil;
            }
        }
        // Equation 5.3: what the picture itself resolves in the middle, cycles per degree.
        const double resolved = 0.5 * width_ / options_.field_of_view_deg;
        const float sharp = resolvingLuminance(resolved);
        std::vector<float> adaptation(foveal.pixelCount());
        parallelFor(0, foveal.height(), [&](std::int64_t row) {
            for (int x = 0; x < foveal.width(); ++x) {
                const int y = static_cast<int>(row);
                const float light = luminance(foveal(x, y));
                adaptation[static_cast<std::size_t>(y) * static_cast<std::size_t>(foveal.width()) +
                           static_cast<std::size_t>(x)] = light;
                if (!options_.acuity || light >= sharp) continue;
                const double level = std::log2(resolved / acuity(static_cast<double>(light)));
                observer.places(x, y).level = static_cast<float>(std::max(0.0, level));
            }
        });
        for (const Place& place : observer.places.pixels())
            observer.deepest = std::max(observer.deepest, place.level);
        observer.curve = tonemap::histogramCurve(
            adaptation, options_.display_black_cd_m2, options_.viewing.display_white_cd_m2);
    }

    void mapRow(const AcuityPyramid& pyramid,
                const SceneStrip& scene,
                std::span<const Between> across,
                const Gain& gain,
                int y,
                std::span<Rgb> display) const
    {
        const Observer& observer = observer_;
        const Image<Place>& places = observer.places;
        const Between down = between(y, scene.height, places.height());
        std::vector<Place> line(static_cast<std::size_t>(places.width()));
        for (int i = 0; i < places.width(); ++i)
            line[static_cast<std::size_t>(i)] =
                mix(places(i, down.index), places(i, down.next), down.share);
        const auto pixels = scene.row(y);
        for (std::size_t x = 0; x < across.size(); ++x) {
            const Place place = mix(line[static_cast<std::size_t>(across[x].index)],
                                    line[static_cast<std::size_t>(across[x].next)],
                                    across[x].share);
            const Rgb light = place.level > 0.0f
                                  ? pyramid.sample(static_cast<int>(x), y, place.level)
                                  : pixels[x];
            Rgb color = observer.direct * observer.scale * light + place.veil;
            float level = luminance(color);
            if (options_.color && level < kCones) {
                color = mesopic(color);
                level = luminance(color);
            }
            display[x] = glm::min(color * gain.of(level), Rgb(1.0f));
        }
    }

    HistogramAdjustmentOptions options_;
    std::shared_ptr<KeptKernel> kernels_;
    int width_;
    tonemap::FovealImage foveal_;
    Observer observer_;
};

class HistogramAdjustment : public ToneMapOperator {
public:
    explicit HistogramAdjustment(const HistogramAdjustmentOptions& options) : options_(options) {}

    [[nodiscard]] std::unique_ptr<SceneMapping> begin(
        int width, int height, const SceneStatistics& statistics) const override
    {
        return std::make_unique<HistogramMapping>(options_, kernels_, width, height, statistics);
    }

private:
    HistogramAdjustmentOptions options_;
    std::shared_ptr<KeptKernel> kernels_ = std::make_shared<KeptKernel>();
};

}  // namespace

Findings HistogramAdjustmentOptions::validate() const
{
    Findings findings = viewing.validate();
    if (!(display_black_cd_m2 > 0.0 && display_black_cd_m2 < viewing.display_white_cd_m2))
        findings.push_back(
            {Severity::Error,
             "tonemap-display-black",
             fmt::format("the display's black is {} cd/m²; give a number above 0 and below its "
                         "white, {}",
                         display_black_cd_m2,
                         viewing.display_white_cd_m2)});
    if (!(field_of_view_deg > 0.0 && field_of_view_deg <= 170.0))
        findings.push_back({Severity::Error,
                            "tonemap-field-of-view",
                            fmt::format("the field of view is {} degrees; give a number above 0 "
                                        "and up to 170",
                                        field_of_view_deg)});
    return findings;
}

std::unique_ptr<ToneMapOperator> makeHistogramAdjustment(const HistogramAdjustmentOptions& options)
{
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<HistogramAdjustment>(options);
}

}  // namespace insitu
