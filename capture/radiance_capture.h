#pragma once

#include "capture/alignment.h"
#include "capture/deghost.h"
#include "capture/hdr_merge.h"
#include "capture/response_recovery.h"

#include <optional>

namespace insitu {

/// All that happens to a bracket on its way to radiance.
struct CaptureOptions {
    /// Lay hand-held frames onto each other. Off: a tripod's frames lie better than any estimate,
    /// and noisy pictures of a ball were found to move by half a pixel where they did not.
    bool align = false;
    /// Leave out what moved between the exposures. Off: where the response is not quite right,
    /// static pixels are left out too.
    bool deghost = false;
    AlignmentOptions alignment;
    DeghostOptions ghosts;
    ResponseOptions response;
    MergeOptions merge;
};

struct CapturedRadiance {
    ResponseCurve response;
    bool response_known = false;  ///< given or recovered, not assumed
    MergeResult merged;
    Findings findings;  ///< of all steps, in order; those of `bracket` are not repeated
};

/// alignBracket → recoverResponse (unless `response` is given; corrects the frames' exposures) →
/// findMovedPixels → mergeBracket.
/// A single exposure is linearised and no more. Errors and findings as each of them.
[[nodiscard]] CapturedRadiance captureRadiance(Bracket bracket,
                                               const std::optional<ResponseCurve>& response,
                                               const CaptureOptions& options);

}  // namespace insitu
