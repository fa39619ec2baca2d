#include "capture/response_recovery.h"

#include "capture/response_candidates.h"
#include "capture/response_patches.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace insitu {

namespace {

using detail::Candidate;
using detail::CodeReach;
using detail::Evidence;
using detail::LogCurve;
using detail::PixelGroups;

/// Fewer patches than this cannot carry a curve.
constexpr std::size_t kFewestPatches = 20;
/// Pixels on which a curve of patches is judged.
constexpr std::size_t kJudgedPixels = 4000;

ResponseRecovery notRecoverable(const Bracket& bracket, const std::string& why)
{
    ResponseRecovery recovery;
    recovery.curve = ResponseCurve::srgb();
    recovery.exposure_scale.assign(bracket.frames.size(), 1.0);
    recovery.findings.push_back(
        {Severity::Warning,
         "response-not-recoverable",
         fmt::format("the camera's response cannot be measured from this bracket ({}); the sRGB "
                     "curve is used, so radiance between exposures may be wrong",
                     why)});
    return recovery;
}

/// Two frames, or too few pixels for groups: patches.
ResponseRecovery recoverFromPatches(const Bracket& bracket, const ResponseOptions& options)
{
    const auto channels = detail::observePatches(bracket, options.samples);
    std::array<CodeReach, 3> reaches{};
    std::size_t most = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        most = std::max(most, channels[c].size());
        if (channels[c].size() >= kFewestPatches) reaches[c] = detail::reachOf(channels[c]);
    }
    if (most < kFewestPatches)
        return notRecoverable(
            bracket,
            fmt::format("only {} places are neither clipped nor black in two exposures", most));
    std::array<LogCurve, 3> log_curves{};
    ResponseRecovery recovery;
    parallelFor(0, 3, [&](std::int64_t channel) {
        const auto c = static_cast<std::size_t>(channel);
        if (channels[c].size() < kFewestPatches) return;
        const auto solution = detail::solveResponse(channels[c], options.smoothness);
        log_curves[c] = solution.log_curve;
        recovery.residual[c] = solution.residual;
    });
    if (!detail::makeCurve(log_curves, reaches, {}, ResponseMethod::Debevec, recovery.curve))
        return notRecoverable(bracket, "the equations have no solution");
    recovery.method = ResponseMethod::Debevec;
    recovery.exposure_scale.assign(bracket.frames.size(), 1.0);
    recovery.held_out_error_codes =
        detail::judge(bracket, recovery.curve, recovery.exposure_scale, kJudgedPixels);
    if (options.method != ResponseMethod::Auto && options.method != ResponseMethod::Debevec)
        recovery.findings.push_back(
            {Severity::Info,
             "response-method-failed",
             fmt::format("method {} needs more exposures or pixels than this bracket has; {} was "
                         "used",
                         responseMethodName(options.method),
                         responseMethodName(recovery.method))});
    append(recovery.findings, detail::reachFindings(reaches));
    return recovery;
}

ResponseRecovery recoverFromGroups(const Bracket& bracket,
                                   Evidence evidence,
                                   const ResponseOptions& options)
{
    detail::solveSmooth(evidence, options);
    ResponseRecovery recovery;
    for (const double log_scale : evidence.smooth.log_scale)
        recovery.exposure_scale.push_back(std::exp(log_scale));
    const Bracket places = detail::judgedPlaces(bracket, evidence.pixels);
    detail::loosen(places, evidence, options);
    recovery.residual = evidence.smooth.residual;
    std::optional<Candidate> chosen = detail::tryMethod(evidence, ResponseMethod::Debevec);
    if (!chosen) return notRecoverable(bracket, "the equations have no solution");
    if (options.method == ResponseMethod::Auto) {
        chosen = detail::chooseMethod(places, evidence, recovery.exposure_scale, recovery.findings);
    } else if (options.method != ResponseMethod::Debevec) {
        if (std::optional<Candidate> asked = detail::tryMethod(evidence, options.method)) {
            chosen = std::move(asked);
        } else {
            recovery.findings.push_back({Severity::Info,
                                         "response-method-failed",
                                         fmt::format("method {} finds no increasing curve; {} was "
                                                     "used",
                                                     responseMethodName(options.method),
                                                     responseMethodName(chosen->method))});
        }
    }
    recovery.method = chosen->method;
    recovery.held_out_error_codes =
        chosen->error >= 0.0 ? chosen->error
                             : detail::judge(places, chosen->curve, recovery.exposure_scale, 0);
    recovery.curve = std::move(chosen->curve);
    if (evidence.moved > 0.0)
        recovery.findings.push_back(
            {Severity::Info,
             "response-moved-places",
             fmt::format("in {:.1f} % of the picture the exposures disagree "
                         "(something moved, or they are not aligned); the "
                         "response was found without these places",
                         100.0 * evidence.moved)});
    append(recovery.findings, detail::reachFindings(evidence.reaches));
    append(recovery.findings, detail::exposureFindings(bracket, evidence.smooth.log_scale));
    return recovery;
}

}  // namespace

const char* responseMethodName(ResponseMethod method)
{
    switch (method) {
        case ResponseMethod::Auto:
            return "auto";
        case ResponseMethod::Debevec:
            return "debevec";
        case ResponseMethod::Mitsunaga:
            return "mitsunaga";
        case ResponseMethod::Robertson:
            return "robertson";
        case ResponseMethod::Basis:
            return "basis";
    }
    return "debevec";
}

Findings ResponseOptions::validate() const
{
    Findings findings;
    if (samples < 50)
        findings.push_back({Severity::Error,
                            "response-options",
                            fmt::format("samples is {}, must be at least 50", samples)});
    if (!(smoothness > 0.0) || !std::isfinite(smoothness))
        findings.push_back({Severity::Error,
                            "response-options",
                            fmt::format("smoothness is {}, must be > 0", smoothness)});
    return findings;
}

ResponseRecovery recoverResponse(const Bracket& bracket, const ResponseOptions& options)
{
    requireValid(options.validate(), "response options");
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    if (hasFinding(bracket.findings, "bracket-single-exposure"))
        return notRecoverable(bracket, "all images have the same exposure");

    if (bracket.frames.size() < 3) return recoverFromPatches(bracket, options);
    detail::BracketPixels pixels = detail::readBracketPixels(bracket);
    const auto triples = detail::countTriples(pixels);
    const Findings order = detail::orderFindings(bracket, triples[1]);
    Evidence evidence = detail::gatherEvidence(bracket, std::move(pixels), triples);
    std::size_t channels = 0;
    for (const PixelGroups& groups : evidence.groups)
        channels += groups.empty() ? 0 : 1;
    ResponseRecovery recovery;
    if (order.size() + 1 == bracket.frames.size())
        recovery = notRecoverable(bracket, "no image is brighter than the next shorter one");
    else if (channels == 0)
        recovery = recoverFromPatches(bracket, options);
    else
        recovery = recoverFromGroups(bracket, std::move(evidence), options);
    append(recovery.findings, order);
    return recovery;
}

}  // namespace insitu
