#include "composite/tonemap/acuity_pyramid.h"

#include "core/parallel.h"

#include <algorithm>

namespace insitu::tonemap {

namespace {

Image<Rgb> halved(const Image<Rgb>& image)
{
    Image<Rgb> half((image.width() + 1) / 2, (image.height() + 1) / 2);
    parallelFor(0, half.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        const auto above = image.row(2 * y);
        const auto below = image.row(std::min(2 * y + 1, image.height() - 1));
        for (int x = 0; x < half.width(); ++x) {
            const auto left = static_cast<std::size_t>(2 * x);
            const auto right = static_cast<std::size_t>(std::min(2 * x + 1, image.width() - 1));
            half(x, y) = 0.25f * (above[left] + above[right] + below[left] + below[right]);
        }
    });
    return half;
}

/// Bilinear at (u, v), continuous coordinates, clamped.
Rgb bilinear(const Image<Rgb>& image, float u, float v)
{
    const float fx = std::clamp(u - 0.5f, 0.0f, static_cast<float>(image.width() - 1));
    const float fy = std::clamp(v - 0.5f, 0.0f, static_cast<float>(image.height() - 1));
    const int x0 = static_cast<int>(fx);
    const int y0 = static_cast<int>(fy);
    const int x1 = std::min(x0 + 1, image.width() - 1);
    const int y1 = std::min(y0 + 1, image.height() - 1);
    const float tx = fx - static_cast<float>(x0);
    const float ty = fy - static_cast<float>(y0);
    const Rgb top = image(x0, y0) + tx * (image(x1, y0) - image(x0, y0));
    const Rgb bottom = image(x0, y1) + tx * (image(x1, y1) - image(x0, y1));
    return top + ty * (bottom - top);
}

}  // namespace

AcuityPyramid::AcuityPyramid(const Image<Rgb>& scene, int levels) : scene_(scene)
{
    for (int level = 0; level < levels; ++level) {
        const Image<Rgb>& finer = at(level);
        if (finer.width() == 1 && finer.height() == 1) break;
        halved_.push_back(halved(finer));
    }
}

const Image<Rgb>& AcuityPyramid::at(int level) const
{
    return level == 0 ? scene_ : halved_[static_cast<std::size_t>(level - 1)];
}

Rgb AcuityPyramid::sample(int x, int y, float level) const
{
    if (level <= 0.0f) return scene_(x, y);
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
