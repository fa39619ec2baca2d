#include "capture/pair_alignment.h"

#include <algorithm>
#include <array>
#include <functional>
#include <span>
#include <vector>

namespace insitu::detail {

namespace {

/// Points on a picture at most, and blocks a side that share them equally.
constexpr int kMostPoints = 14'400;
constexpr int kBlocksASide = 12;
/// Distance from the border from which gradients are sound.
constexpr int kMargin = 4;

/// Binomial 1 4 6 4 1 both ways: standard deviation 1 pixel.
Image<float> smoothed(const Image<float>& image)
{
    const int width = image.width();
    const int height = image.height();
    Image<float> rows(width, height);
    for (int y = 0; y < height; ++y) {
        const std::span<const float> in = image.row(y);
        const std::span<float> out = rows.row(y);
        const auto at = [&](int x) {
            return in[static_cast<std::size_t>(std::clamp(x, 0, width - 1))];
        };
        const auto tap = [](float a, float b, float c, float d, float e) {
            return (a + e + 4.0f * (b + d) + 6.0f * c) * (1.0f / 16.0f);
        };
        for (int x = 0; x < width; ++x) {
            const auto i = static_cast<std::size_t>(x);
            out[i] = x >= 2 && x + 2 < width
                         ? tap(in[i - 2], in[i - 1], in[i], in[i + 1], in[i + 2])
                         : tap(at(x - 2), at(x - 1), at(x), at(x + 1), at(x + 2));
        }
    }
    Image<float> result(width, height);
    for (int y = 0; y < height; ++y) {
        std::array<std::span<const float>, 5> in;
        for (int j = -2; j <= 2; ++j)
            in[static_cast<std::size_t>(j + 2)] = rows.row(std::clamp(y + j, 0, height - 1));
        const std::span<float> out = result.row(y);
        for (std::size_t x = 0; x < out.size(); ++x)
            out[x] = (in[0][x] + in[4][x] + 4.0f * (in[1][x] + in[3][x]) + 6.0f * in[2][x]) *
                     (1.0f / 16.0f);
    }
    return result;
}

/// The points of one block with the strongest gradients, `most` at most, in their order.
void choosePoints(const Image<float>& a,
                  int block,
                  int most,
                  std::vector<RegistrationLevel::Point>& points)
{
    const int usable_width = a.width() - 2 * kMargin;
    const int usable_height = a.height() - 2 * kMargin;
    const auto edge = [&](int index, int length) {
        return kMargin + length * index / kBlocksASide;
    };
    const int bx = block % kBlocksASide;
    const int by = block / kBlocksASide;
    std::vector<RegistrationLevel::Point> here;
    std::vector<float> strengths;
    for (int y = edge(by, usable_height); y < edge(by + 1, usable_height); ++y) {
        for (int x = edge(bx, usable_width); x < edge(bx + 1, usable_width); ++x) {
            const float gx = 0.5f * (a(x + 1, y) - a(x - 1, y));
            const float gy = 0.5f * (a(x, y + 1) - a(x, y - 1));
            const float strength = gx * gx + gy * gy;
            if (!(strength > 0.0f)) continue;
            here.push_back({static_cast<float>(x), static_cast<float>(y), a(x, y), gx, gy, block});
            strengths.push_back(strength);
        }
    }
    float least = 0.0f;
    if (static_cast<int>(strengths.size()) > most) {
        const auto rank = strengths.begin() + most;
        std::nth_element(strengths.begin(), rank, strengths.end(), std::greater<>());
        least = *rank;
    }
    for (const RegistrationLevel::Point& point : here)
        if (point.gradient_x * point.gradient_x + point.gradient_y * point.gradient_y > least)
            points.push_back(point);
}

}  // namespace

RegistrationLevel makeLevel(const Image<float>& a, const Image<float>& b, double scale)
{
    RegistrationLevel level;
    level.a = smoothed(a);
    level.b = smoothed(b);
    level.scale = scale;
    level.blocks = kBlocksASide * kBlocksASide;
    for (int block = 0; block < level.blocks; ++block)
        choosePoints(level.a, block, kMostPoints / level.blocks, level.points);
    return level;
}

}  // namespace insitu::detail
