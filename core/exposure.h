#pragma once

#include <optional>

namespace insitu {

/// How a photograph was exposed, from EXIF or given by hand. Absent = unknown.
struct Exposure {
    std::optional<double> seconds;   ///< shutter time, > 0
    std::optional<double> f_number;  ///< N, > 0
    std::optional<double> iso;       ///< > 0

    /// Relative exposure t·(ISO/100)/N²: sensor signal per unit of scene radiance.
    ///
    /// An unknown ISO counts as 100 and an unknown N as 1, so two photographs may be compared only
    /// when both state the same things. Nothing when the time is unknown.
    /// Source: ISO 2720 exposure equation, up to its constant.
    [[nodiscard]] std::optional<double> relative() const
    {
        if (!seconds) return std::nullopt;
        const double n = f_number.value_or(1.0);
        return *seconds * (iso.value_or(100.0) / 100.0) / (n * n);
    }
};

}  // namespace insitu
