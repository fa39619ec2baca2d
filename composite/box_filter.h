#pragma once

#include "core/image.h"
#include "core/parallel.h"

#include <algorithm>

namespace insitu {

/// Mean over a square window (odd side, clamped at the border), by separable running sums in `Sum`,
/// a type of double precision. Private to this module.
template <class Sum, class Pixel>
Image<Pixel> boxFilter(const Image<Pixel>& image, int window)
{
    const int radius = window / 2;
    const auto pass = [&](const Image<Pixel>& from, bool horizontal) {
        Image<Pixel> to(from.width(), from.height());
        const int lines = horizontal ? from.height() : from.width();
        const int length = horizontal ? from.width() : from.height();
        parallelFor(0, lines, [&](std::int64_t line) {
            const int l = static_cast<int>(line);
            const auto at = [&](int i) {
                const int k = std::clamp(i, 0, length - 1);
                return Sum(horizontal ? from(k, l) : from(l, k));
            };
            Sum sum(0.0);
            for (int i = -radius; i <= radius; ++i)
                sum += at(i);
            for (int i = 0; i < length; ++i) {
                (horizontal ? to(i, l) : to(l, i)) =
                    static_cast<Pixel>(sum / static_cast<double>(2 * radius + 1));
                sum += at(i + radius + 1) - at(i - radius);
            }
        });
        return to;
    };
    return pass(pass(image, true), false);
}

}  // namespace insitu
