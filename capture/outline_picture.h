#pragma once

#include "capture/bracket.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <functional>
#include <vector>

namespace insitu::detail {

/// What the outline search looks at: frames of values in which equal contrast means about equal
/// visibility (logarithm of radiance, or a camera's codes in [0, 1]), with their noise. Refers to
/// the picture it was made from.
class OutlinePicture {
public:
    /// InputError when empty or not finite.
    explicit OutlinePicture(const Image<Rgb>& radiance);
    explicit OutlinePicture(const Bracket& bracket);

    [[nodiscard]] int width() const { return width_; }
    [[nodiscard]] int height() const { return height_; }
    [[nodiscard]] std::size_t frames() const { return frames_.size(); }
    [[nodiscard]] Rgb at(std::size_t frame, int x, int y) const { return frames_[frame](x, y); }
    /// Bilinear, clamped at the picture's edge.
    [[nodiscard]] Rgb sample(std::size_t frame, glm::dvec2 pixel) const;
    [[nodiscard]] bool contains(glm::dvec2 pixel) const
    {
        return pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= width_ && pixel.y <= height_;
    }
    /// Standard deviation of a pixel's noise by channel, never below that of rounding.
    [[nodiscard]] Rgb noise(std::size_t frame) const { return noise_[frame]; }
    /// Means over blocks of `factor` x `factor` pixels; remainders at the right and below are cut.
    [[nodiscard]] OutlinePicture reduced(int factor) const;

private:
    using Frame = std::function<Rgb(int x, int y)>;

    OutlinePicture(int width, int height, std::vector<Frame> frames, float least_noise);
    void measureNoise();

    int width_ = 0;
    int height_ = 0;
    float least_noise_ = 0.0f;
    std::vector<Frame> frames_;
    std::vector<Rgb> noise_;
};

}  // namespace insitu::detail
