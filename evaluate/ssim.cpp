#include "evaluate/ssim.h"

#include "core/check.h"
#include "core/color.h"
#include "core/parallel.h"
#include "evaluate/picture_checks.h"

#include <array>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

constexpr int kWindow = 11;

std::array<double, kWindow> windowWeights()
{
    constexpr double kDeviation = 1.5;
    std::array<double, kWindow> weights{};
    double sum = 0.0;
    for (int i = 0; i < kWindow; ++i) {
        const double d = i - kWindow / 2;
        weights[static_cast<std::size_t>(i)] = std::exp(-0.5 * d * d / (kDeviation * kDeviation));
        sum += weights[static_cast<std::size_t>(i)];
    }
    for (double& weight : weights)
        weight /= sum;
    return weights;
}

/// Weighted sums of x, y, x², y², xy.
using Moments = std::array<double, 5>;

/// Columns of one row of windows, summed downwards.
std::vector<Moments> verticalSums(const Image<float>& reference,
                                  const Image<float>& picture,
                                  const std::array<double, kWindow>& weights,
                                  int top)
{
    std::vector<Moments> columns(static_cast<std::size_t>(reference.width()), Moments{});
    for (int k = 0; k < kWindow; ++k) {
        const double w = weights[static_cast<std::size_t>(k)];
        for (int x = 0; x < reference.width(); ++x) {
            const auto a = static_cast<double>(reference(x, top + k));
            const auto b = static_cast<double>(picture(x, top + k));
            Moments& m = columns[static_cast<std::size_t>(x)];
            m[0] += w * a;
            m[1] += w * b;
            m[2] += w * a * a;
            m[3] += w * b * b;
            m[4] += w * a * b;
        }
    }
    return columns;
}

double similarity(const Moments& m, double c1, double c2)
{
    const double variance_x = m[2] - m[0] * m[0];
    const double variance_y = m[3] - m[1] * m[1];
    const double covariance = m[4] - m[0] * m[1];
    return (2.0 * m[0] * m[1] + c1) * (2.0 * covariance + c2) /
           ((m[0] * m[0] + m[1] * m[1] + c1) * (variance_x + variance_y + c2));
}

}  // namespace

StructuralSimilarity structuralSimilarity(const Image<float>& reference,
                                          const Image<float>& picture,
                                          double range)
{
    requireComparable(reference, picture);
    if (reference.width() < kWindow || reference.height() < kWindow)
        throw InputError("structural similarity",
                         fmt::format("{}x{} pixels are too few; the window has 11x11",
                                     reference.width(),
                                     reference.height()));
    const double c1 = std::pow(0.01 * range, 2);
    const double c2 = std::pow(0.03 * range, 2);
    const auto weights = windowWeights();
    StructuralSimilarity result;
    result.map = Image<float>(reference.width() - kWindow + 1, reference.height() - kWindow + 1);
    std::vector<double> rows(static_cast<std::size_t>(result.map.height()), 0.0);
    parallelFor(0, result.map.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        const std::vector<Moments> columns = verticalSums(reference, picture, weights, y);
        for (int x = 0; x < result.map.width(); ++x) {
            Moments sums{};
            for (int k = 0; k < kWindow; ++k)
                for (std::size_t i = 0; i < sums.size(); ++i)
                    sums[i] += weights[static_cast<std::size_t>(k)] *
                               columns[static_cast<std::size_t>(x + k)][i];
            const double value = similarity(sums, c1, c2);
            result.map(x, y) = static_cast<float>(value);
            rows[static_cast<std::size_t>(y)] += value;
        }
    });
    double sum = 0.0;
    for (const double row : rows)
        sum += row;
    result.mean = sum / static_cast<double>(result.map.pixelCount());
    return result;
}

Image<float> encodedGrey(const Image<Rgb>& display)
{
    Image<float> grey(display.width(), display.height());
    parallelFor(0, display.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < display.width(); ++x) {
            const auto linear = static_cast<double>(luminance(display(x, y)));
            grey(x, y) = static_cast<float>(srgbFromLinear(std::clamp(linear, 0.0, 1.0)));
        }
    });
    return grey;
}

}  // namespace insitu
