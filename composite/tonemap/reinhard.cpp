#include "composite/tonemap/reinhard.h"

#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

struct LuminanceStatistics {
    double log_average = 0.0;
    double largest = 0.0;
};

/// Equation 1: exp(mean(log(delta + L))). The paper leaves open how small delta, which saves black
/// pixels from log(0), is; a millionth of the mean keeps the operator independent of the unit.
LuminanceStatistics measureLuminance(const Image<Rgb>& scene)
{
    const auto rows = static_cast<std::size_t>(scene.height());
    std::vector<double> sums(rows, 0.0);
    std::vector<double> peaks(rows, 0.0);
    const auto overRows = [&](const std::function<void(int)>& body) {
        parallelFor(0, scene.height(), [&](std::int64_t y) { body(static_cast<int>(y)); });
    };
    const auto total = [&] {
        double sum = 0.0;
        for (const double row : sums)
            sum += row;
        return sum / static_cast<double>(scene.pixelCount());
    };
    overRows([&](int y) {
        for (int x = 0; x < scene.width(); ++x) {
            const double value = luminance(scene(x, y));
            if (!std::isfinite(value) || glm::any(glm::lessThan(scene(x, y), Rgb(0.0f))))
                throw InputError("tone mapping",
                                 fmt::format("pixel ({}, {})", x, y),
                                 "is not a finite colour >= 0");
            sums[static_cast<std::size_t>(y)] += value;
            peaks[static_cast<std::size_t>(y)] =
                std::max(peaks[static_cast<std::size_t>(y)], value);
        }
    });
    LuminanceStatistics statistics;
    for (const double peak : peaks)
        statistics.largest = std::max(statistics.largest, peak);
    if (statistics.largest == 0.0) return statistics;
    const double delta = 1e-6 * total();
    std::fill(sums.begin(), sums.end(), 0.0);
    overRows([&](int y) {
        for (int x = 0; x < scene.width(); ++x)
            sums[static_cast<std::size_t>(y)] +=
                std::log(delta + static_cast<double>(luminance(scene(x, y))));
    });
    statistics.log_average = std::exp(total());
    return statistics;
}

class Reinhard : public ToneMapOperator {
public:
    explicit Reinhard(const ReinhardOptions& options) : options_(options) {}

    [[nodiscard]] Image<Rgb> map(const Image<Rgb>& scene, Progress& progress) const override
    {
        Image<Rgb> display(scene.width(), scene.height());
        if (scene.empty()) return display;
        progress.checkpoint();
        const LuminanceStatistics statistics = measureLuminance(scene);
        if (statistics.largest == 0.0) return display;
        // Equation 2, then equation 4.
        const double scale = options_.key / statistics.log_average;
        const double white = options_.white.value_or(scale * statistics.largest);
        parallelFor(0, scene.height(), [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < scene.width(); ++x) {
                const double scaled = scale * static_cast<double>(luminance(scene(x, y)));
                const double gain = scale * (1.0 + scaled / (white * white)) / (1.0 + scaled);
                display(x, y) = glm::min(scene(x, y) * static_cast<float>(gain), Rgb(1.0f));
            }
        });
        progress.report("tone mapping", 1.0);
        return display;
    }

private:
    ReinhardOptions options_;
};

}  // namespace

Findings ReinhardOptions::validate() const
{
    Findings findings;
    const auto require = [&](bool good, const char* code, const std::string& message) {
        if (!good) findings.push_back({Severity::Error, code, message});
    };
    require(std::isfinite(key) && key > 0.0,
            "tonemap-key",
            fmt::format("the key is {}; give a number above 0, 0.18 for middle grey", key));
    require(!white || (std::isfinite(*white) && *white > 0.0),
            "tonemap-white",
            fmt::format("the white point is {}; give a number above 0", white.value_or(0.0)));
    return findings;
}

std::unique_ptr<ToneMapOperator> makeReinhard(const ReinhardOptions& options)
{
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<Reinhard>(options);
}

}  // namespace insitu
