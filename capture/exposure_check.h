#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <optional>
#include <vector>

namespace insitu {

/// Codes that count when exposures are compared, as fractions of full scale.
struct ExposureCheckOptions {
    double lowest_fraction = 0.08;   ///< below, rounding and noise decide; in (0, highest)
    double highest_fraction = 0.98;  ///< above, codes are clipped; in (lowest, 1]
};

/// The exposures that the pictures show: from the median over pixels and channels of the ratio of
/// what neighbouring frames decode to, chained, and scaled so that they agree with the given ones
/// in the geometric mean. One entry a frame, in the frames' order; nothing where neighbours share
/// too few well-exposed pixels (fewer than 200 samples of at most 60 000) on the way to the frame
/// with the most such neighbours. As right as the response is: where it has been recovered from
/// these very exposures, it agrees with them.
[[nodiscard]] std::vector<std::optional<double>> measureExposures(
    const Bracket& bracket,
    const ResponseCurve& response,
    const ExposureCheckOptions& options = {});

/// "bracket-exposure-mismatch" (Warning) for each frame whose measured exposure differs from the
/// given one by more than 0.2 EV, with both numbers.
[[nodiscard]] Findings exposureMismatches(const Bracket& bracket,
                                          const std::vector<std::optional<double>>& measured);

}  // namespace insitu
