#include "composite/tonemap/histogram_curve.h"

#include "composite/tonemap/eye_model.h"
#include "composite/tonemap/line_steps.h"
#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu::tonemap {

namespace {

constexpr std::size_t kBins = 100;        ///< [Ward97] 4.2
constexpr double kTolerance = 0.025;      ///< [Ward97] 4.3: of the original count
constexpr double kLeastLuminance = 1e-4;  ///< cd/m²: the eye's floor, [Ward97] 4.2
constexpr int kMostRounds = 200;

struct Histogram {
    std::vector<double> counts = std::vector<double>(kBins, 0.0);
    double log_first = 0.0;
    double step = 0.0;

    [[nodiscard]] double total() const
    {
        double sum = 0.0;
        for (const double count : counts)
            sum += count;
        return sum;
    }
    [[nodiscard]] double luminance(std::size_t bin) const
    {
        return std::exp(log_first + (static_cast<double>(bin) + 0.5) * step);
    }
};

/// Natural logarithms, none below the eye's floor.
std::vector<float> brightnessOf(const std::vector<float>& adaptation)
{
    constexpr std::int64_t kBlock = 4096;
    const auto count = static_cast<std::int64_t>(adaptation.size());
    std::vector<float> logs(adaptation.size());
    parallelFor(0, (count + kBlock - 1) / kBlock, [&](std::int64_t block) {
        for (std::int64_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) {
            const auto at = static_cast<std::size_t>(i);
            logs[at] = logOf(std::max(adaptation[at], static_cast<float>(kLeastLuminance)));
        }
    });
    return logs;
}

Histogram countBrightness(const std::vector<float>& logs)
{
    const auto [least, most] = std::minmax_element(logs.begin(), logs.end());
    Histogram histogram;
    histogram.log_first = static_cast<double>(*least);
    histogram.step =
        std::max(static_cast<double>(*most - *least) / static_cast<double>(kBins), 1e-9);
    for (const float log : logs) {
        const auto bin = static_cast<std::size_t>((static_cast<double>(log) - histogram.log_first) /
                                                  histogram.step);
        histogram.counts[std::min(bin, kBins - 1)] += 1.0;
    }
    return histogram;
}

/// Cumulative share at the bins' upper edges.
std::vector<double> cumulative(const Histogram& histogram)
{
    std::vector<double> shares;
    double sum = 0.0;
    for (const double count : histogram.counts)
        shares.push_back(sum += count);
    for (double& share : shares)
        share /= sum;
    return shares;
}

/// One round of equation 5.7. Returns what was cut.
double cutCounts(Histogram& histogram, double black, double white)
{
    const double total = histogram.total();
    const double range = std::log(white) - std::log(black);
    const std::vector<double> shares = cumulative(histogram);
    double cut = 0.0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
        const double before = bin == 0 ? 0.0 : shares[bin - 1];
        const double shown = std::exp(std::log(black) + range * 0.5 * (before + shares[bin]));
        const double scene = histogram.luminance(bin);
        const double ceiling = justNoticeableDifference(shown) / justNoticeableDifference(scene) *
                               total * histogram.step * scene / (range * shown);
        if (histogram.counts[bin] <= ceiling) continue;
        cut += histogram.counts[bin] - ceiling;
        histogram.counts[bin] = ceiling;
    }
    return cut;
}

/// False when nothing is left to equalise.
bool adjust(Histogram& histogram, double black, double white)
{
    const double original = histogram.total();
    for (int round = 0; round < kMostRounds; ++round) {
        const double cut = cutCounts(histogram, black, white);
        if (histogram.total() < kTolerance * original) return false;
        if (cut <= kTolerance * original) return true;
    }
    return true;
}

}  // namespace

HistogramCurve histogramCurve(const std::vector<float>& adaptation, double black, double white)
{
    INSITU_CHECK(!adaptation.empty() && 0.0 < black && black < white, "{} to {}", black, white);
    const std::vector<float> logs = brightnessOf(adaptation);
    Histogram histogram = countBrightness(logs);
    double log_sum = 0.0;
    for (const float log : logs)
        log_sum += static_cast<double>(log);
    const double scene_level = std::exp(log_sum / static_cast<double>(adaptation.size()));
    const double log_most = histogram.log_first + histogram.step * kBins;
    // What just can be told apart in the scene is what just can be told apart on the display.
    const double exposure =
        justNoticeableDifference(0.5 * white) / justNoticeableDifference(scene_level);
    const double highest = std::min(1.0, exposure * std::exp(log_most) / white);

    HistogramCurve curve;
    curve.log_first = histogram.log_first;
    curve.log_step = histogram.step;
    if (!adjust(histogram, black, white)) {
        // On a fine grid, since a straight line is steep in logarithms; from far below the least.
        constexpr std::size_t kPoints = 1024;
        curve.log_first = std::log(kLeastLuminance);
        curve.log_step = std::max(log_most - curve.log_first, 1e-9) / (kPoints - 1);
        for (std::size_t i = 0; i < kPoints; ++i) {
            const double scene =
                std::exp(curve.log_first + static_cast<double>(i) * curve.log_step);
            curve.display.push_back(static_cast<float>(std::min(1.0, exposure * scene / white)));
        }
        return curve;
    }
    const std::vector<double> shares = cumulative(histogram);
    for (std::size_t i = 0; i <= kBins; ++i) {
        const double share = i == 0 ? 0.0 : shares[i - 1];
        const double shown = black * std::pow(white / black, share);
        curve.display.push_back(static_cast<float>(highest * (shown - black) / (white - black)));
    }
    return curve;
}

}  // namespace insitu::tonemap
