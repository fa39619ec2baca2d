#include "composite/tonemap/bilateral_grid.h"

#include "core/check.h"
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace insitu::tonemap {

namespace {

/// Variance in cells of five taps 1 4 6 4 1 (1), of rounding to a cell (1/12) and of the triangle
/// that linear look-up is (1/6).
constexpr double kVarianceInCells = 1.0 + 1.0 / 12.0 + 1.0 / 6.0;
constexpr int kPad = 2;
constexpr std::array<float, 3> kTaps = {6.0f / 16.0f, 4.0f / 16.0f, 1.0f / 16.0f};

}  // namespace

BilateralGrid::BilateralGrid(const Extent& extent, double spatial_sigma, double range_sigma)
    : cell_px_(spatial_sigma / std::sqrt(kVarianceInCells)),
      cell_value_(range_sigma / std::sqrt(kVarianceInCells)),
      low_(extent.low)
{
    INSITU_CHECK(spatial_sigma > 0.0 && range_sigma > 0.0, "{} {}", spatial_sigma, range_sigma);
    const auto cells = [](double length, double cell) {
        return static_cast<int>(std::ceil(length / cell)) + 1 + 2 * kPad;
    };
    size_ = {cells(extent.high - extent.low, cell_value_),
             cells(extent.width, cell_px_),
             cells(extent.height, cell_px_)};
    cells_.resize(static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]) *
                  static_cast<std::size_t>(size_[2]));
}

std::array<double, 3> BilateralGrid::placeOf(int x, int y, float value) const
{
    const double last = size_[0] - 1 - kPad;
    return {std::clamp((value - low_) / cell_value_ + kPad, double{kPad}, last),
            (x + 0.5) / cell_px_ + kPad,
            (y + 0.5) / cell_px_ + kPad};
}

std::size_t BilateralGrid::index(const Index& i) const
{
    return (static_cast<std::size_t>(i[2]) * static_cast<std::size_t>(size_[1]) +
            static_cast<std::size_t>(i[1])) *
               static_cast<std::size_t>(size_[0]) +
           static_cast<std::size_t>(i[0]);
}

void BilateralGrid::add(int y, const std::vector<float>& values)
{
    for (std::size_t x = 0; x < values.size(); ++x) {
        Index i{};
        const std::array<double, 3> place = placeOf(static_cast<int>(x), y, values[x]);
        for (std::size_t a = 0; a < 3; ++a)
            i[a] = std::min(static_cast<int>(place[a] + 0.5), size_[a] - 1);
        Cell& cell = cells_[index(i)];
        cell.sum += values[x];
        cell.weight += 1.0f;
    }
}

void BilateralGrid::blur()
{
    for (std::size_t axis = 0; axis < 3; ++axis)
        blurAlong(axis);
}

void BilateralGrid::blurAlong(std::size_t axis)
{
    const std::vector<Cell> from = cells_;
    const std::array<std::ptrdiff_t, 3> strides = {
        1, size_[0], static_cast<std::ptrdiff_t>(size_[0]) * size_[1]};
    parallelFor(0, size_[2], [&](std::int64_t z) {
        Index i{};
        i[2] = static_cast<int>(z);
        for (i[1] = 0; i[1] < size_[1]; ++i[1])
            for (i[0] = 0; i[0] < size_[0]; ++i[0]) {
                Cell total;
                for (int d = -2; d <= 2; ++d) {
                    const int at = i[axis] + d;
                    if (at < 0 || at >= size_[axis]) continue;
                    const Cell& cell = from[static_cast<std::size_t>(
                        static_cast<std::ptrdiff_t>(index(i)) + d * strides[axis])];
                    const float w = kTaps[static_cast<std::size_t>(std::abs(d))];
                    total.sum += w * cell.sum;
                    total.weight += w * cell.weight;
                }
                cells_[index(i)] = total;
            }
    });
}

float BilateralGrid::at(int x, int y, float value) const
{
    const std::array<double, 3> place = placeOf(x, y, value);
    Index low{};
    std::array<float, 3> share{};
    for (std::size_t a = 0; a < 3; ++a) {
        low[a] = std::clamp(static_cast<int>(place[a]), 0, size_[a] - 2);
        share[a] = static_cast<float>(place[a] - low[a]);
    }
    Cell total;
    for (int corner = 0; corner < 8; ++corner) {
        float w = 1.0f;
        Index i = low;
        for (std::size_t a = 0; a < 3; ++a) {
            const bool upper = (corner >> a & 1) != 0;
            w *= upper ? share[a] : 1.0f - share[a];
            i[a] += upper ? 1 : 0;
        }
        const Cell& cell = cells_[index(i)];
        total.sum += w * cell.sum;
        total.weight += w * cell.weight;
    }
    // The pixel itself is in there, unless rounding took all its weight.
    return total.weight > 0.0f ? total.sum / total.weight : value;
}

}  // namespace insitu::tonemap
