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

/// Sums of values and their weights.
struct Cell {
    float sum = 0.0f;
    float weight = 0.0f;
};

class Grid {
public:
    Grid(const Image<float>& values, double spatial_sigma, double range_sigma)
        : values_(values),
          cell_px_(spatial_sigma / std::sqrt(kVarianceInCells)),
          cell_value_(range_sigma / std::sqrt(kVarianceInCells))
    {
        const auto [low, high] =
            std::minmax_element(values.pixels().begin(), values.pixels().end());
        low_ = *low;
        const auto cells = [](double extent, double cell) {
            return static_cast<int>(std::ceil(extent / cell)) + 1 + 2 * kPad;
        };
        size_ = {cells(*high - low_, cell_value_),
                 cells(values.width(), cell_px_),
                 cells(values.height(), cell_px_)};
        cells_.resize(static_cast<std::size_t>(size_[0]) * static_cast<std::size_t>(size_[1]) *
                      static_cast<std::size_t>(size_[2]));
        fill();
        for (std::size_t axis = 0; axis < 3; ++axis)
            blur(axis);
    }

    /// Linear look-up at a pixel and its value.
    [[nodiscard]] float at(int x, int y) const
    {
        const std::array<double, 3> place = placeOf(x, y);
        std::array<int, 3> low{};
        std::array<float, 3> share{};
        for (std::size_t a = 0; a < 3; ++a) {
            low[a] = std::clamp(static_cast<int>(place[a]), 0, size_[a] - 2);
            share[a] = static_cast<float>(place[a] - low[a]);
        }
        Cell total;
        for (int corner = 0; corner < 8; ++corner) {
            float w = 1.0f;
            std::array<int, 3> i = low;
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
        return total.weight > 0.0f ? total.sum / total.weight : values_(x, y);
    }

private:
    [[nodiscard]] std::array<double, 3> placeOf(int x, int y) const
    {
        return {(values_(x, y) - low_) / cell_value_ + kPad,
                (x + 0.5) / cell_px_ + kPad,
                (y + 0.5) / cell_px_ + kPad};
    }
    [[nodiscard]] std::size_t index(const std::array<int, 3>& i) const
    {
        return (static_cast<std::size_t>(i[2]) * static_cast<std::size_t>(size_[1]) +
                static_cast<std::size_t>(i[1])) *
                   static_cast<std::size_t>(size_[0]) +
               static_cast<std::size_t>(i[0]);
    }
    void fill()
    {
        for (int y = 0; y < values_.height(); ++y)
            for (int x = 0; x < values_.width(); ++x) {
                std::array<int, 3> i{};
                const std::array<double, 3> place = placeOf(x, y);
                for (std::size_t a = 0; a < 3; ++a)
                    i[a] = std::min(static_cast<int>(place[a] + 0.5), size_[a] - 1);
                Cell& cell = cells_[index(i)];
                cell.sum += values_(x, y);
                cell.weight += 1.0f;
            }
    }
    void blur(std::size_t axis)
    {
        const std::vector<Cell> from = cells_;
        const std::array<std::ptrdiff_t, 3> strides = {
            1, size_[0], static_cast<std::ptrdiff_t>(size_[0]) * size_[1]};
        parallelFor(0, size_[2], [&](std::int64_t z) {
            std::array<int, 3> i{};
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

    const Image<float>& values_;
    double cell_px_;
    double cell_value_;
    double low_ = 0.0;
    std::array<int, 3> size_{};  ///< values, x, y
    std::vector<Cell> cells_;
};

}  // namespace

Image<float> bilateralFilter(const Image<float>& values, double spatial_sigma, double range_sigma)
{
    INSITU_CHECK(spatial_sigma > 0.0 && range_sigma > 0.0, "{} {}", spatial_sigma, range_sigma);
    Image<float> result(values.width(), values.height());
    if (values.empty()) return result;
    const Grid grid(values, spatial_sigma, range_sigma);
    parallelFor(0, values.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < values.width(); ++x)
            result(x, y) = grid.at(x, y);
    });
    return result;
}

}  // namespace insitu::tonemap
