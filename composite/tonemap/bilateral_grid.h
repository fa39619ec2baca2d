#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace insitu::tonemap {

/// Bilateral filter with Gaussians of deviation `spatial_sigma` pixels and `range_sigma`, in the
/// values' unit; outside the picture there is nothing. By a grid whose cells are so large that
/// spreading, blurring and looking up have these deviations together; it is small whatever the
/// picture. Source: [CheParDur07]. Private to this module.
class BilateralGrid {
public:
    struct Extent {
        int width = 0, height = 0;     ///< pixels
        double low = 0.0, high = 0.0;  ///< finite; values outside count as the nearest cell's
    };
    /// Both sigmas > 0.
    BilateralGrid(const Extent& extent, double spatial_sigma, double range_sigma);

    /// Adds a row's values, from the top. Sums are in order of the calls.
    void add(int y, const std::vector<float>& values);
    /// After the last row.
    void blur();
    /// The filtered value of a pixel that holds `value`: linear look-up.
    [[nodiscard]] float at(int x, int y, float value) const;

private:
    /// Sums of values and their weights.
    struct Cell {
        float sum = 0.0f;
        float weight = 0.0f;
    };
    using Index = std::array<int, 3>;

    [[nodiscard]] std::array<double, 3> placeOf(int x, int y, float value) const;
    [[nodiscard]] std::size_t index(const Index& i) const;
    void blurAlong(std::size_t axis);

    double cell_px_;
    double cell_value_;
    double low_;
    Index size_{};  ///< values, x, y
    std::vector<Cell> cells_;
};

}  // namespace insitu::tonemap
