#include "capture/radiance_capture.h"

#include <utility>

namespace insitu {

CapturedRadiance captureRadiance(Bracket bracket,
                                 const std::optional<ResponseCurve>& response,
                                 const CaptureOptions& options)
{
    CapturedRadiance result;
    const bool several = bracket.frames.size() > 1;
    if (options.align && several) {
        Alignment alignment = alignBracket(bracket, options.alignment);
        if (!alignment.isIdentity()) bracket = applyAlignment(std::move(bracket), alignment);
        append(result.findings, std::move(alignment.findings));
    }
    if (response) {
        result.response = *response;
        result.response_known = true;
    } else {
        ResponseRecovery recovery = recoverResponse(bracket, options.response);
        result.response_known = !hasFinding(recovery.findings, "response-not-recoverable");
        for (std::size_t i = 0; i < recovery.exposure_scale.size(); ++i)
            bracket.frames[i].relative_exposure *= recovery.exposure_scale[i];
        result.response = std::move(recovery.curve);
        append(result.findings, std::move(recovery.findings));
    }
    if (options.deghost && several) {
        MovedPixels moved = findMovedPixels(bracket, result.response, options.ghosts);
        exclude(bracket, moved);
        append(result.findings, std::move(moved.findings));
    }
    result.merged = mergeBracket(bracket, result.response, options.merge);
    append(result.findings, std::exchange(result.merged.findings, {}));
    return result;
}

}  // namespace insitu
