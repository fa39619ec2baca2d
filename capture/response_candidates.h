#pragma once

#include "capture/response_finish.h"
#include "capture/response_fit.h"
#include "capture/response_groups.h"
#include "capture/response_recovery.h"

#include <array>
#include <optional>
#include <vector>

namespace insitu::detail {

/// What all methods start from.
struct Evidence {
    BracketPixels pixels;
    std::array<PixelGroups, 3> groups;
    std::array<CodeReach, 3> reaches{};
    std::vector<double> log_exposures;  ///< refined
    CurveFit smooth;                    ///< method Debevec: it also found the refinement
    double moved = 0.0;                 ///< share of blocks dropped
};

/// Pixels and groups of a bracket of three frames or more; channels with too few groups have none.
/// `triples` of the pixels.
[[nodiscard]] Evidence gatherEvidence(const Bracket& bracket,
                                      BracketPixels pixels,
                                      const std::array<std::vector<FrameTriple>, 3>& triples);

/// First solution, without the places that it shows to have moved.
void solveSmooth(Evidence& evidence, const ResponseOptions& options);

/// About 4000 of the pixels that inform the curves, side by side; where a frame is not clean its
/// code is 255, which neither predicts nor is predicted.
[[nodiscard]] Bracket judgedPlaces(const Bracket& bracket, const BracketPixels& pixels);

/// Smoothness for long steps is stiff. The one for 1 EV replaces the smooth one when it predicts
/// better: a strong shoulder that the prior does not allow for.
void loosen(const Bracket& places, Evidence& evidence, const ResponseOptions& options);

/// A method's curve and its error of held-out codes, -1: not judged.
struct Candidate {
    ResponseMethod method = ResponseMethod::Debevec;
    ResponseCurve curve;
    double error = -1.0;
};

/// Nothing when the method finds no increasing curve.
[[nodiscard]] std::optional<Candidate> tryMethod(const Evidence& evidence, ResponseMethod method);

/// The best of all methods by held-out prediction whose curve has no plateaus, and the finding that
/// says so.
[[nodiscard]] Candidate chooseMethod(const Bracket& places,
                                     const Evidence& evidence,
                                     const std::vector<double>& scale,
                                     Findings& findings);

/// Makes the table; false when there is none.
[[nodiscard]] bool makeCurve(std::array<LogCurve, 3> log_curves,
                             const std::array<CodeReach, 3>& reaches,
                             const std::array<int, 3>& floor,
                             ResponseMethod method,
                             ResponseCurve& curve);

/// Mean error of held-out codes; -1 when there is nothing to predict.
[[nodiscard]] double judge(const Bracket& bracket,
                           const ResponseCurve& curve,
                           const std::vector<double>& scale,
                           std::size_t most_pixels);

}  // namespace insitu::detail
