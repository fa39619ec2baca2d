#include "composite/tonemap/reinhard_adaptation.h"

#include <algorithm>
#include <cmath>

namespace insitu::tonemap {

namespace {

constexpr int kHalo = 32;
/// [Reinhard02] section 3.2: eight scales, each 1.6 times the one before, and one that surrounds
/// the last; sharpening 8, threshold 0.05.
constexpr int kScales = 8;
constexpr double kRatio = 1.6;
constexpr double kSharpening = 256.0;
constexpr float kThreshold = 0.05f;
/// The paper's exp(−r²/(α s)²), α = 1/(2 √2), has this deviation for s = 1, pixels.
constexpr double kFirstSigma = 0.25;

std::vector<float> gaussianTaps(double sigma)
{
    const int reach = std::min(kHalo, static_cast<int>(std::ceil(3.0 * sigma)));
    std::vector<double> weights;
    double sum = 0.0;
    for (int i = 0; i <= reach; ++i) {
        weights.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
        sum += (i == 0 ? 1.0 : 2.0) * weights.back();
    }
    std::vector<float> taps;
    for (const double weight : weights)
        taps.push_back(static_cast<float>(weight / sum));
    return taps;
}

/// A rectangle of pixels, rows one after the other.
struct Plane {
    int width = 0;
    int height = 0;
    std::vector<float> values;

    Plane(int w, int h)
        : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h))
    {
    }
    [[nodiscard]] float* row(int y)
    {
        return values.data() + static_cast<std::ptrdiff_t>(y) * width;
    }
    [[nodiscard]] const float* row(int y) const
    {
        return values.data() + static_cast<std::ptrdiff_t>(y) * width;
    }
};

/// out[i] = sum over k of taps[|k|] · at(k)[i].
template <typename At>
void convolve(const std::vector<float>& taps, int count, float* out, At at)
{
    const float* const middle = at(0);
    for (int i = 0; i < count; ++i)
        out[i] = taps[0] * middle[i];
    for (std::size_t k = 1; k < taps.size(); ++k) {
        const float weight = taps[k];
        const float* const before = at(-static_cast<int>(k));
        const float* const after = at(static_cast<int>(k));
        for (int i = 0; i < count; ++i)
            out[i] += weight * (before[i] + after[i]);
    }
}

/// The inside of `source`, without its kHalo pixels on every side, blurred.
Plane blurred(const Plane& source, const std::vector<float>& taps)
{
    const int reach = static_cast<int>(taps.size()) - 1;
    const int width = source.width - 2 * kHalo;
    const int height = source.height - 2 * kHalo;
    Plane across(width, height + 2 * reach);
    for (int y = 0; y < across.height; ++y) {
        const float* const from = source.row(y + kHalo - reach) + kHalo;
        convolve(taps, width, across.row(y), [&](int k) { return from + k; });
    }
    Plane result(width, height);
    for (int y = 0; y < height; ++y)
        convolve(taps, width, result.row(y), [&](int k) { return across.row(y + reach + k); });
    return result;
}

/// The patch around the pixels [x0, x1) x [y0, y1), columns in order.
Plane columnsInOrder(const LuminancePatch& patch, int x0, int y0, int x1, int y1)
{
    Plane plane(x1 - x0 + 2 * kHalo, y1 - y0 + 2 * kHalo);
    for (int y = 0; y < plane.height; ++y) {
        const float* const even = patch.even(y0 + y - kHalo) + (x0 - kHalo) / 2;
        const float* const odd = patch.odd(y0 + y - kHalo) + (x0 - kHalo) / 2;
        float* const out = plane.row(y);
        for (int i = 0; i < plane.width / 2; ++i) {
            out[2 * i] = even[i];
            out[2 * i + 1] = odd[i];
        }
    }
    return plane;
}

}  // namespace

ReinhardAdaptation::ReinhardAdaptation(double key) : key_(key)
{
    for (int i = 0; i <= kScales; ++i)
        taps_.push_back(gaussianTaps(kFirstSigma * std::pow(kRatio, i)));
}

int ReinhardAdaptation::halo() const
{
    return kHalo;
}

void ReinhardAdaptation::adapt(const LuminancePatch& patch,
                               const WantedBlocks& blocks,
                               float* adapted) const
{
    const int rows = static_cast<int>(blocks.wanted.size()) / blocks.columns;
    for (int row = 0; row < rows; ++row) {
        const auto wanted = [&](int column) {
            return blocks.wanted[static_cast<std::size_t>(row * blocks.columns + column)] != 0;
        };
        // Runs of wanted blocks, and as many rows of blocks as want the same: whole tiles at once
        // where all is wanted.
        int below = row + 1;
        if (row > 0 && std::equal(blocks.wanted.begin() + row * blocks.columns,
                                  blocks.wanted.begin() + (row + 1) * blocks.columns,
                                  blocks.wanted.begin() + (row - 1) * blocks.columns))
            continue;
        while (below < rows && std::equal(blocks.wanted.begin() + row * blocks.columns,
                                          blocks.wanted.begin() + (row + 1) * blocks.columns,
                                          blocks.wanted.begin() + below * blocks.columns))
            ++below;
        for (int column = 0; column < blocks.columns;) {
            int end = column;
            while (end < blocks.columns && wanted(end))
                ++end;
            if (end > column)
                adaptBox(patch,
                         column * WantedBlocks::kWidth,
                         row * WantedBlocks::kHeight,
                         std::min(end * WantedBlocks::kWidth, patch.width),
                         std::min(below * WantedBlocks::kHeight, patch.height),
                         adapted);
            column = end + 1;
        }
    }
}

void ReinhardAdaptation::adaptBox(
    const LuminancePatch& patch, int x0, int y0, int x1, int y1, float* adapted) const
{
    const Plane source = columnsInOrder(patch, x0, y0, x1, y1);
    Plane centre = blurred(source, taps_[0]);
    Plane result = centre;
    std::vector<std::uint8_t> alike(result.values.size(), 1);
    for (int i = 0; i < kScales; ++i) {
        const auto scale = static_cast<std::size_t>(i);
        Plane surround = blurred(source, taps_[scale + 1]);
        const auto floor = static_cast<float>(kSharpening * key_ / std::pow(kRatio, 2.0 * i));
        for (std::size_t k = 0; k < alike.size(); ++k) {
            const float v = centre.values[k];
            const bool still = std::abs(v - surround.values[k]) < kThreshold * (floor + v);
            alike[k] = alike[k] != 0 && still ? 1 : 0;
            result.values[k] = alike[k] != 0 ? v : result.values[k];
        }
        centre = std::move(surround);
    }
    const int half = patch.width / 2;
    for (int y = y0; y < y1; ++y) {
        const float* const from = result.row(y - y0);
        float* const even = adapted + static_cast<std::ptrdiff_t>(y) * patch.width + x0 / 2;
        for (int i = 0; i < (x1 - x0) / 2; ++i) {
            even[i] = from[2 * i];
            even[half + i] = from[2 * i + 1];
        }
    }
}

}  // namespace insitu::tonemap
