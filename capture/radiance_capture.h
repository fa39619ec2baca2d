#pragma once

#include "capture/alignment.h"
#include "capture/deghost.h"
#include "capture/exposure_check.h"
#include "capture/hdr_merge.h"
#include "capture/response_recovery.h"

#include <optional>
#include <string>
#include <vector>

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

/// One exposure of the bracket, as it was used.
struct CapturedFrame {
    std::string name;
    double nominal_exposure = 0.0;  ///< relative, as EXIF or the user gave it
    double used_exposure = 0.0;     ///< corrected by what the pictures show
    double clipped_fraction = 0.0;  ///< of the pixels: some channel above the clipping limit
    double black_fraction = 0.0;    ///< of the pixels: all channels below the limit of black
    /// What the pictures alone show, measureExposures(); nothing where they do not.
    std::optional<double> measured_exposure = {};
};

struct CapturedRadiance {
    ResponseCurve response;
    bool response_known = false;  ///< given or recovered, not assumed
    /// Mean error of codes of inner exposures predicted from the others, of 255; negative when the
    /// response was given or there is no inner exposure.
    double held_out_error_codes = -1.0;
    std::vector<CapturedFrame> frames;  ///< from the longest exposure to the shortest
    double clip_fraction = 1.0;         ///< of full scale, as used
    double black_fraction = 0.0;        ///< of full scale, as used
    MergeResult merged;
    Findings findings;  ///< of all steps, in order; those of `bracket` are not repeated
};

/// alignBracket (if wanted, or hand-cut) → recoverResponse (unless `response` is given; corrects
/// the frames' exposures) → findMovedPixels → mergeBracket → Rec. 709.
///
/// All steps but the last work on the camera's own channels; radiance and variance then leave in
/// Rec. 709 primaries, by the bracket's profile (metadata.color). Where no response can be
/// recovered, the profile's curve stands in. RAW is linear: its response is known
/// ("response-linear", Info), a response for it an InputError, and `black_fraction` counts as on a
/// code of sRGB. Exposures are measured from the pictures: RAW takes them where `refine_exposures`
/// allows ("capture-exposures-refined", Info); where the response is given, assumed or linear, one
/// that is far off is a "bracket-exposure-mismatch". A single exposure is linearised and no more.
/// Errors and findings as each of the steps, and "capture-outside-rec709" (Info): colours that Rec.
/// 709 cannot hold were cut.
[[nodiscard]] CapturedRadiance captureRadiance(Bracket bracket,
                                               const std::optional<ResponseCurve>& response,
                                               const CaptureOptions& options);

}  // namespace insitu
