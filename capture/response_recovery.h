#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <array>
#include <cstdint>
#include <vector>

namespace insitu {

struct ResponseOptions {
    /// Places of the picture used (small flat patches). Unitless, >= 50.
    int samples = 1500;
    /// Weight of the penalty on bends of the curve ([DebMal97] eq. 3, lambda; see
    /// response_solve.cpp). Unitless, > 0.
    double smoothness = 100.0;

    /// Every problem at once, so that one run reports them all.
    [[nodiscard]] Findings validate() const;
};

struct ResponseRecovery {
    ResponseCurve curve;
    /// RMS over samples of ln(exposure) predicted by two frames for one place, per channel.
    std::array<double, 3> residual{};
    /// "response-not-recoverable", "response-partly-extrapolated" (codes no sample reached)
    Findings findings;
};

/// Response of the camera that took the bracket, by Debevec & Malik's linear least squares
/// [DebMal97], with patches instead of single pixels: see response_recovery.cpp. At least two
/// different exposures with overlapping unclipped codes are needed: otherwise the sRGB curve is
/// returned with finding "response-not-recoverable". Bad options are an InputError.
[[nodiscard]] ResponseRecovery recoverResponse(const Bracket& bracket,
                                               const ResponseOptions& options);

}  // namespace insitu
