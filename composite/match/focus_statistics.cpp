#include "composite/match/camera_match.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace insitu {

namespace {

constexpr int kMinEdges = 30;
/// Things have soft edges too: a quarter of the edges at a depth counts as the camera's sharpness.
constexpr double kSharpShare = 0.25;
/// Variance of a pixel's box across an edge, pixels squared; no edge is sharper.
constexpr double kBoxVariance = 1.0 / 12.0;
/// Defocus, or an error of it, that does not show; standard deviation of the blur, pixels.
constexpr double kVisible_px = 0.5;
/// The picture in parts, to see whether they agree.
constexpr int kBlocksX = 4;
constexpr int kBlocksY = 2;
constexpr std::size_t kBlocks = kBlocksX * kBlocksY;

struct DepthEdge {
    double inverse_depth = 0.0;  ///< 1/metre
    double log_spread = 0.0;
    std::size_t block = 0;
};

/// Edges at known depths, without those of one block.
struct EdgeSample {
    const std::vector<DepthEdge>& edges;
    std::size_t left_out = kBlocks;

    /// Sum of the check losses of log spread about log √(variance + b (1/depth − q0)²), whose least
    /// is at the quantile kSharpShare. [KoeBas78]
    [[nodiscard]] double loss(double variance, double b, double q0) const
    {
        double sum = 0.0;
        for (const DepthEdge& edge : edges) {
            if (edge.block == left_out) continue;
            const double off = edge.inverse_depth - q0;
            const double r = edge.log_spread - 0.5 * std::log(variance + b * off * off);
            sum += r * (r > 0.0 ? kSharpShare : kSharpShare - 1.0);
        }
        return sum;
    }
};

/// Least value of a function with one minimum, and where. Golden sections.
template <typename Function>
std::pair<double, double> leastBetween(double low, double high, double tolerance, Function value)
{
    constexpr double kGolden = 0.6180339887498949;
    double a = high - kGolden * (high - low);
    double b = low + kGolden * (high - low);
    double at_a = value(a);
    double at_b = value(b);
    while (high - low > tolerance) {
        if (at_a <= at_b) {
            high = b;
            b = a;
            at_b = at_a;
            a = high - kGolden * (high - low);
            at_a = value(a);
        } else {
            low = a;
            a = b;
            at_a = at_b;
            b = low + kGolden * (high - low);
            at_b = value(b);
        }
    }
    return at_a <= at_b ? std::pair(at_a, a) : std::pair(at_b, b);
}

/// The least loss over the variance in focus, and that variance's logarithm.
std::pair<double, double> bestVariance(const EdgeSample& sample, double b, double q0)
{
    return leastBetween(std::log(kBoxVariance), std::log(9.0), 0.02, [&](double log_variance) {
        return sample.loss(std::exp(log_variance), b, q0);
    });
}

double lossAt(const EdgeSample& sample, double b, double q0)
{
    return bestVariance(sample, b, q0).first;
}

struct FocusFit {
    double inverse_focus = 0.0;  ///< 1/metre
    double gain = 0.0;           ///< how much the loss is below that without depth of field
};

FocusFit fitFocus(const EdgeSample& sample, double b, double nearest)
{
    // A tenth of a visible step of blur apart; the loss may have several minima.
    const int steps =
        std::clamp(static_cast<int>(nearest * std::sqrt(b) / (0.1 * kVisible_px)), 8, 200);
    double best = std::numeric_limits<double>::infinity();
    int best_step = 0;
    for (int i = 0; i <= steps; ++i) {
        const double loss = lossAt(sample, b, nearest * i / steps);
        if (loss < best) {
            best = loss;
            best_step = i;
        }
    }
    const double low = nearest * std::max(0, best_step - 1) / steps;
    const double high = nearest * std::min(steps, best_step + 1) / steps;
    const auto [loss, inverse_focus] = leastBetween(
        low, high, 1e-3 * (high - low), [&](double q0) { return lossAt(sample, b, q0); });
    return {inverse_focus, lossAt(sample, 0.0, 0.0) - loss};
}

std::vector<DepthEdge> edgesAtDepths(const std::vector<EdgeProfile>& edges,
                                     const Image<float>& depth_m)
{
    std::vector<DepthEdge> result;
    for (const EdgeProfile& edge : edges) {
        const int x = static_cast<int>(edge.at.x);
        const int y = static_cast<int>(edge.at.y);
        if (x < 0 || y < 0 || x >= depth_m.width() || y >= depth_m.height()) continue;
        if (!(depth_m(x, y) > 0.0f) || !(edge.spread.g > 0.0)) continue;
        const int block =
            x * kBlocksX / depth_m.width() + kBlocksX * (y * kBlocksY / depth_m.height());
        result.push_back({1.0 / static_cast<double>(depth_m(x, y)),
                          std::log(edge.spread.g),
                          static_cast<std::size_t>(block)});
    }
    return result;
}

/// Standard deviation of the inverse focus by leaving out one block of the picture after another,
/// since the edges of one thing are as soft as it is, all together [Efron79]; infinite where one
/// sharpness explains the rest as well.
double jackknifeSigma(const std::vector<DepthEdge>& edges, double b, double nearest)
{
    std::vector<double> answers;
    for (std::size_t block = 0; block < kBlocks; ++block) {
        const auto in_block = std::count_if(
            edges.begin(), edges.end(), [&](const DepthEdge& e) { return e.block == block; });
        if (in_block == 0) continue;
        if (in_block == static_cast<std::ptrdiff_t>(edges.size()))
            return std::numeric_limits<double>::infinity();
        const FocusFit rest = fitFocus({edges, block}, b, nearest);
        if (!(rest.gain > 0.0)) return std::numeric_limits<double>::infinity();
        answers.push_back(rest.inverse_focus);
    }
    const auto n = static_cast<double>(answers.size());
    double mean = 0.0;
    for (const double answer : answers)
        mean += answer / n;
    double square = 0.0;
    for (const double answer : answers)
        square += (answer - mean) * (answer - mean);
    return std::sqrt((n - 1.0) / n * square);
}

}  // namespace

std::optional<DepthOfField> estimateFocus(const std::vector<EdgeProfile>& edges,
                                          const Image<float>& depth_m,
                                          double diameter_px)
{
    const std::vector<DepthEdge> sample = edgesAtDepths(edges, depth_m);
    if (static_cast<int>(sample.size()) < kMinEdges) return std::nullopt;
    const auto [farthest, nearest] = std::minmax_element(
        sample.begin(), sample.end(), [](const DepthEdge& a, const DepthEdge& b) {
            return a.inverse_depth < b.inverse_depth;
        });
    const double blur_per_step = 0.25 * diameter_px;
    const double b = blur_per_step * blur_per_step;
    // Nearer than all that is seen is not told by these edges, nor how one photographs a room.
    const double q0 = fitFocus({sample}, b, nearest->inverse_depth).inverse_focus;
    const double reach = std::max(nearest->inverse_depth - q0, q0 - farthest->inverse_depth);
    if (blur_per_step * reach < kVisible_px) return std::nullopt;
    if (!(blur_per_step * jackknifeSigma(sample, b, nearest->inverse_depth) <= kVisible_px))
        return std::nullopt;
    return DepthOfField{diameter_px, 1.0 / std::max(q0, 1e-6)};
}

std::optional<double> blurInFocus(const std::vector<EdgeProfile>& edges,
                                  const Image<float>& depth_m,
                                  const DepthOfField& lens)
{
    const std::vector<DepthEdge> sample = edgesAtDepths(edges, depth_m);
    if (static_cast<int>(sample.size()) < kMinEdges) return std::nullopt;
    const double b = lens.diameter_px * lens.diameter_px / 16.0;
    const double variance = std::exp(bestVariance({sample}, b, 1.0 / lens.focus_m).second);
    return std::sqrt(std::max(0.0, variance - kBoxVariance));
}

}  // namespace insitu
