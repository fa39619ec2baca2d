#pragma once

#include "core/check.h"
#include "core/image.h"

#include <cmath>

namespace insitu::detail {

/// Largest equirectangular map made: 16384 x 8192 texels are 1.6 GB.
inline constexpr int kMaxMapWidth = 16384;

/// InputError unless 0 (automatic) or an even number in [2, kMaxMapWidth].
inline void checkMapWidth(int width)
{
    if (width < 0 || width % 2 != 0 || width > kMaxMapWidth)
        throw InputError(
            "light probe",
            fmt::format(
                "a map {} wide: the width must be even and at most {}", width, kMaxMapWidth));
}

/// InputError for an empty picture and for NaN or infinity, with the pixel.
inline void checkRadiance(const Image<Rgb>& radiance)
{
    if (radiance.empty()) throw InputError("light probe", "the picture is empty");
    for (int y = 0; y < radiance.height(); ++y) {
        for (int x = 0; x < radiance.width(); ++x) {
            const Rgb pixel = radiance(x, y);
            if (!(std::isfinite(pixel.r) && std::isfinite(pixel.g) && std::isfinite(pixel.b)))
                throw InputError(
                    "light probe", fmt::format("({}, {})", x, y), "the radiance is not finite");
        }
    }
}

}  // namespace insitu::detail
