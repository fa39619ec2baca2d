#include "capture/response_recovery.h"

#include "capture/held_out.h"
#include "capture/response_finish.h"
#include "capture/response_fit.h"
#include "capture/response_methods.h"
#include "capture/response_patches.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace insitu {

namespace {

using detail::BracketPixels;
using detail::CodeReach;
using detail::CurveFit;
using detail::LogCurve;
using detail::PatchObservations;
using detail::PixelGroups;

/// Fewer patches, or groups of pixels, than this cannot carry a curve.
constexpr std::size_t kFewestPatches = 20;
constexpr std::size_t kFewestGroups = 24;
/// Scale of ResponseOptions::smoothness for groups of pixels and a bracket of 1 EV steps. In clean
/// brackets anything from a tenth to twice as much does equally well, in the truth rooms (2 EV)
/// from a third to three times as much.
constexpr double kGroupSmoothness = 0.16;
/// Steps of the bracket that smoothness is scaled for, EV: see smoothModel.
constexpr double kLeastStep = 1.0;
constexpr double kMostStep = 2.0;
constexpr double kLongStep = 1.5;
constexpr double kBetterLoose = 0.98;
/// Share of blocks in which something moved: below, they are not worth a second solution; above,
/// it is not they that are wrong.
constexpr double kFewMoved = 5e-4;
constexpr double kMostMoved = 0.5;
/// Pixels on which methods are compared.
constexpr std::size_t kJudgedPixels = 4000;
/// How much better than the ones before it (as a factor) a method must be to be chosen. Prediction
/// does not see errors that repeat with the bracket's step, and JPEG's own errors reward a curve
/// that follows them: in truth room c, polynomials predict a tenth better and are five times as
/// wrong. So the methods without a prior on the curve's shape must be clearly better.
constexpr double kBetterBasis = 0.98;
constexpr double kBetterWithoutPrior = 0.88;

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

/// Makes the table; false when there is none.
bool makeCurve(std::array<LogCurve, 3> log_curves,
               const std::array<CodeReach, 3>& reaches,
               const std::array<int, 3>& floor,
               ResponseMethod method,
               ResponseCurve& curve)
{
    detail::borrowShapes(log_curves, reaches);
    for (std::size_t c = 0; c < 3; ++c) {
        for (const double value : log_curves[c])
            if (!std::isfinite(value) || std::abs(value) > 80.0) return false;
        detail::applyFloor(log_curves[c], floor[c], reaches[c].low);
        detail::makeIncreasing(log_curves[c]);
        for (std::size_t z = 0; z < log_curves[c].size(); ++z)
            curve.exposure[c][z] = std::exp(log_curves[c][z] - log_curves[c][128]);
    }
    curve.source = responseMethodName(method);
    return true;
}

/// -1 when there is nothing to predict.
double judge(const Bracket& bracket,
             const ResponseCurve& curve,
             const std::vector<double>& scale,
             std::size_t most_pixels)
{
    HeldOutOptions options;
    options.exposure_scale = scale;
    options.most_pixels = most_pixels;
    const HeldOutError error = predictHeldOut(bracket, curve, options);
    return error.count > 0 ? error.mean_codes : -1.0;
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
    if (!makeCurve(log_curves, reaches, {}, ResponseMethod::Debevec, recovery.curve))
        return notRecoverable(bracket, "the equations have no solution");
    recovery.method = ResponseMethod::Debevec;
    recovery.exposure_scale.assign(bracket.frames.size(), 1.0);
    recovery.held_out_error_codes =
        judge(bracket, recovery.curve, recovery.exposure_scale, kJudgedPixels);
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

std::array<PixelGroups, 3> groupChannels(
    const std::array<std::vector<detail::FrameTriple>, 3>& triples, const std::array<int, 3>& floor)
{
    std::array<PixelGroups, 3> groups;
    parallelFor(0, 3, [&](std::int64_t channel) {
        const auto c = static_cast<std::size_t>(channel);
        groups[c] = detail::groupByCode(triples[c], floor[c]);
        if (groups[c].size() < kFewestGroups) groups[c].clear();
    });
    return groups;
}

/// What all methods start from.
struct Evidence {
    BracketPixels pixels;
    std::array<PixelGroups, 3> groups;
    std::array<CodeReach, 3> reaches{};
    std::vector<double> log_exposures;  ///< refined
    CurveFit smooth;                    ///< method Debevec: it also found the refinement
    double moved = 0.0;                 ///< share of blocks dropped
};

std::vector<double> logExposures(const Bracket& bracket)
{
    std::vector<double> result;
    for (const BracketFrame& frame : bracket.frames)
        result.push_back(std::log(frame.relative_exposure));
    return result;
}

/// Median step of the bracket, EV.
double medianStep(const std::vector<double>& log_exposures)
{
    std::vector<double> steps;
    for (std::size_t k = 0; k + 1 < log_exposures.size(); ++k)
        steps.push_back((log_exposures[k] - log_exposures[k + 1]) / std::log(2.0));
    std::ranges::sort(steps);
    return steps[steps.size() / 2];
}

/// First solution, without the places that it shows to have moved.
void solveSmooth(Evidence& evidence, const ResponseOptions& options)
{
    const double step = std::clamp(medianStep(evidence.log_exposures), kLeastStep, kMostStep);
    const detail::CurveModel model =
        detail::smoothModel(options.smoothness * kGroupSmoothness * std::pow(step, 6.0));
    const auto solve = [&] {
        evidence.smooth = detail::fitCurves(
            evidence.groups, evidence.log_exposures, model, options.refine_exposures);
    };
    solve();
    std::vector<double> refined = evidence.log_exposures;
    for (std::size_t k = 0; k < refined.size(); ++k)
        refined[k] += evidence.smooth.log_scale[k];
    BracketPixels still = evidence.pixels;
    const double moved = detail::dropMovedBlocks(still, evidence.smooth.decoder, refined);
    if (moved >= kFewMoved && moved <= kMostMoved) {
        std::array<PixelGroups, 3> groups = groupChannels(detail::countTriples(still), still.floor);
        // What is left must carry a curve wherever all did.
        bool enough = true;
        for (std::size_t c = 0; c < 3; ++c)
            enough = enough && groups[c].empty() == evidence.groups[c].empty();
        if (enough) {
            evidence.moved = moved;
            evidence.pixels = std::move(still);
            evidence.groups = std::move(groups);
            solve();
        }
    }
    for (std::size_t k = 0; k < refined.size(); ++k)
        evidence.log_exposures[k] += evidence.smooth.log_scale[k];
    for (std::size_t c = 0; c < 3; ++c)
        evidence.reaches[c] = detail::reachOf(evidence.groups[c]);
}

/// About kJudgedPixels of the pixels that inform the curves, side by side; where a frame is not
/// clean its code is 255, which neither predicts nor is predicted.
Bracket judgedPlaces(const Bracket& bracket, const BracketPixels& pixels)
{
    const std::size_t step = std::max<std::size_t>(1, pixels.usable.size() / kJudgedPixels);
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < pixels.usable.size(); i += step)
        if (pixels.usable[i] != 0) places.push_back(i);
    Bracket judged;
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        const detail::CodePlanes& planes = pixels.frames[k];
        BracketFrame frame;
        frame.relative_exposure = bracket.frames[k].relative_exposure;
        frame.image.codes = Image<glm::u16vec3>(static_cast<int>(places.size()), 1);
        for (std::size_t i = 0; i < places.size(); ++i)
            for (std::size_t c = 0; c < 3; ++c)
                frame.image.codes(static_cast<int>(i), 0)[static_cast<int>(c)] =
                    planes.clean[places[i]] != 0 ? planes.codes[c][places[i]] : std::uint8_t{255};
        judged.frames.push_back(std::move(frame));
    }
    return judged;
}

struct Candidate {
    ResponseMethod method = ResponseMethod::Debevec;
    ResponseCurve curve;
    double error = -1.0;
};

std::optional<Candidate> tryMethod(const Evidence& evidence, ResponseMethod method)
{
    detail::Decoders decoders;
    switch (method) {
        case ResponseMethod::Auto:
        case ResponseMethod::Debevec:
            decoders = evidence.smooth.decoder;
            break;
        case ResponseMethod::Mitsunaga:
            decoders = detail::fitPolynomials(evidence.groups, evidence.log_exposures);
            break;
        case ResponseMethod::Robertson:
            decoders = detail::iterateTables(evidence.pixels, evidence.log_exposures);
            break;
        case ResponseMethod::Basis:
            decoders = detail::fitCurves(
                           evidence.groups, evidence.log_exposures, detail::basisModel(), false)
                           .decoder;
            break;
    }
    if (!decoders) return std::nullopt;
    std::array<LogCurve, 3> log_curves{};
    for (std::size_t c = 0; c < 3; ++c)
        log_curves[c] = detail::curveOfDecoder((*decoders)[c], evidence.pixels.rounding_variance);
    Candidate candidate;
    candidate.method = method;
    if (!makeCurve(log_curves, evidence.reaches, evidence.pixels.floor, method, candidate.curve))
        return std::nullopt;
    return candidate;
}

/// The best of all methods by held-out prediction, and the finding that says so.
Candidate chooseMethod(const Bracket& places,
                       const Evidence& evidence,
                       const std::vector<double>& scale,
                       Findings& findings)
{
    std::optional<Candidate> best;
    std::string errors;
    for (const ResponseMethod method : {ResponseMethod::Debevec,
                                        ResponseMethod::Basis,
                                        ResponseMethod::Mitsunaga,
                                        ResponseMethod::Robertson}) {
        std::optional<Candidate> candidate = tryMethod(evidence, method);
        if (!errors.empty()) errors += ", ";
        errors += responseMethodName(method);
        if (!candidate) {
            errors += " none";
            continue;
        }
        candidate->error = judge(places, candidate->curve, scale, 0);
        errors += fmt::format(" {:.3f}", candidate->error);
        const double factor = method == ResponseMethod::Basis ? kBetterBasis : kBetterWithoutPrior;
        if (!best || (candidate->error >= 0.0 && candidate->error < factor * best->error))
            best = std::move(candidate);
    }
    INSITU_CHECK(best.has_value(), "no curve although the smooth one is finite");
    findings.push_back(
        {Severity::Info,
         "response-method-chosen",
         fmt::format("method {}; mean error of codes of exposures predicted from the "
                     "others: {}",
                     responseMethodName(best->method),
                     errors)});
    return *std::move(best);
}

/// Smoothness for long steps is stiff. The one for 1 EV replaces the smooth one when it
/// predicts clearly better: a strong shoulder that the prior does not allow for.
void loosen(const Bracket& places, Evidence& evidence, const ResponseOptions& options)
{
    const double step = medianStep(evidence.log_exposures);
    if (step < kLongStep) return;
    Evidence loose = evidence;
    loose.smooth = detail::fitCurves(evidence.groups,
                                     evidence.log_exposures,
                                     detail::smoothModel(options.smoothness * kGroupSmoothness),
                                     false);
    loose.smooth.log_scale = evidence.smooth.log_scale;
    const std::optional<Candidate> stiff = tryMethod(evidence, ResponseMethod::Debevec);
    const std::optional<Candidate> other = tryMethod(loose, ResponseMethod::Debevec);
    if (!stiff || !other) return;
    std::vector<double> scale;
    for (const double log_scale : evidence.smooth.log_scale)
        scale.push_back(std::exp(log_scale));
    if (judge(places, other->curve, scale, 0) <
        kBetterLoose * judge(places, stiff->curve, scale, 0))
        evidence.smooth = std::move(loose.smooth);
}

ResponseRecovery recoverFromGroups(const Bracket& bracket,
                                   Evidence evidence,
                                   const ResponseOptions& options)
{
    solveSmooth(evidence, options);
    ResponseRecovery recovery;
    for (const double log_scale : evidence.smooth.log_scale)
        recovery.exposure_scale.push_back(std::exp(log_scale));
    const Bracket places = judgedPlaces(bracket, evidence.pixels);
    loosen(places, evidence, options);
    recovery.residual = evidence.smooth.residual;
    std::optional<Candidate> chosen = tryMethod(evidence, ResponseMethod::Debevec);
    if (!chosen) return notRecoverable(bracket, "the equations have no solution");
    if (options.method == ResponseMethod::Auto) {
        chosen = chooseMethod(places, evidence, recovery.exposure_scale, recovery.findings);
    } else if (options.method != ResponseMethod::Debevec) {
        if (std::optional<Candidate> asked = tryMethod(evidence, options.method)) {
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
    recovery.held_out_error_codes = chosen->error >= 0.0
                                        ? chosen->error
                                        : judge(places, chosen->curve, recovery.exposure_scale, 0);
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

void checkOptions(const ResponseOptions& options)
{
    const Findings problems = options.validate();
    if (!problems.empty()) throw InputError("response options", problems.front().message);
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
    checkOptions(options);
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    if (hasFinding(bracket.findings, "bracket-single-exposure"))
        return notRecoverable(bracket, "all images have the same exposure");

    if (bracket.frames.size() < 3) return recoverFromPatches(bracket, options);
    Evidence evidence;
    evidence.pixels = detail::readBracketPixels(bracket);
    evidence.log_exposures = logExposures(bracket);
    const auto triples = detail::countTriples(evidence.pixels);
    const Findings order = detail::orderFindings(bracket, triples[1]);
    evidence.groups = groupChannels(triples, evidence.pixels.floor);
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
