#pragma once

#include "core/color_profile.h"
#include "core/io/byte_writer.h"

#include <optional>
#include <span>
#include <string>

namespace insitu {

/// Larger embedded profiles are not read: those of pictures have up to a few megabytes.
inline constexpr std::size_t kMaxIccBytes = 16 << 20;

struct IccReading {
    std::optional<ColorProfile> profile;
    std::string problem;  ///< why there is none, in plain words
    bool rgb = false;     ///< a profile of RGB pictures, usable or not
};

/// An ICC profile (ICC.1:2010) of an RGB device as curves and a matrix.
///
/// Matrix/TRC profiles say both themselves. A profile made of tables alone is taken when curves
/// and a matrix reproduce what its tables say (relative colorimetric) within 2 % of the brightest
/// channel over a grid of colours; else it is a problem. Colours go from the profile's D50 to
/// D65 as those of sRGB do in ICC profiles (Bradford). What is sRGB within rounding becomes
/// exactly that. Never throws; damaged bytes are a problem.
[[nodiscard]] IccReading readIccProfile(std::span<const std::uint8_t> bytes);

}  // namespace insitu
