#pragma once

#include "capture/bracket.h"
#include "core/response_curve.h"

#include <array>
#include <cstdint>
#include <vector>

namespace insitu {

/// How the response is found. All methods work on the same pixels and exposures.
enum class ResponseMethod {
    Auto,       ///< the one whose curve predicts held-out exposures best
    Debevec,    ///< any smooth curve, least squares of ln exposure [DebMal97]
    Mitsunaga,  ///< polynomial of the code, order chosen by the data [MitNay99]
    Robertson,  ///< table, alternating with the radiances [Robertson03]
    Basis,      ///< mean and principal components of published curves, as in [GroNay04]
};
[[nodiscard]] const char* responseMethodName(ResponseMethod method);

struct ResponseOptions {
    ResponseMethod method = ResponseMethod::Auto;
    /// Places used when a bracket has too few frames for the joint counts of all pixels (small
    /// flat patches). Unitless, >= 50.
    int samples = 1500;
    /// Weight of the penalty on bends of the curve ([DebMal97] eq. 3, lambda; see
    /// response_models.cpp). Unitless, > 0.
    double smoothness = 100.0;
    /// Correct the frames' exposures where the pictures show other ratios than the given ones.
    bool refine_exposures = true;

    /// Every problem at once, so that one run reports them all.
    [[nodiscard]] Findings validate() const;
};

struct ResponseRecovery {
    ResponseCurve curve;
    ResponseMethod method = ResponseMethod::Debevec;  ///< never Auto
    /// RMS of ln(exposure) by which frames disagree about the same pixels, per channel.
    std::array<double, 3> residual{};
    /// Mean error of codes of inner exposures predicted from the others (predictHeldOut on a spread
    /// of pixels), of 255; negative when there is no inner exposure.
    double held_out_error_codes = -1.0;
    /// Factor on each frame's relative exposure under which the curve was found; 1 for exposures
    /// that the pictures confirm. A common factor and a common exponent cannot be seen and are
    /// those of the given exposures: the mean of the logs of these factors is 0 and so is their
    /// trend over ln exposure (of the frames that agree, when some are far off).
    std::vector<double> exposure_scale;
    /// "response-not-recoverable", "response-partly-extrapolated" (codes no sample reached),
    /// "response-method-chosen", "response-method-failed" (the method asked for found no curve),
    /// "response-exposures-refined", "bracket-exposure-mismatch", "response-moved-places"
    Findings findings;
};

/// Response of the camera that took the bracket: exposure[c][128] = 1, strictly increasing, all
/// entries positive. exposure[c][z] is the exposure whose code is exactly z before rounding. At the
/// ends, which no pixel can inform (code 0 is anything darker, 255 anything brighter), entries 0
/// and 255 continue the curve; merging must take them as bounds.
///
/// Three or more frames inform the curve with all pixels (response_groups.cpp), two with patches
/// (response_solve.cpp, method Debevec). The channels share the exposures' corrections, which are
/// solved jointly, and the pixels; their curves are independent otherwise. At least two different
/// exposures with overlapping unclipped codes are needed: otherwise the sRGB curve is returned with
/// finding "response-not-recoverable". Bad options are an InputError.
[[nodiscard]] ResponseRecovery recoverResponse(const Bracket& bracket,
                                               const ResponseOptions& options);

}  // namespace insitu
