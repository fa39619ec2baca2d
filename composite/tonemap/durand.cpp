#include "composite/tonemap/durand.h"

#include "composite/tonemap/bilateral_grid.h"
#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// What saves black pixels from the logarithm, as a share of the mean luminance.
constexpr double kDelta = 1e-6;

class Durand : public ToneMapOperator {
public:
    explicit Durand(const DurandOptions& options) : options_(options) {}

    void mapInto(Image<Rgb>& display,
                 const Image<Rgb>& scene,
                 const SceneStatistics& statistics,
                 Progress& progress) const override
    {
        INSITU_CHECK(display.sameSize(scene), "{}x{}", display.width(), display.height());
        if (scene.empty()) return;
        progress.checkpoint();
        if (statistics.largest == 0.0) {
            std::ranges::fill(display.pixels(), Rgb(0.0f));
            return;
        }
        const double delta = kDelta * statistics.mean;
        Image<float> logarithm(scene.width(), scene.height());
        const auto rows = [&](const auto& body) {
            parallelFor(0, scene.height(), [&](std::int64_t row) {
                for (int x = 0; x < scene.width(); ++x)
                    body(x, static_cast<int>(row));
            });
        };
        rows([&](int x, int y) {
            logarithm(x, y) =
                static_cast<float>(std::log10(delta + static_cast<double>(luminance(scene(x, y)))));
        });
        const Image<float> base = tonemap::bilateralFilter(
            logarithm,
            std::max(1.0, options_.spatial_sigma * std::max(scene.width(), scene.height())),
            options_.range_sigma);
        const auto [low, high] = std::minmax_element(base.pixels().begin(), base.pixels().end());
        const double range = *high - *low;
        const double wanted = std::log10(options_.base_contrast);
        const double factor = range > wanted ? wanted / range : 1.0;
        const double white = *high;
        rows([&](int x, int y) {
            const double own = logarithm(x, y);
            const double shown = factor * (base(x, y) - white) + (own - base(x, y));
            const double gain =
                std::pow(10.0, shown) / (delta + static_cast<double>(luminance(scene(x, y))));
            display(x, y) = glm::min(static_cast<float>(gain) * scene(x, y), Rgb(1.0f));
        });
        progress.checkpoint();
        progress.report("tone mapping", 1.0);
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
