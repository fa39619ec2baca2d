#include "capture/radiance_capture.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace insitu {

namespace {

CapturedFrame describe(const BracketFrame& frame, const MergeOptions& options)
{
    const double clip = options.clip_fraction * frame.image.max_code;
    const double black = options.black_fraction * frame.image.max_code;
    std::size_t clipped = 0;
    std::size_t dark = 0;
    for (const glm::u16vec3 code : frame.image.codes.pixels()) {
        const int brightest = std::max({code.r, code.g, code.b});
        clipped += brightest > clip ? 1 : 0;
        dark += brightest < black ? 1 : 0;
    }
    const double pixels = static_cast<double>(frame.image.codes.pixelCount());
    return {frame.name,
            frame.relative_exposure,
            frame.relative_exposure,
            static_cast<double>(clipped) / pixels,
            static_cast<double>(dark) / pixels};
}

}  // namespace

CapturedRadiance captureRadiance(Bracket bracket,
                                 const std::optional<ResponseCurve>& response,
                                 const CaptureOptions& options)
{
    CapturedRadiance result;
    const bool several = bracket.frames.size() > 1;
    for (const BracketFrame& frame : bracket.frames)
        result.frames.push_back(describe(frame, options.merge));
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
        for (std::size_t i = 0; i < recovery.exposure_scale.size(); ++i) {
            bracket.frames[i].relative_exposure *= recovery.exposure_scale[i];
            result.frames[i].used_exposure = bracket.frames[i].relative_exposure;
        }
        // An exposure that was far off may stand elsewhere now.
        std::ranges::stable_sort(
            bracket.frames, std::greater<>(), &BracketFrame::relative_exposure);
        std::ranges::stable_sort(result.frames, std::greater<>(), &CapturedFrame::used_exposure);
        result.held_out_error_codes = recovery.held_out_error_codes;
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
