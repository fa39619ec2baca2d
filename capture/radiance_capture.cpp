#include "capture/radiance_capture.h"

#include "core/color.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
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

/// Longest first again, after exposures were corrected; both lists run in the same order.
void sortByExposure(Bracket& bracket, std::vector<CapturedFrame>& frames)
{
    std::ranges::stable_sort(bracket.frames, std::greater<>(), &BracketFrame::relative_exposure);
    std::ranges::stable_sort(frames, std::greater<>(), &CapturedFrame::used_exposure);
}

/// The response and the frames' exposures, from the bracket itself or from the profile.
void recover(Bracket& bracket, const CaptureOptions& options, CapturedRadiance& result)
{
    ResponseRecovery recovery = recoverResponse(bracket, options.response);
    result.response_known = !hasFinding(recovery.findings, "response-not-recoverable");
    for (std::size_t i = 0; i < recovery.exposure_scale.size(); ++i) {
        bracket.frames[i].relative_exposure *= recovery.exposure_scale[i];
        result.frames[i].used_exposure = bracket.frames[i].relative_exposure;
    }
    sortByExposure(bracket, result.frames);
    result.held_out_error_codes = recovery.held_out_error_codes;
    result.response =
        result.response_known ? std::move(recovery.curve) : bracket.metadata.color.transfer;
    append(result.findings, std::move(recovery.findings));
}

/// Shutter times are rounded (1/60 for 1/64), and linear pictures tell the true ones.
void refineLinear(Bracket& bracket, CapturedRadiance& result)
{
    constexpr double kWorthRefining = 0.003;  // of ln exposure; well above the medians' own error
    std::string changed;
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        const std::optional<double> measured = result.frames[k].measured_exposure;
        double& exposure = bracket.frames[k].relative_exposure;
        if (!measured || std::abs(std::log(*measured / exposure)) < kWorthRefining) continue;
        changed += fmt::format("{}{}: given {:.4g}, measured {:.4g}",
                               changed.empty() ? "" : "; ",
                               bracket.frames[k].name,
                               exposure,
                               *measured);
        exposure = *measured;
        result.frames[k].used_exposure = *measured;
    }
    if (changed.empty()) return;
    result.findings.push_back({Severity::Info,
                               "capture-exposures-refined",
                               "the pictures show other exposures than given; used: " + changed});
    sortByExposure(bracket, result.frames);
}

/// What the pictures show of their exposures, and what follows from it.
void checkExposures(Bracket& bracket,
                    const CaptureOptions& options,
                    const MergeOptions& merge,
                    bool recovered,
                    CapturedRadiance& result)
{
    // Codes a little above black: rounding weighs there.
    constexpr double kAboveBlack = 4.0;
    ExposureCheckOptions check;
    check.lowest_fraction = kAboveBlack * merge.black_fraction;
    check.highest_fraction = merge.clip_fraction;
    const auto measured = measureExposures(bracket, result.response, check);
    for (std::size_t k = 0; k < measured.size(); ++k)
        result.frames[k].measured_exposure = measured[k];
    // A recovery has compared and told by itself, with a curve that it found along with them.
    if (recovered) return;
    append(result.findings, exposureMismatches(bracket, measured));
    if (bracket.metadata.color.transfer_is_response && options.response.refine_exposures)
        refineLinear(bracket, result);
}

/// From the camera's primaries to Rec. 709: variances of independent channels add by the squares.
void convertToRec709(const glm::dmat3& matrix, CapturedRadiance& result)
{
    const double outside = convertPixels(result.merged.radiance.pixels, matrix);
    (void)convertPixels(result.merged.variance, glm::matrixCompMult(matrix, matrix));
    constexpr double kWorthTelling = 1e-3;
    if (outside > kWorthTelling)
        result.findings.push_back(
            {Severity::Info,
             "capture-outside-rec709",
             fmt::format("{:.1f} % of the pixels have colours outside Rec. 709's primaries; these "
                         "were cut",
                         100.0 * outside)});
}

}  // namespace

CapturedRadiance captureRadiance(Bracket bracket,
                                 const std::optional<ResponseCurve>& response,
                                 const CaptureOptions& options)
{
    CapturedRadiance result;
    const ColorProfile color = bracket.metadata.color;
    const bool several = bracket.frames.size() > 1;
    MergeOptions merge = options.merge;
    if (color.transfer_is_response) merge.black_fraction = linearFromSrgb(merge.black_fraction);
    result.clip_fraction = merge.clip_fraction;
    result.black_fraction = merge.black_fraction;
    for (const BracketFrame& frame : bracket.frames)
        result.frames.push_back(describe(frame, merge));
    if ((options.align || bracket.hand_cut) && several) {
        Alignment alignment = alignBracket(bracket, options.alignment);
        if (!alignment.isIdentity()) bracket = applyAlignment(std::move(bracket), alignment);
        append(result.findings, std::move(alignment.findings));
    }
    if (color.transfer_is_response) {
        if (response) throw InputError("response", "RAW files are linear; leave the response out");
        result.response = color.transfer;
        result.response_known = true;
        result.findings.push_back(
            {Severity::Info, "response-linear", "RAW files are linear: no response is recovered"});
    } else if (response) {
        result.response = *response;
        result.response_known = true;
    } else {
        recover(bracket, options, result);
    }
    const bool recovered = !response && !color.transfer_is_response && result.response_known;
    if (several) checkExposures(bracket, options, merge, recovered, result);
    if (options.deghost && several) {
        MovedPixels moved = findMovedPixels(bracket, result.response, options.ghosts);
        exclude(bracket, moved);
        append(result.findings, std::move(moved.findings));
    }
    result.merged = mergeBracket(bracket, result.response, merge);
    append(result.findings, std::exchange(result.merged.findings, {}));
    convertToRec709(color.rec709_from_linear, result);
    return result;
}

}  // namespace insitu
