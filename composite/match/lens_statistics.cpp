#include "composite/match/camera_match.h"
#include "core/color.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {

namespace {

constexpr int kSectors = 8;
constexpr int kBlock = 16;
constexpr int kMinPairs = 12;

/// Mean luminance of every block of 16×16 pixels that is usable throughout; 0 of others.
Image<double> blockMeans(const Image<Rgb>& radiance, const Image<std::uint8_t>& usable)
{
    Image<double> means(radiance.width() / kBlock, radiance.height() / kBlock);
    for (int j = 0; j < means.height(); ++j)
        for (int i = 0; i < means.width(); ++i) {
            double sum = 0.0;
            bool whole = true;
            for (int y = j * kBlock; y < (j + 1) * kBlock && whole; ++y)
                for (int x = i * kBlock; x < (i + 1) * kBlock; ++x) {
                    whole = whole && usable(x, y);
                    sum += luminance(radiance(x, y));
                }
            means(i, j) = whole ? sum / (kBlock * kBlock) : 0.0;
        }
    return means;
}

/// A step of log brightness between neighbouring blocks, and how far r² runs over it.
struct RadialStep {
    double log_ratio = 0.0;
    double inner_square = 0.0;  ///< r² of the block that came first
    double outer_square = 0.0;
};

/// The a that explains the steps: Lp regression (p near 0.7, edges are many and large) by
/// reweighting, of log_ratio = −2 log((1 + a r²_outer) / (1 + a r²_inner)).
double fitFalloff(const std::vector<RadialStep>& steps)
{
    constexpr double kPower = 0.7;
    double a = 0.0;
    for (int iteration = 0; iteration < 60; ++iteration) {
        double cross = 0.0;
        double information = 0.0;
        for (const RadialStep& step : steps) {
            const double predicted =
                -2.0 * std::log((1.0 + a * step.outer_square) / (1.0 + a * step.inner_square));
            const double slope = -2.0 * (step.outer_square / (1.0 + a * step.outer_square) -
                                         step.inner_square / (1.0 + a * step.inner_square));
            const double residual = step.log_ratio - predicted;
            // Noise rounds the tip of |x|^p.
            const double w = std::pow(residual * residual + 1e-5, 0.5 * (kPower - 2.0));
            cross += w * slope * residual;
            information += w * slope * slope;
        }
        if (!(information > 0.0)) break;
        const double next = std::clamp(a + cross / information, -0.3, 3.0);
        const bool settled = std::abs(next - a) < 1e-7;
        a = next;
        if (settled) break;
    }
    return a;
}

}  // namespace

Vignetting estimateVignetting(const Image<Rgb>& radiance,
                              const Image<std::uint8_t>& usable,
                              glm::dvec2 centre_px)
{
    const Image<double> means = blockMeans(radiance, usable);
    const double half_diagonal = 0.5 * std::hypot(radiance.width(), radiance.height());
    std::array<std::vector<RadialStep>, kSectors> sectors;
    const auto placeOf = [&](int i, int j) {
        return (glm::dvec2((i + 0.5) * kBlock, (j + 0.5) * kBlock) - centre_px) / half_diagonal;
    };
    const auto add = [&](int i, int j, int i2, int j2) {
        const double a = means(i, j);
        const double b = means(i2, j2);
        if (!(a > 0.0) || !(b > 0.0)) return;
        const glm::dvec2 p = placeOf(i, j);
        const glm::dvec2 q = placeOf(i2, j2);
        const glm::dvec2 m = 0.5 * (p + q);
        const double turn = std::atan2(m.y, m.x) / (2.0 * std::numbers::pi) + 0.5;
        const auto sector = static_cast<std::size_t>(turn * kSectors) % kSectors;
        sectors[sector].push_back({std::log(b / a), glm::dot(p, p), glm::dot(q, q)});
    };
    for (int j = 0; j < means.height(); ++j)
        for (int i = 0; i < means.width(); ++i) {
            if (i + 1 < means.width()) add(i, j, i + 1, j);
            if (j + 1 < means.height()) add(i, j, i, j + 1);
        }
    // Opposite sectors answer together: shading that runs across the picture cancels in them.
    std::vector<double> answers;
    for (std::size_t s = 0; s < kSectors / 2; ++s) {
        std::vector<RadialStep> pair = sectors[s];
        const auto& opposite = sectors[s + kSectors / 2];
        if (static_cast<int>(pair.size()) < kMinPairs ||
            static_cast<int>(opposite.size()) < kMinPairs)
            continue;
        answers.push_back(0.5 * (fitFalloff(pair) + fitFalloff(opposite)));
    }
    if (answers.size() < 3) return {0.0, std::numeric_limits<double>::infinity()};
    double mean = 0.0;
    for (const double a : answers)
        mean += a / static_cast<double>(answers.size());
    double square = 0.0;
    for (const double a : answers)
        square += (a - mean) * (a - mean);
    const auto n = static_cast<double>(answers.size());
    return {mean, std::sqrt(square / (n * (n - 1.0)))};
}

}  // namespace insitu
