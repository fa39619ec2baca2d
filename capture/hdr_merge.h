#pragma once

#include "capture/bracket.h"
#include "capture/noise_model.h"
#include "core/response_curve.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace insitu {

/// How a bracket is merged into one radiance image.
struct MergeOptions {
    /// Codes above this fraction of full scale count as clipped. Unitless, in (0.5, 1].
    double clip_fraction = 0.98;
    /// Codes below this fraction count as black. Unitless, in [0, 0.5).
    double black_fraction = 0.02;
    /// The camera's noise; absent: estimateNoise() of the bracket.
    std::optional<NoiseModel> noise;

    [[nodiscard]] Findings validate() const;
};

/// What a merged pixel rests on: bits of MergeResult::validity, 0 = nothing to say.
enum MergeValidity : std::uint8_t {
    /// Some channel is clipped in every frame: its radiance is a lower bound.
    kMergeClipped = 1,
    /// Every channel is black in the longest frame in use: no more than an upper bound.
    kMergeBlack = 2,
    /// Some channel rests on a single frame.
    kMergeSingleFrame = 4,
    /// Some frame excludes this pixel (BracketFrame::excluded).
    kMergeExcluded = 8,
    /// Beside a clipped pixel in every frame: nothing could confirm it.
    kMergeUnconfirmed = 16,
};

struct MergeResult {
    RadianceImage radiance;  ///< linearised exposure / relative exposure
    /// Variance of `radiance` by the noise model, per pixel and channel: of a single pixel, see
    /// NoiseModel on neighbours. Where a channel is clipped: its radiance squared. It knows nothing
    /// of an error of the response or of motion.
    Image<Rgb> variance;
    Image<std::uint8_t> validity;   ///< bits of MergeValidity
    double clipped_fraction = 0.0;  ///< of the pixels, those with kMergeClipped
    NoiseModel noise;               ///< as given or estimated
    /// "merge-clipped", "merge-all-clipped", "merge-all-black", "merge-useless-exposure" (a frame
    /// clipped or black everywhere, though others are not), "noise-model-assumed".
    Findings findings;
};

/// The radiance of each pixel: the mean of all frames whose code is neither clipped nor black,
/// weighted by inverse variance at the level that the longest of them shows [Granados10]. Codes
/// beside clipped pixels (3x3) are used where they agree with the longest frame that is clear of
/// clipping: JPEG, demosaicing and blooming spoil neighbours.
///
/// Pixels that a frame excludes (BracketFrame::excluded) are taken from the others; where every
/// frame is excluded the masks are not followed. Memory: 25 bytes a pixel for the result.
/// InputError: bad options; a response that is not finite and strictly increasing.
[[nodiscard]] MergeResult mergeBracket(const Bracket& bracket,
                                       const ResponseCurve& response,
                                       const MergeOptions& options);

}  // namespace insitu
