#pragma once

#include "core/image.h"

#include <array>
#include <string>

namespace insitu {

/// A camera's response: code value <-> sensor exposure, one monotone table per channel.
///
/// `exposure[c][z]` is the linear exposure that gives 8-bit code z in channel c, strictly
/// increasing, >= 0. Recovered curves have exposure[c][128] = 1 (one free scale per channel,
/// [DebMal97] section 2.1); sRGB has exposure[c][255] = 1. 16-bit codes use fractional z =
/// code/257. A code of 255 is a lower bound on the exposure, code 0 an upper bound.
struct ResponseCurve {
    std::array<std::array<double, 256>, 3> exposure{};
    std::string source;  ///< "srgb", "debevec", a file's name: for reports

    /// Exposure for a (fractional) code in [0, 255]; linear interpolation between entries.
    [[nodiscard]] double decode(int channel, double code) const;
    /// Inverse of decode: fractional code in [0, 255]; exposures outside the table are clamped.
    [[nodiscard]] double encode(int channel, double exposure_value) const;

    [[nodiscard]] static ResponseCurve srgb();
};

}  // namespace insitu
