#pragma once

#include "composite/tonemap/ashikhmin.h"
#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <vector>

namespace insitu::direct {

/// Ashikhmin's operator evaluated directly, in double precision on all pixels, with Gaussians that
/// are cut off at five standard deviations: the truth that the fast one is held against.

inline Image<double> blurred(const Image<double>& image, double deviation)
{
    const int radius = std::max(1, static_cast<int>(std::ceil(5.0 * deviation)));
    std::vector<double> weights(static_cast<std::size_t>(radius) + 1);
    double sum = 0.0;
    for (int k = 0; k <= radius; ++k) {
        weights[static_cast<std::size_t>(k)] = std::exp(-0.5 * k * k / (deviation * deviation));
        sum += (k == 0 ? 1.0 : 2.0) * weights[static_cast<std::size_t>(k)];
    }
    const auto pass = [&](const Image<double>& from, int dx, int dy) {
        Image<double> to(from.width(), from.height());
        parallelFor(0, from.height(), [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < from.width(); ++x) {
                double value = 0.0;
                for (int k = -radius; k <= radius; ++k)
                    value += weights[static_cast<std::size_t>(std::abs(k))] *
                             from(std::clamp(x + k * dx, 0, from.width() - 1),
                                  std::clamp(y + k * dy, 0, from.height() - 1));
                to(x, y) = value / sum;
            }
        });
        return to;
    };
    return pass(pass(image, 0, 1), 1, 0);
}

/// How near to the threshold a contrast is undecided: the first crossing is then a matter of
/// rounding, and La jumps from one scale to another.
constexpr double kUndecided = 5e-4;

/// La of every pixel; luminance in cd/m². `undecided`, when given, becomes 1 where a contrast up to
/// the first clear crossing is that near to the threshold.
inline Image<double> adaptation(const Image<double>& luminance,
                                double threshold,
                                Image<std::uint8_t>* undecided = nullptr)
{
    if (undecided != nullptr)
        *undecided = Image<std::uint8_t>(luminance.width(), luminance.height(), 0);
    std::map<int, Image<double>> g;
    g[0] = luminance;
    for (int s = 1; s <= 10; ++s)
        for (const int scale : {s, 2 * s})
            if (g.find(scale) == g.end()) g[scale] = blurred(luminance, 0.5 * scale);
    Image<double> adapted = g[10];
    for (std::size_t i = 0; i < luminance.pixelCount(); ++i) {
        double before = 0.0;
        for (int s = 1; s <= 10; ++s) {
            const double middle = g[s].pixels()[i];
            const double difference = std::abs(middle - g[2 * s].pixels()[i]);
            const double finer = g[s - 1].pixels()[i];
            if (difference > threshold * middle) {
                const double share =
                    middle > 0.0 ? (threshold - before) / (difference / middle - before) : 0.0;
                adapted.pixels()[i] = finer + share * (middle - finer);
                break;
            }
            before = middle > 0.0 ? difference / middle : 0.0;
        }
        for (int s = 1; s <= 10 && undecided != nullptr; ++s) {
            const double middle = g[s].pixels()[i];
            const double contrast =
                middle > 0.0 ? std::abs(1.0 - g[2 * s].pixels()[i] / middle) : 0.0;
            if (contrast > threshold + kUndecided) break;
            if (contrast > threshold - kUndecided) undecided->pixels()[i] = 1;
        }
    }
    return adapted;
}

/// Display luminance in [0, 1] of every pixel; `local` false: pixels adapt to themselves.
inline Image<double> displayLuminance(const Image<Rgb>& scene,
                                      const AshikhminOptions& options,
                                      bool local = true,
                                      Image<std::uint8_t>* undecided = nullptr)
{
    const double scale = options.viewing.scale(measureScene(scene));
    Image<double> l(scene.width(), scene.height());
    for (std::size_t i = 0; i < l.pixelCount(); ++i)
        l.pixels()[i] = scale * static_cast<double>(luminance(scene.pixels()[i]));
    const Image<double> la = local ? adaptation(l, options.contrast_threshold, undecided) : l;
    const auto [least, most] = std::minmax_element(l.pixels().begin(), l.pixels().end());
    const double black = perceptualCapacity(*least);
    const double white = options.viewing.display_white_cd_m2;
    const double steps_to_display = white / (perceptualCapacity(*most) - black);
    Image<double> display(scene.width(), scene.height());
    for (std::size_t i = 0; i < l.pixelCount(); ++i) {
        const double a = la.pixels()[i];
        const double base = std::max(0.0, perceptualCapacity(a) - black) * steps_to_display;
        const double shown =
            base + visibleThreshold(base) / visibleThreshold(a) * (l.pixels()[i] - a);
        display.pixels()[i] = std::clamp(shown / white, 0.0, 1.0);
    }
    return display;
}

}  // namespace insitu::direct
