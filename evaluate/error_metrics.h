#pragma once

#include "core/photo.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>

namespace insitu {

/// Differences between a picture and its reference, in one number each.
///
/// Common rules: both images have the same size and hold linear values; sums run in double and row
/// by row, so results do not depend on the number of threads. A mask of the same size chooses the
/// pixels that count (non-zero); an empty mask chooses all.

using PixelMask = Image<std::uint8_t>;

/// Errors of a picture against a reference.
/// Source: [Michael10] chapter 5, equations 17 to 19.
struct ErrorMetrics {
    std::int64_t pixels = 0;  ///< pixels that count
    /// Root of the mean squared difference per channel, unit of the images.
    glm::dvec3 rmse{0.0};
    /// Largest minus smallest value per channel over the counting pixels of both images, the
    /// divisor of equation 17.
    glm::dvec3 range{0.0};
    /// Equation 17 per channel: rmse / range; 0 where both images are one and the same constant.
    glm::dvec3 nrmse_channels{0.0};
    double nrmse = 0.0;  ///< mean of the three channels
    /// Equations 18 and 19 in per cent, on luminance, relative to the reference. Pixels whose
    /// reference is black have no relative error: left out and counted in `black_pixels`.
    double rms_percent = 0.0;
    double mean_percent = 0.0;
    std::int64_t black_pixels = 0;
    /// Largest absolute difference of any channel, unit of the images.
    double max_difference = 0.0;
};

/// Nothing when the mask chooses no pixel. Throws InputError for a value that is not finite, naming
/// the image ("reference" or "picture") and the pixel; LogicError when sizes differ.
[[nodiscard]] std::optional<ErrorMetrics> compareImages(const Image<Rgb>& reference,
                                                        const Image<Rgb>& picture,
                                                        const PixelMask& mask = {});

/// How far two encoded pictures are from being the same bytes.
struct CodeDifference {
    std::int64_t pixels = 0;            ///< pixels that count
    std::int64_t differing_pixels = 0;  ///< with at least one channel different
    int max_codes = 0;                  ///< largest difference of a channel, in codes
};

/// Size and `max_code` of both must be the same (LogicError otherwise).
[[nodiscard]] CodeDifference compareCodes(const EncodedImage& reference,
                                          const EncodedImage& picture,
                                          const PixelMask& mask = {});

/// Codes through the inverse sRGB curve (IEC 61966-2-1): linear display values in [0, 1].
[[nodiscard]] Image<Rgb> decodeSrgb(const EncodedImage& image);

}  // namespace insitu
