#include "capture/hdr_merge.h"

#include "capture/merge_rows.h"
#include "capture/merge_tables.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace insitu {

namespace {

/// Rows that one task merges; their neighbours above and below are looked at twice.
constexpr int kRowsPerTask = 32;

void checkResponse(const ResponseCurve& response)
{
    for (const auto& table : response.exposure)
        for (std::size_t z = 0; z < table.size(); ++z)
            if (!std::isfinite(table[z]) || table[z] < 0.0 || (z > 0 && table[z] <= table[z - 1]))
                throw InputError("response " + response.source,
                                 fmt::format("entry {} is {}; exposures must be finite and "
                                             "strictly increase with the code",
                                             z,
                                             table[z]));
}

void checkMasks(const Bracket& bracket)
{
    for (const BracketFrame& frame : bracket.frames)
        INSITU_CHECK(frame.excluded.empty() || frame.excluded.sameSize(frame.image.codes),
                     "{}: a mask of {}x{}",
                     frame.name,
                     frame.excluded.width(),
                     frame.excluded.height());
}

/// 8-bit frames as 16-bit ones where a bracket has both.
Bracket promoted(const Bracket& bracket)
{
    Bracket result = bracket;
    for (BracketFrame& frame : result.frames) {
        if (frame.image.max_code != 255) continue;
        frame.image.max_code = 65535;
        for (glm::u16vec3& codes : frame.image.codes.pixels())
            codes *= std::uint16_t{257};
    }
    return result;
}

void reportClipping(MergeResult& result)
{
    const auto all = static_cast<std::ptrdiff_t>(result.validity.pixelCount());
    const auto count = [&](std::uint8_t bit) {
        return std::ranges::count_if(result.validity.pixels(),
                                     [bit](std::uint8_t flags) { return (flags & bit) != 0; });
    };
    const auto clipped_pixels = count(kMergeClipped);
    result.clipped_fraction = static_cast<double>(clipped_pixels) / static_cast<double>(all);
    if (clipped_pixels == all)
        result.findings.push_back({Severity::Warning,
                                   "merge-all-clipped",
                                   "every pixel is overexposed even in the shortest exposure: the "
                                   "radiance is only a lower bound; add shorter exposures"});
    else if (clipped_pixels > 0)
        result.findings.push_back(
            {Severity::Warning,
             "merge-clipped",
             fmt::format("{:.3g} % of the pixels are overexposed even in the shortest exposure: "
                         "those lights are brighter than measured; add shorter exposures",
                         100.0 * result.clipped_fraction)});
    if (count(kMergeBlack) == all)
        result.findings.push_back({Severity::Warning,
                                   "merge-all-black",
                                   "every pixel is black even in the longest exposure; add longer "
                                   "exposures"});
}

template <class Test>
bool everyCode(const EncodedImage& image, const Test& test)
{
    return std::ranges::all_of(image.codes.pixels(), [&](const glm::u16vec3& codes) {
        return test(codes.r) && test(codes.g) && test(codes.b);
    });
}

/// Frames that show nothing. A look at each ends at the first code that does show something.
void reportUseless(const Bracket& bracket, const MergeTables& tables, MergeResult& result)
{
    std::string clipped;
    std::string black;
    std::size_t useless = 0;
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        const BracketFrame& frame = bracket.frames[k];
        const MergeFrame& limits = tables.frames()[k];
        std::string* names = nullptr;
        if (everyCode(frame.image, [&](int code) { return code > limits.clip_code; }))
            names = &clipped;
        else if (everyCode(frame.image, [&](int code) { return code < limits.black_code; }))
            names = &black;
        if (names == nullptr) continue;
        *names += (names->empty() ? "" : ", ") + frame.name;
        ++useless;
    }
    if (useless == 0 || useless == bracket.frames.size()) return;
    std::string message;
    if (!clipped.empty()) message = "overexposed everywhere: " + clipped;
    if (!black.empty()) message += (message.empty() ? "black everywhere: " : "; black: ") + black;
    result.findings.push_back({Severity::Info, "merge-useless-exposure", message});
}

}  // namespace

Findings MergeOptions::validate() const
{
    Findings findings;
    if (!(clip_fraction > 0.5 && clip_fraction <= 1.0))
        findings.push_back(
            {Severity::Error,
             "merge-options",
             fmt::format("clip_fraction is {}, must be above 0.5 and at most 1", clip_fraction)});
    if (!(black_fraction >= 0.0 && black_fraction < 0.5))
        findings.push_back({Severity::Error,
                            "merge-options",
                            fmt::format("black_fraction is {}, must be at least 0 and below 0.5",
                                        black_fraction)});
    if (noise) append(findings, noise->validate());
    return findings;
}

MergeResult mergeBracket(const Bracket& bracket,
                         const ResponseCurve& response,
                         const MergeOptions& options)
{
    requireValid(options.validate(), "merge options");
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    checkResponse(response);
    checkMasks(bracket);
    const auto sameDepth = [&](const BracketFrame& frame) {
        return frame.image.max_code == bracket.frames.front().image.max_code;
    };
    if (!std::ranges::all_of(bracket.frames, sameDepth))
        return mergeBracket(promoted(bracket), response, options);

    MergeResult result;
    if (options.noise) {
        result.noise = *options.noise;
    } else {
        NoiseEstimate estimate = estimateNoise(bracket, response);
        result.noise = estimate.model;
        append(result.findings, std::move(estimate.findings));
    }
    const MergeTables tables(bracket, response, result.noise, options);

    const int width = bracket.frames.front().image.codes.width();
    const int height = bracket.frames.front().image.codes.height();
    // First use of memory costs as much as many frames do: side by side.
    parallelFor(0, 2, [&](std::int64_t image) {
        (image == 0 ? result.radiance.pixels : result.variance) = Image<Rgb>(width, height);
    });
    result.validity = Image<std::uint8_t>(width, height);
    const int tasks = (height + kRowsPerTask - 1) / kRowsPerTask;
    parallelFor(0, tasks, [&](std::int64_t task) {
        const int first = static_cast<int>(task) * kRowsPerTask;
        mergeRows(tables, first, std::min(first + kRowsPerTask, height), result);
    });
    reportClipping(result);
    reportUseless(bracket, tables, result);
    return result;
}

}  // namespace insitu
