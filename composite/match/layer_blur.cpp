#include "composite/match/layer_blur.h"

#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

/// Deviations are rounded to this, pixels, so that their taps can be kept.
constexpr double kSigmaStep = 1.0 / 32.0;

/// Every blur's taps, by rounded deviation.
class BlurTable {
public:
    explicit BlurTable(double max_sigma)
    {
        for (int i = 0; i <= static_cast<int>(std::ceil(max_sigma / kSigmaStep)); ++i)
            taps_.emplace_back(i * kSigmaStep);
    }
    [[nodiscard]] const BlurTaps& at(float sigma) const
    {
        const auto i = static_cast<std::size_t>(std::lround(sigma / kSigmaStep));
        return taps_[std::min(i, taps_.size() - 1)];
    }
    [[nodiscard]] int reach() const { return taps_.back().reach; }

private:
    std::vector<BlurTaps> taps_;
};

/// 1 within `reach` pixels of a set one.
Image<std::uint8_t> grown(const Image<std::uint8_t>& set, int reach)
{
    Image<std::uint8_t> wide(set.width(), set.height());
    Image<std::uint8_t> both(set.width(), set.height());
    const auto pass = [&](const Image<std::uint8_t>& from, Image<std::uint8_t>& to, bool across) {
        const int lines = across ? from.height() : from.width();
        const int length = across ? from.width() : from.height();
        parallelFor(0, lines, [&](std::int64_t line) {
            const int l = static_cast<int>(line);
            int last = -reach - 1;
            const auto at = [&](int i) { return across ? from(i, l) : from(l, i); };
            for (int i = 0; i < length + reach; ++i) {
                if (i < length && at(i)) last = i;
                const int target = i - reach;
                if (target >= 0 && target < length && last >= target - reach)
                    (across ? to(target, l) : to(l, target)) = 1;
            }
        });
    };
    pass(set, wide, true);
    pass(wide, both, false);
    return both;
}

}  // namespace

BlurTaps::BlurTaps(double sigma_px)
{
    // A three-tap kernel (v/2, 1 − v, v/2) has the variance v exactly; a sampled Gaussian of less
    // than 0.7 pixels falls short of it.
    if (sigma_px < 0.7) {
        const double variance = sigma_px * sigma_px;
        reach = variance > 0.0 ? 1 : 0;
        weight[0] = static_cast<float>(1.0 - variance);
        weight[1] = static_cast<float>(0.5 * variance);
        return;
    }
    reach = std::min(kMaxReach, static_cast<int>(std::ceil(3.0 * sigma_px)));
    double sum = 0.0;
    std::array<double, kMaxReach + 1> w{};
    for (int i = 0; i <= reach; ++i) {
        w[static_cast<std::size_t>(i)] = std::exp(-0.5 * i * i / (sigma_px * sigma_px));
        sum += (i == 0 ? 1.0 : 2.0) * w[static_cast<std::size_t>(i)];
    }
    for (int i = 0; i <= reach; ++i)
        weight[static_cast<std::size_t>(i)] =
            static_cast<float>(w[static_cast<std::size_t>(i)] / sum);
}

void blurLayers(const LayerBlur& blur, PhotoLayers& layers)
{
    const BlurTable table(blur.max_sigma_px);
    const int reach = table.reach();
    if (reach == 0) return;
    const int width = layers.object.width();
    const int height = layers.object.height();
    Image<std::uint8_t> touched(width, height);
    for (std::size_t i = 0; i < touched.pixelCount(); ++i)
        touched.pixels()[i] =
            layers.coverage.pixels()[i] != Rgb(0.0f) || layers.object.pixels()[i] != Rgb(0.0f) ||
            layers.irradiance_with.pixels()[i] != layers.irradiance_without.pixels()[i];
    const Image<std::uint8_t> near = grown(touched, reach);

    const PhotoLayers sharp = layers;
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (!near(x, y)) continue;
            const BlurTaps& own = table.at(blur.receiver_sigma_px(x, y));
            Rgb object(0.0f);
            Rgb coverage(0.0f);
            Rgb without(0.0f);
            Rgb with(0.0f);
            float variance = 0.0f;
            float depth = 0.0f;
            float seen = 0.0f;
            for (int dy = -reach; dy <= reach; ++dy)
                for (int dx = -reach; dx <= reach; ++dx) {
                    // Beyond the frame the picture goes on as at its edge.
                    const int sx = std::clamp(x + dx, 0, width - 1);
                    const int sy = std::clamp(y + dy, 0, height - 1);
                    const auto ax = static_cast<std::size_t>(std::abs(dx));
                    const auto ay = static_cast<std::size_t>(std::abs(dy));
                    const Rgb covered = sharp.coverage(sx, sy);
                    const float alpha = covered.g;
                    if (alpha > 0.0f || sharp.object(sx, sy) != Rgb(0.0f)) {
                        const BlurTaps& its = table.at(blur.object_sigma_px(sx, sy));
                        const float w = its.weight[ax] * its.weight[ay];
                        object += w * sharp.object(sx, sy);
                        coverage += w * covered;
                        variance += w * w * sharp.object_variance(sx, sy);
                        depth += w * alpha * sharp.depth_m(sx, sy);
                    }
                    const float w = own.weight[ax] * own.weight[ay] * (1.0f - alpha);
                    if (w > 0.0f && sharp.irradiance_without(sx, sy) != Rgb(0.0f)) {
                        without += w * sharp.irradiance_without(sx, sy);
                        with += w * sharp.irradiance_with(sx, sy);
                        seen += w;
                    }
                }
            layers.object(x, y) = object;
            layers.coverage(x, y) = glm::min(coverage, Rgb(1.0f));
            layers.object_variance(x, y) = variance;
            layers.depth_m(x, y) = coverage.g > 0.0f ? depth / coverage.g : 0.0f;
            if (seen > 0.0f) {
                layers.irradiance_without(x, y) = without / seen;
                layers.irradiance_with(x, y) = with / seen;
            }
        }
    });
}

}  // namespace insitu
