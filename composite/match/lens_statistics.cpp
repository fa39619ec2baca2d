#include "composite/match/camera_match.h"
#include "core/color.h"
#include "core/quantile.h"

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
constexpr int kMinEdges = 30;

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

std::optional<DepthOfField> estimateFocus(const std::vector<EdgeProfile>& edges,
                                          const Image<float>& depth_m,
                                          double diameter_px)
{
    // With q = 1/depth and B = (diameter/4)²: spread² − B q² = (s² + B q0²) − 2 B q0 q, a line in
    // q.
    const double b = diameter_px * diameter_px / 16.0;
    struct Point {
        double q;
        double y;
        double sigma;
    };
    std::vector<Point> points;
    for (const EdgeProfile& edge : edges) {
        const int x = static_cast<int>(edge.at.x);
        const int y = static_cast<int>(edge.at.y);
        if (x < 0 || y < 0 || x >= depth_m.width() || y >= depth_m.height()) continue;
        const double depth = depth_m(x, y);
        if (!(depth > 0.0)) continue;
        const double q = 1.0 / depth;
        const double spread = edge.spread.g;
        points.push_back(
            {q, spread * spread - b * q * q, std::max(2.0 * spread * edge.spread_sigma.g, 1e-3)});
    }
    if (static_cast<int>(points.size()) < kMinEdges) return std::nullopt;
    double level = 0.0;
    double slope = 0.0;
    double slope_sigma = 0.0;
    double scale = 1.0;
    for (int iteration = 0; iteration < 30; ++iteration) {
        double sw = 0.0, sq = 0.0, sqq = 0.0, sy = 0.0, sqy = 0.0;
        std::vector<double> size;
        for (const Point& p : points) {
            const double r = (p.y - level - slope * p.q) / p.sigma;
            size.push_back(std::abs(r));
            // The first round takes all; later ones leave out what is soft for another reason.
            const double bend = 2.0 * scale;
            const double robust =
                iteration == 0
                    ? 1.0
                    : 1.0 / ((1.0 + r * r / (bend * bend)) * (1.0 + r * r / (bend * bend)));
            const double w = robust / (p.sigma * p.sigma);
            sw += w;
            sq += w * p.q;
            sqq += w * p.q * p.q;
            sy += w * p.y;
            sqy += w * p.q * p.y;
        }
        const double determinant = sw * sqq - sq * sq;
        if (!(determinant > 1e-12 * sw * sqq)) return std::nullopt;
        slope = (sw * sqy - sq * sy) / determinant;
        level = (sy - slope * sq) / sw;
        scale = std::max(1.4826 * quantile(size, 0.5), 1.0);
        slope_sigma = scale * std::sqrt(sw / determinant);
    }
    const double q0 = -slope / (2.0 * b);
    // Sharpness must follow depth: the focus is known only when the line's slope is.
    if (!(q0 > 0.0) || !(std::abs(slope) > 3.0 * slope_sigma)) return std::nullopt;
    // Without any depth of field the points lie on spread² = s²: then −B q² alone bends them, and a
    // line of slope −2 B q̄ fits. The bend must be visible for the line to mean focus.
    double low = points.front().q;
    double high = low;
    for (const Point& p : points) {
        low = std::min(low, p.q);
        high = std::max(high, p.q);
    }
    if (0.25 * diameter_px * std::max(high - q0, q0 - low) < 0.5) return std::nullopt;
    return DepthOfField{diameter_px, 1.0 / q0};
}

}  // namespace insitu
