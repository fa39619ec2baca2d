#pragma once

#include "core/photo.h"
#include "core/response_curve.h"
#include "pipeline/common_surfaces.h"

#include <cstddef>
#include <vector>

namespace insitu {

/// A photograph's response from surfaces whose radiance the light probe knows.
struct PhotoResponseEstimate {
    ResponseCurve curve;  ///< exposure 1 at code 128
    /// In logarithms, x that of the assumed curve's exposure over that at code 128:
    /// ln exposure = power · x + bend · x². The assumed curve has 1 and 0.
    double power = 1.0, power_sigma = 0.0;
    double bend = 0.0, bend_sigma = 0.0;
    /// Median of |ln photograph − ln probe| over pixels and channels, each channel's scale solved
    /// for, by the assumed curve and by this one.
    double spread_assumed = 0.0, spread = 0.0;
    std::size_t pixels = 0;  ///< that were compared
    /// The assumed curve is wrong: power or bend are off by three standard deviations and 5 %, and
    /// the pixels agree within 15 %, a tenth better than by the assumed curve.
    bool differs = false;
};

/// One power and, where it is significant, one bend for all channels, by least absolute deviations;
/// standard deviations by leaving out one face of the room after the other. Nothing differs where
/// fewer than 300 pixels or three faces tell: then the assumed curve comes back. Codes below 8 and
/// above 245 (of 255) do not count; beyond those seen, the curve goes on straight in logarithms.
[[nodiscard]] PhotoResponseEstimate estimatePhotoResponse(const EncodedImage& photo,
                                                          const ResponseCurve& assumed,
                                                          const std::vector<CommonPixel>& pixels);

}  // namespace insitu
