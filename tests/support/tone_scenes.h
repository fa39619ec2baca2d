#pragma once

#include "core/image.h"
#include "core/random.h"

#include <cmath>
#include <cstdint>

namespace insitu::tone_scenes {

/// Luminances over `decades` decades below 1000, coloured, each pixel its own: the hardest case for
/// what is filtered on fewer pixels.
inline Image<Rgb> noise(int width, int height, float decades, std::uint64_t seed = 7)
{
    Image<Rgb> scene(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            RandomStream random(seed, static_cast<std::uint64_t>(y * width + x), 0);
            const float level = std::pow(10.0f, 3.0f - decades * random.uniform());
            const auto channel = [&] { return 0.2f + 0.8f * random.uniform(); };
            scene(x, y) = level * Rgb(channel(), channel(), channel());
        }
    return scene;
}

/// A room: walls with a soft gradient and fine texture, a dark cupboard, a window 1000 times as
/// bright, lamps that are a few pixels large.
inline Image<Rgb> room(int width, int height)
{
    Image<Rgb> scene(width, height);
    const auto inside = [](float v, float low, float high) { return v >= low && v < high; };
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float u = (static_cast<float>(x) + 0.5f) / static_cast<float>(width);
            const float v = (static_cast<float>(y) + 0.5f) / static_cast<float>(height);
            RandomStream random(3, static_cast<std::uint64_t>(y * width + x), 0);
            float level = 0.4f + 0.5f * u - 0.2f * v;
            level *= 1.0f + 0.15f * std::sin(0.9f * static_cast<float>(x)) *
                                std::sin(0.6f * static_cast<float>(y));
            if (inside(u, 0.05f, 0.3f) && inside(v, 0.4f, 0.95f)) level *= 0.03f;
            if (inside(u, 0.6f, 0.85f) && inside(v, 0.1f, 0.5f)) level = 400.0f * (1.0f + 0.5f * v);
            if (std::hypot(u - 0.45f, v - 0.2f) < 0.01f) level = 5000.0f;
            level *= 0.97f + 0.06f * random.uniform();
            scene(x, y) = level * Rgb(1.0f, 0.9f - 0.2f * v, 0.7f + 0.2f * u);
        }
    return scene;
}

}  // namespace insitu::tone_scenes
