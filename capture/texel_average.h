#pragma once

#include "core/environment_map.h"
#include "core/parallel.h"

#include <cmath>
#include <numbers>

namespace insitu::detail {

/// Fills an equirectangular map: every texel is the mean of `radiance(direction)` over n x n
/// places of equal solid angle, n = `places(direction of the texel's centre)`. Rows in parallel.
template <class Places, class Radiance>
[[nodiscard]] EnvironmentMap averageOverTexels(int width, Places places, Radiance radiance)
{
    using std::numbers::pi;
    const int height = width / 2;
    EnvironmentMap map;
    map.pixels = Image<Rgb>(width, height);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        const double top = std::cos(pi * y / height);
        const double bottom = std::cos(pi * (y + 1) / height);
        for (int x = 0; x < width; ++x) {
            const glm::dvec3 middle =
                environmentDirectionFromUv({(x + 0.5) / width, (y + 0.5) / height});
            const int n = places(middle);
            glm::dvec3 sum(0.0);
            for (int j = 0; j < n; ++j) {
                const double cosine = top + (bottom - top) * (j + 0.5) / n;
                const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));
                for (int i = 0; i < n; ++i) {
                    const double azimuth = 2.0 * pi * ((x + (i + 0.5) / n) / width - 0.5);
                    sum += glm::dvec3(radiance(
                        glm::dvec3(sine * std::sin(azimuth), cosine, -sine * std::cos(azimuth))));
                }
            }
            map.pixels(x, y) = Rgb(sum / static_cast<double>(n * n));
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
