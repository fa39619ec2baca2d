#include "composite/tonemap/acuity_pyramid.h"

#include "core/parallel.h"

#include <algorithm>

namespace insitu::tonemap {

namespace {

/// The rows of the next level that are complete in the strip.
Image<Rgb> halved(const SceneStrip& strip)
{
    const int rows =
        strip.end() == strip.height ? (strip.rows.height() + 1) / 2 : strip.rows.height() / 2;
    Image<Rgb> half((strip.width() + 1) / 2, rows);
    parallelFor(0, half.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        const auto above = strip.rows.row(2 * y);
        const auto below = strip.rows.row(std::min(2 * y + 1, strip.rows.height() - 1));
        for (int x = 0; x < half.width(); ++x) {
            const auto left = static_cast<std::size_t>(2 * x);
            const auto right = static_cast<std::size_t>(std::min(2 * x + 1, strip.width() - 1));
            half(x, y) = 0.25f * (above[left] + above[right] + below[left] + below[right]);
        }
    });
    return half;
}

/// Bilinear at (u, v), continuous coordinates, clamped.
Rgb bilinear(const SceneStrip& image, float u, float v)
{
    const float fx = std::clamp(u - 0.5f, 0.0f, static_cast<float>(image.width() - 1));
    const float fy = std::clamp(v - 0.5f, 0.0f, static_cast<float>(image.height - 1));
    const int x0 = static_cast<int>(fx);
    const int y0 = static_cast<int>(fy);
    const int x1 = std::min(x0 + 1, image.width() - 1);
    const int y1 = std::min(y0 + 1, image.height - 1);
    const float tx = fx - static_cast<float>(x0);
    const float ty = fy - static_cast<float>(y0);
    const Rgb top = image(x0, y0) + tx * (image(x1, y0) - image(x0, y0));
    const Rgb bottom = image(x0, y1) + tx * (image(x1, y1) - image(x0, y1));
    return top + ty * (bottom - top);
}

}  // namespace

AcuityPyramid::AcuityPyramid(const SceneStrip& strip, int levels) : strip_(strip)
{
    for (int level = 0; level < levels; ++level) {
        const SceneStrip finer = at(level);
        if (finer.width() == 1 && finer.height == 1) break;
        INSITU_CHECK(finer.first % 2 == 0, "level {} begins at row {}", level, finer.first);
        halved_.push_back({halved(finer), finer.first / 2, (finer.height + 1) / 2});
    }
}

SceneStrip AcuityPyramid::at(int level) const
{
    if (level == 0) return strip_;
    const Level& halved = halved_[static_cast<std::size_t>(level - 1)];
    return {halved.rows, halved.first, halved.height};
}

Rgb AcuityPyramid::sample(int x, int y, float level) const
{
    if (level <= 0.0f) return strip_(x, y);
    const int coarsest = static_cast<int>(halved_.size());
    const int finer = std::min(static_cast<int>(level), coarsest);
    const int coarser = std::min(finer + 1, coarsest);
    const float share = std::min(level - static_cast<float>(finer), 1.0f);
    const auto valueAt = [&](int l) {
        const float size = 1.0f / static_cast<float>(1 << l);
        return bilinear(
            at(l), (static_cast<float>(x) + 0.5f) * size, (static_cast<float>(y) + 0.5f) * size);
    };
    const Rgb fine = valueAt(finer);
    return fine + share * (valueAt(coarser) - fine);
}

}  // namespace insitu::tonemap
