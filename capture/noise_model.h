#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <array>
#include <optional>

namespace insitu {

/// Noise of one channel, in the exposure units of the ResponseCurve it was estimated with.
struct ChannelNoise {
    double read_variance = 0.0;  ///< of a black pixel; exposure squared, >= 0
    double gain = 0.0;           ///< variance per exposure: the exposure of one electron, >= 0
    /// Variance of a code in steps of 8-bit codes squared, > 0: rounding (1/12 for 8 bit), and what
    /// JPEG adds. Counts as exposure through the slope of the response.
    double code_variance = 1.0 / 12.0;
    /// Correlation of the noise of pixels side by side, in [-1, 1].
    double neighbour_correlation = 0.0;
};

/// Variance of an exposure x in one frame of a bracket [HasDurFre10] section 3, [Granados10]:
///
///     var(x) = read_variance + gain x + code_variance (dx/dz)^2
///
/// All frames share it: it holds for a bracket whose ISO does not change. It is the variance of
/// single pixels. Noise of neighbours is correlated where a camera demosaics, smooths or stores
/// JPEG: the variance of a mean over n pixels is larger than var / n (`neighbour_correlation` says
/// whether); so is rounding in areas whose noise is below a code. What repeats from frame to frame,
/// such as pixels of unequal sensitivity, is not part of it.
struct NoiseModel {
    std::array<ChannelNoise, 3> channels;

    /// Variance of the exposure that decodes from a code near `code` (8-bit steps, may be
    /// fractional); exposure units squared.
    [[nodiscard]] double variance(const ResponseCurve& response, int channel, double code) const;
    /// "noise-model-invalid": a member is not finite or outside its range.
    [[nodiscard]] Findings validate() const;
};

struct NoiseEstimate {
    NoiseModel model;
    Findings findings;  ///< "noise-model-assumed"
};

/// Noise of a bracket from itself: residuals between neighbouring frames, in blocks that are flat
/// in the mean of the two (that mean and the residual are independent, so the choice does not
/// bias), against level. The scene's texture cancels as far as the frames are aligned and the
/// response is right. Where a channel cannot tell (one frame, too few well-exposed blocks, noise
/// below rounding) it takes assumedNoise() by the bracket's ISO: "noise-model-assumed".
/// Takes a fixed sample of blocks, so its time does not grow with the picture.
[[nodiscard]] NoiseEstimate estimateNoise(const Bracket& bracket, const ResponseCurve& response);

/// Noise of a common camera: 32 000 electrons at full scale at ISO 100, fewer in proportion at
/// higher ISO (ISO 800 when it is unknown), read noise of five electrons, rounding to `max_code`.
[[nodiscard]] NoiseModel assumedNoise(const ResponseCurve& response,
                                      std::optional<double> iso,
                                      int max_code);

}  // namespace insitu
