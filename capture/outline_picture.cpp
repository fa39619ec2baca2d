#include "capture/outline_picture.h"

#include "capture/probe_checks.h"
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace insitu::detail {

namespace {

/// Radiance below this share of the median counts little in the logarithm: it is noise.
constexpr float kDarkShare = 0.05f;
/// Noise that is always there: a unit of the last place of logarithms worth telling apart, and half
/// a code of eight bits.
constexpr float kLeastLogNoise = 0.005f;
constexpr float kLeastCodeNoise = 0.002f;
/// Codes above this are clipped, or bent by the camera on their way there.
constexpr float kClipped = 0.98f;

float medianOfPositive(const Image<Rgb>& radiance)
{
    std::vector<float> values;
    const std::size_t step = std::max<std::size_t>(radiance.pixelCount() / 100'000, 1);
    for (std::size_t i = 0; i < radiance.pixelCount(); i += step) {
        const Rgb pixel = radiance.pixels()[i];
        const float mean = (pixel.r + pixel.g + pixel.b) / 3.0f;
        if (mean > 0.0f) values.push_back(mean);
    }
    if (values.empty()) return 1.0f;
    std::ranges::nth_element(values,
                             values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
    return values[values.size() / 2];
}

}  // namespace

OutlinePicture::OutlinePicture(const Image<Rgb>& radiance)
    : width_(radiance.width()), height_(radiance.height()), least_noise_(kLeastLogNoise)
{
    checkRadiance(radiance);
    const float dark = std::max(kDarkShare * medianOfPositive(radiance), 1e-30f);
    auto logarithm = std::make_shared<Image<Rgb>>(width_, height_);
    parallelFor(0, height_, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width_; ++x)
            (*logarithm)(x, y) = glm::log(1.0f + glm::max(radiance(x, y), 0.0f) / dark);
    });
    frames_.push_back([logarithm](int x, int y) { return (*logarithm)(x, y); });
    measureNoise();
}

OutlinePicture::OutlinePicture(const Bracket& bracket) : least_noise_(kLeastCodeNoise)
{
    if (bracket.frames.empty() || bracket.frames[0].image.codes.empty())
        throw InputError("ball outline", "the bracket has no picture");
    width_ = bracket.frames[0].image.codes.width();
    height_ = bracket.frames[0].image.codes.height();
    for (const BracketFrame& frame : bracket.frames) {
        const float scale = 1.0f / static_cast<float>(frame.image.max_code);
        frames_.push_back([&codes = frame.image.codes, scale](int x, int y) {
            return glm::min(scale * Rgb(codes(x, y)), kClipped);
        });
    }
    measureNoise();
}

OutlinePicture::OutlinePicture(int width, int height, std::vector<Frame> frames, float least_noise)
    : width_(width), height_(height), least_noise_(least_noise), frames_(std::move(frames))
{
    measureNoise();
}

Rgb OutlinePicture::sample(std::size_t frame, glm::dvec2 pixel) const
{
    const double fx = std::clamp(pixel.x - 0.5, 0.0, static_cast<double>(width_ - 1));
    const double fy = std::clamp(pixel.y - 0.5, 0.0, static_cast<double>(height_ - 1));
    const int x0 = static_cast<int>(fx);
    const int y0 = static_cast<int>(fy);
    const int x1 = std::min(x0 + 1, width_ - 1);
    const int y1 = std::min(y0 + 1, height_ - 1);
    const auto tx = static_cast<float>(fx - x0);
    const auto ty = static_cast<float>(fy - y0);
    return glm::mix(glm::mix(at(frame, x0, y0), at(frame, x1, y0), tx),
                    glm::mix(at(frame, x0, y1), at(frame, x1, y1), tx),
                    ty);
}

// The median of second differences, whose variance is 6 times a pixel's: edges hardly move it.
void OutlinePicture::measureNoise()
{
    const int step = std::max(std::max(width_, height_) / 300, 1);
    noise_.assign(frames_.size(), Rgb(least_noise_));
    parallelFor(0, static_cast<std::int64_t>(frames_.size()), [&](std::int64_t index) {
        const auto f = static_cast<std::size_t>(index);
        std::array<std::vector<float>, 3> differences;
        for (int y = 0; y < height_; y += step) {
            for (int x = 1; x + 1 < width_; x += step) {
                const Rgb d = at(f, x - 1, y) - 2.0f * at(f, x, y) + at(f, x + 1, y);
                for (int c = 0; c < 3; ++c)
                    differences[static_cast<std::size_t>(c)].push_back(std::abs(d[c]));
            }
        }
        for (int c = 0; c < 3; ++c) {
            std::vector<float>& list = differences[static_cast<std::size_t>(c)];
            if (list.empty()) continue;
            const auto middle = list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2);
            std::ranges::nth_element(list, middle);
            noise_[f][c] = std::max(1.4826f * *middle / std::sqrt(6.0f), least_noise_);
        }
    });
}

OutlinePicture OutlinePicture::reduced(int factor) const
{
    const int width = width_ / factor;
    const int height = height_ / factor;
    std::vector<Frame> small;
    for (std::size_t f = 0; f < frames(); ++f) {
        auto image = std::make_shared<Image<Rgb>>(width, height);
        parallelFor(0, height, [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width; ++x) {
                Rgb sum(0.0f);
                for (int j = 0; j < factor; ++j)
                    for (int i = 0; i < factor; ++i)
                        sum += at(f, x * factor + i, y * factor + j);
                (*image)(x, y) = sum / static_cast<float>(factor * factor);
            }
        });
        small.push_back([image](int x, int y) { return (*image)(x, y); });
    }
    return {width, height, std::move(small), least_noise_};
}

}  // namespace insitu::detail
