#pragma once

#include "core/image.h"

#include <array>

namespace insitu {

/// Working colour: scene-linear Rec. 709 primaries, D65 white.

/// Rec. 709 luminance weights (ITU-R BT.709-6, table 4).
inline constexpr std::array<float, 3> kLuminanceWeights = {0.2126f, 0.7152f, 0.0722f};

[[nodiscard]] inline float luminance(const Rgb& c)
{
    return kLuminanceWeights[0] * c.r + kLuminanceWeights[1] * c.g + kLuminanceWeights[2] * c.b;
}

/// sRGB transfer (IEC 61966-2-1), piecewise, on [0, 1]; odd extension outside is not defined.
[[nodiscard]] double srgbFromLinear(double linear);
[[nodiscard]] double linearFromSrgb(double encoded);

}  // namespace insitu
