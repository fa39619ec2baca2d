#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace insitu {

struct HeldOutOptions {
    /// Factor on each frame's relative exposure, such as ResponseRecovery::exposure_scale; empty:
    /// all 1.
    std::vector<double> exposure_scale;
    /// 1 where a pixel counts; of the frames' size, or empty: all count.
    Image<std::uint8_t> mask;
    /// Pixels looked at, at most, evenly spread; 0: all.
    std::size_t most_pixels = 0;
};

struct HeldOutError {
    double mean_codes = 0.0;             ///< mean |predicted - seen| over all channels, of 255
    std::array<double, 3> by_channel{};  ///< the same, by channel
    std::vector<double> by_frame;        ///< the same, by frame; 0 for the first and the last
    std::size_t count = 0;               ///< predictions; 0: nothing could be predicted
};

/// How well a response curve predicts what it was not told: every inner frame of the bracket is
/// predicted, pixel by pixel, from the merge of the other frames, and compared with the codes that
/// it shows. Counted are pixels whose code is neither the lowest nor the highest and which some
/// other frame shows with a code in [3, 252]; the choice does not look at the curve, so that curves
/// can be compared. The merge is the photon-limited mean, weights t_k, faded to the ends of the
/// codes. Predictions are not rounded: even a perfect one is 0.25 codes off on average. At least
/// three frames are needed (else count is 0). A mask or scales of the wrong size are an InputError.
[[nodiscard]] HeldOutError predictHeldOut(const Bracket& bracket,
                                          const ResponseCurve& curve,
                                          const HeldOutOptions& options = {});

}  // namespace insitu
