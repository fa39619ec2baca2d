#pragma once

#include "core/environment_map.h"
#include "core/parallel.h"

#include <cmath>
#include <numbers>
#include <type_traits>

namespace insitu::detail {

/// Calls `visit(direction)` for n x n places of equal solid angle in a texel of an equirectangular
/// map.
template <class Visit>
void forEachPlace(int width, glm::ivec2 texel, int n, const Visit& visit)
{
    using std::numbers::pi;
    const int height = width / 2;
    const double top = std::cos(pi * texel.y / height);
    const double bottom = std::cos(pi * (texel.y + 1) / height);
    for (int j = 0; j < n; ++j) {
        const double cosine = top + (bottom - top) * (j + 0.5) / n;
        const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));
        for (int i = 0; i < n; ++i) {
            const double azimuth = 2.0 * pi * ((texel.x + (i + 0.5) / n) / width - 0.5);
            visit(glm::dvec3(sine * std::sin(azimuth), cosine, -sine * std::cos(azimuth)));
        }
    }
}

/// Direction of the middle of a texel of an equirectangular map.
[[nodiscard]] inline glm::dvec3 middleOfTexel(int width, glm::ivec2 texel)
{
    return environmentDirectionFromUv({(texel.x + 0.5) / width, (texel.y + 0.5) / (width / 2)});
}

/// Fills an equirectangular map: every texel is the mean of `value(direction)`, a vector of floats,
/// over n x n places of equal solid angle, n = `places(direction of the texel's centre)`. Rows in
/// parallel.
template <class Places, class Value>
[[nodiscard]] auto averageOverTexels(int width, Places places, Value value)
{
    using Vector = std::invoke_result_t<Value, glm::dvec3>;
    using Sum = glm::vec<Vector::length(), double, glm::defaultp>;
    const int height = width / 2;
    Image<Vector> map(width, height);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            const int n = places(middleOfTexel(width, {x, y}));
            Sum sum(0.0);
            forEachPlace(width, {x, y}, n, [&](glm::dvec3 d) { sum += Sum(value(d)); });
            map(x, y) = Vector(sum / static_cast<double>(n * n));
        }
    });
    return map;
}

/// The smallest usual width of a map whose texels are not wider than `radians`.
[[nodiscard]] inline int widthForResolution(double radians)
{
    for (const int width : {256, 512, 768, 1024, 1536, 2048, 3072})
        if (2.0 * std::numbers::pi / width <= radians) return width;
    return 4096;
}

}  // namespace insitu::detail
