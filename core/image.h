#pragma once

#include "core/check.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// A two-dimensional array of pixels, rows contiguous, row 0 on top.
///
/// Continuous coordinates: (0,0) is the corner of the top-left pixel, pixel (x, y) has its centre
/// at (x + 0.5, y + 0.5). Width and height are >= 0; an empty image has both 0.
template <class Pixel>
class Image {
public:
    Image() = default;
    Image(int width, int height, Pixel fill = Pixel{}) : width_(width), height_(height)
    {
        INSITU_CHECK(width >= 0 && height >= 0, "{}x{}", width, height);
        pixels_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), fill);
    }

    [[nodiscard]] int width() const { return width_; }
    [[nodiscard]] int height() const { return height_; }
    [[nodiscard]] bool empty() const { return pixels_.empty(); }
    [[nodiscard]] std::size_t pixelCount() const { return pixels_.size(); }
    template <class Other>
    [[nodiscard]] bool sameSize(const Image<Other>& other) const
    {
        return width_ == other.width() && height_ == other.height();
    }

    [[nodiscard]] Pixel& operator()(int x, int y) { return pixels_[index(x, y)]; }
    [[nodiscard]] const Pixel& operator()(int x, int y) const { return pixels_[index(x, y)]; }

    [[nodiscard]] std::span<Pixel> row(int y) { return {&pixels_[index(0, y)], rowLength()}; }
    [[nodiscard]] std::span<const Pixel> row(int y) const
    {
        return {&pixels_[index(0, y)], rowLength()};
    }
    [[nodiscard]] std::span<Pixel> pixels() { return pixels_; }
    [[nodiscard]] std::span<const Pixel> pixels() const { return pixels_; }

    bool operator==(const Image&) const = default;

private:
    [[nodiscard]] std::size_t rowLength() const { return static_cast<std::size_t>(width_); }
    [[nodiscard]] std::size_t index(int x, int y) const
    {
        INSITU_DCHECK(x >= 0 && x < width_ && y >= 0 && y < height_, "({}, {})", x, y);
        return static_cast<std::size_t>(y) * rowLength() + static_cast<std::size_t>(x);
    }

    int width_ = 0;
    int height_ = 0;
    std::vector<Pixel> pixels_;
};

/// Linear colour, working primaries (core/color.h).
using Rgb = glm::vec3;

/// Bilinear look-up at continuous coordinates, clamped to the image's edge pixels.
template <class Pixel>
[[nodiscard]] Pixel sampleBilinear(const Image<Pixel>& image, double x, double y)
{
    const double fx = std::clamp(x - 0.5, 0.0, static_cast<double>(image.width() - 1));
    const double fy = std::clamp(y - 0.5, 0.0, static_cast<double>(image.height() - 1));
    const int x0 = static_cast<int>(fx);
    const int y0 = static_cast<int>(fy);
    const int x1 = std::min(x0 + 1, image.width() - 1);
    const int y1 = std::min(y0 + 1, image.height() - 1);
    const float tx = static_cast<float>(fx - x0);
    const float ty = static_cast<float>(fy - y0);
    return (image(x0, y0) * (1.0f - tx) + image(x1, y0) * tx) * (1.0f - ty) +
           (image(x0, y1) * (1.0f - tx) + image(x1, y1) * tx) * ty;
}

}  // namespace insitu
