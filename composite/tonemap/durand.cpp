#include "composite/tonemap/durand.h"

#include "composite/tonemap/bilateral_grid.h"
#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace insitu {

namespace {

/// What saves black pixels from the logarithm, as a share of the mean luminance.
constexpr double kDelta = 1e-6;

class DurandMapping : public SceneMapping {
public:
    DurandMapping(const DurandOptions& options,
                  int width,
                  int height,
                  const SceneStatistics& statistics)
        : options_(options),
          delta_(kDelta * statistics.mean),
          black_(statistics.largest == 0.0),
          grid_({width,
                 height,
                 black_ ? 0.0 : std::log10(delta_ + statistics.smallest),
                 black_ ? 0.0 : std::log10(delta_ + statistics.largest)},
                std::max(1.0, options.spatial_sigma * std::max(width, height)),
                options.range_sigma)
    {
    }

    /// The grid, then the range of the filtered values.
    [[nodiscard]] int passes() const override { return black_ ? 0 : 2; }
    void gather(int pass, const SceneStrip& strip) override
    {
        Image<float> logarithms(strip.width(), strip.rows.height());
        parallelFor(0, strip.rows.height(), [&](std::int64_t row) {
            const auto i = static_cast<int>(row);
            for (int x = 0; x < strip.width(); ++x) {
                const float own = logOf(strip.rows(x, i));
                logarithms(x, i) = pass == 0 ? own : grid_.at(x, strip.first + i, own);
            }
        });
        if (pass == 0) {
            for (int i = 0; i < logarithms.height(); ++i) {
                const auto row = logarithms.row(i);
                grid_.add(strip.first + i, std::vector<float>(row.begin(), row.end()));
            }
            return;
        }
        const auto [low, high] = std::ranges::minmax(logarithms.pixels());
        low_ = std::min(low_, low);
        high_ = std::max(high_, high);
    }
    void endPass(int pass) override
    {
        if (pass == 0) grid_.blur();
    }

    void map(const SceneStrip& strip,
             int top,
             Image<Rgb>& display,
             Progress& /*progress*/) const override
    {
        if (black_) {
            std::ranges::fill(display.pixels(), Rgb(0.0f));
            return;
        }
        const double range = high_ - low_;
        const double wanted = std::log10(options_.base_contrast);
        const double factor = range > wanted ? wanted / range : 1.0;
        const double white = high_;
        parallelFor(0, display.height(), [&](std::int64_t row) {
            const int y = top + static_cast<int>(row);
            for (int x = 0; x < strip.width(); ++x) {
                const Rgb& color = strip(x, y);
                const float own = logOf(color);
                const double base = grid_.at(x, y, own);
                const double shown = factor * (base - white) + (static_cast<double>(own) - base);
                const double gain =
                    std::pow(10.0, shown) / (delta_ + static_cast<double>(luminance(color)));
                display(x, static_cast<int>(row)) =
                    glm::min(static_cast<float>(gain) * color, Rgb(1.0f));
            }
        });
    }

private:
    [[nodiscard]] float logOf(const Rgb& color) const
    {
        return static_cast<float>(std::log10(delta_ + static_cast<double>(luminance(color))));
    }

    DurandOptions options_;
    double delta_;
    bool black_;
    tonemap::BilateralGrid grid_;
    float low_ = std::numeric_limits<float>::max();  ///< of the filtered logarithms
    float high_ = std::numeric_limits<float>::lowest();
};

class Durand : public ToneMapOperator {
public:
    explicit Durand(const DurandOptions& options) : options_(options) {}

    [[nodiscard]] std::unique_ptr<SceneMapping> begin(
        int width, int height, const SceneStatistics& statistics) const override
    {
        return std::make_unique<DurandMapping>(options_, width, height, statistics);
    }

private:
    DurandOptions options_;
};

}  // namespace

Findings DurandOptions::validate() const
{
    Findings findings;
    const auto require = [&](bool good, const char* code, const std::string& message) {
        if (!good) findings.push_back({Severity::Error, code, message});
    };
    require(std::isfinite(base_contrast) && base_contrast > 1.0,
            "tonemap-base-contrast",
            fmt::format("the base's contrast is {}; give a number above 1", base_contrast));
    require(spatial_sigma > 0.0 && spatial_sigma <= 0.5,
            "tonemap-spatial-sigma",
            fmt::format("the filter's width is {}; give a share of the picture in (0, 0.5]",
                        spatial_sigma));
    require(std::isfinite(range_sigma) && range_sigma > 0.0,
            "tonemap-range-sigma",
            fmt::format("the filter's range is {}; give a number above 0", range_sigma));
    return findings;
}

std::unique_ptr<ToneMapOperator> makeDurand(const DurandOptions& options)
{
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<Durand>(options);
}

}  // namespace insitu
