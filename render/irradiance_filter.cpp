#include "render/irradiance_filter.h"

#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

/// B3 spline, [Dammertz10] section 2.
constexpr std::array<float, 5> kKernel = {1.0f / 16, 1.0f / 4, 3.0f / 8, 1.0f / 4, 1.0f / 16};
/// Half side of the square over which variances are averaged, pixels.
constexpr int kVarianceReach = 3;

/// Mean over a square of the same surface, or its own when larger. A variance estimated from few
/// samples is noisy itself: a pixel that drew no light by chance would seem certain of its
/// darkness.
Image<float> smoothedVariance(const Image<float>& variance, const Image<std::int32_t>& surface)
{
    const int width = variance.width();
    const int height = variance.height();
    Image<float> smooth(width, height);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            float sum = 0.0f;
            float count = 0.0f;
            for (int qy = std::max(0, y - kVarianceReach);
                 qy <= std::min(height - 1, y + kVarianceReach);
                 ++qy) {
                for (int qx = std::max(0, x - kVarianceReach);
                     qx <= std::min(width - 1, x + kVarianceReach);
                     ++qx) {
                    if (surface(qx, qy) != surface(x, y)) continue;
                    sum += variance(qx, qy);
                    count += 1.0f;
                }
            }
            smooth(x, y) = std::max(variance(x, y), sum / count);
        }
    });
    return smooth;
}

void filterLevel(Image<Rgb>& values,
                 Image<float>& variance,
                 const Image<std::int32_t>& surface,
                 int step,
                 float range_sigmas)
{
    const int width = values.width();
    const int height = values.height();
    const Image<float> noise = smoothedVariance(variance, surface);
    Image<Rgb> filtered = values;
    Image<float> filtered_variance = variance;
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (surface(x, y) < 0) continue;
            const float center = luminance(values(x, y));
            const float reach = range_sigmas * std::sqrt(noise(x, y)) + 1e-12f;
            Rgb sum(0.0f);
            float variance_sum = 0.0f;
            float weights = 0.0f;
            for (int j = -2; j <= 2; ++j) {
                const int qy = y + j * step;
                if (qy < 0 || qy >= height) continue;
                for (int i = -2; i <= 2; ++i) {
                    const int qx = x + i * step;
                    if (qx < 0 || qx >= width || surface(qx, qy) != surface(x, y)) continue;
                    const float off = (luminance(values(qx, qy)) - center) / reach;
                    const float w = kKernel[static_cast<std::size_t>(i + 2)] *
                                    kKernel[static_cast<std::size_t>(j + 2)] *
                                    std::exp(-0.5f * off * off);
                    sum += w * values(qx, qy);
                    variance_sum += w * w * variance(qx, qy);
                    weights += w;
                }
            }
            filtered(x, y) = sum / weights;
            filtered_variance(x, y) = variance_sum / (weights * weights);
        }
    });
    values = std::move(filtered);
    variance = std::move(filtered_variance);
}

}  // namespace

void filterIrradiance(Image<Rgb>& values,
                      Image<float>& variance,
                      const Image<std::int32_t>& surface,
                      const IrradianceFilterOptions& options)
{
    INSITU_CHECK(values.sameSize(variance) && values.sameSize(surface),
                 "{}x{} values",
                 values.width(),
                 values.height());
    for (int level = 0; level < options.levels; ++level)
        filterLevel(
            values, variance, surface, 1 << level, static_cast<float>(options.range_sigmas));
}

}  // namespace insitu
