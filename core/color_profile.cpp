#include "core/color_profile.h"

#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace insitu {

bool sameColors(const ColorProfile& a, const ColorProfile& b, double tolerance)
{
    if (a.transfer.exposure != b.transfer.exposure) return false;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            if (std::abs(a.rec709_from_linear[column][row] - b.rec709_from_linear[column][row]) >
                tolerance)
                return false;
    return true;
}

double convertPixels(Image<Rgb>& linear, const glm::dmat3& to_from_linear)
{
    if (to_from_linear == glm::dmat3(1.0) || linear.empty()) return 0.0;
    constexpr float kOutside = 0.01f;
    const glm::mat3 matrix(to_from_linear);
    std::atomic<std::size_t> outside{0};
    parallelFor(0, linear.height(), [&](std::int64_t row) {
        std::size_t count = 0;
        for (Rgb& pixel : linear.row(static_cast<int>(row))) {
            const Rgb converted = matrix * pixel;
            const float least = std::min({converted.r, converted.g, converted.b});
            const float largest = std::max({converted.r, converted.g, converted.b});
            count += least < -kOutside * largest ? 1 : 0;
            pixel = glm::max(converted, Rgb(0.0f));
        }
        outside.fetch_add(count);
    });
    return static_cast<double>(outside) / static_cast<double>(linear.pixelCount());
}

}  // namespace insitu
