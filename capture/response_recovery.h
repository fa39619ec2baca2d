#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <cstdint>
#include <vector>

namespace insitu {

struct ResponseOptions {
    /// Pixel positions used. Unitless, >= 50.
    int samples = 400;
    /// Weight of the second-derivative penalty on log exposure ([DebMal97] eq. 3, lambda). > 0.
    double smoothness = 20.0;

    /// Every problem at once, so that one run reports them all.
    [[nodiscard]] Findings validate() const;
};

struct ResponseRecovery {
    ResponseCurve curve;
    /// RMS over samples of ln(exposure) predicted by two frames for one pixel, per channel.
    std::array<double, 3> residual{};
    Findings findings;
};

/// Response of the camera that took the bracket, by Debevec & Malik's linear least squares
/// [DebMal97]. At least two different exposures with overlapping unclipped codes are needed:
/// otherwise the sRGB curve is returned with finding "response-not-recoverable".
[[nodiscard]] ResponseRecovery recoverResponse(const Bracket& bracket,
                                               const ResponseOptions& options);

}  // namespace insitu
