#pragma once

#include "capture/bracket.h"
#include "core/random.h"
#include "core/response_curve.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace insitu {

/// A camera whose every step is known.
struct SyntheticCamera {
    /// Exposure in [0, 1] (1 = full scale) -> code in [0, 1], per channel.
    std::function<double(int channel, double exposure)> curve;
    /// Variance of the exposure: read + shot * exposure.
    double read_variance = 0.0;
    double shot_variance = 0.0;
    int max_code = 255;
    std::uint64_t seed = 1;
};

/// A camera with a toe and a shoulder of its own for each channel, exposure^power at the dark end:
/// bright codes span wide steps of exposure.
inline SyntheticCamera shoulderCamera(double power, double shot, double read, int max_code = 255)
{
    SyntheticCamera camera;
    camera.curve = [power](int c, double e) {
        const double knee = 0.35 + 0.1 * c;
        const double p = std::pow(e, power);
        return (1.0 + knee) * p / (p + knee);
    };
    camera.shot_variance = shot;
    camera.read_variance = read;
    camera.max_code = max_code;
    return camera;
}

/// Photographs `radiance` with each of the exposures, seconds.
inline Bracket photograph(const Image<Rgb>& radiance,
                          const std::vector<double>& seconds,
                          const SyntheticCamera& camera)
{
    std::vector<BracketFrame> frames;
    for (std::size_t k = 0; k < seconds.size(); ++k) {
        BracketFrame frame;
        frame.name = fmt::format("frame_{}", k);
        frame.relative_exposure = seconds[k];
        frame.image.max_code = camera.max_code;
        frame.image.codes = Image<glm::u16vec3>(radiance.width(), radiance.height());
        for (int y = 0; y < radiance.height(); ++y) {
            RandomStream random(camera.seed, static_cast<std::uint64_t>(y), k);
            for (int x = 0; x < radiance.width(); ++x) {
                for (int c = 0; c < 3; ++c) {
                    double e = static_cast<double>(radiance(x, y)[c]) * seconds[k];
                    e += random.normal() *
                         std::sqrt(camera.read_variance + camera.shot_variance * e);
                    const double code = camera.curve(c, std::clamp(e, 0.0, 1.0));
                    frame.image.codes(x, y)[c] =
                        static_cast<std::uint16_t>(std::lround(code * camera.max_code));
                }
            }
        }
        frames.push_back(std::move(frame));
    }
    return makeBracket(std::move(frames));
}

/// The camera's curve as a table, by bisection; exposure[c][255] = 1.
inline ResponseCurve tableOf(const SyntheticCamera& camera)
{
    ResponseCurve table;
    table.source = "truth";
    for (int c = 0; c < 3; ++c) {
        for (int z = 0; z < 256; ++z) {
            double low = 0.0;
            double high = 1.0;
            for (int i = 0; i < 60; ++i) {
                const double middle = 0.5 * (low + high);
                (camera.curve(c, middle) * 255.0 < z ? low : high) = middle;
            }
            table.exposure[static_cast<std::size_t>(c)][static_cast<std::size_t>(z)] = high;
        }
    }
    return table;
}

/// Flat tiles whose radiance rises from `darkest` to `brightest` in equal ratios, row by row, each
/// channel with a tint of its own.
inline Image<Rgb> tiles(int width, int height, int side, double darkest, double brightest)
{
    Image<Rgb> image(width, height);
    const int columns = (width + side - 1) / side;
    const int rows = (height + side - 1) / side;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const double place = static_cast<double>(y / side * columns + x / side) /
                                 std::max(1, columns * rows - 1);
            const double value = darkest * std::pow(brightest / darkest, place);
            image(x, y) = Rgb(glm::dvec3(value, 0.8 * value, 0.6 * value));
        }
    }
    return image;
}

/// RMS in EV over codes [from, to] of the difference of two curves after one scale.
inline double curveErrorEv(const ResponseCurve& curve,
                           const ResponseCurve& truth,
                           std::size_t channel,
                           std::size_t from,
                           std::size_t to)
{
    double sum = 0.0;
    double squares = 0.0;
    for (std::size_t z = from; z <= to; ++z) {
        const double e = std::log2(curve.exposure[channel][z] / truth.exposure[channel][z]);
        sum += e;
        squares += e * e;
    }
    const auto n = static_cast<double>(to - from + 1);
    return std::sqrt(std::max(squares / n - sum * sum / (n * n), 0.0));
}

}  // namespace insitu
