#include "capture/response_candidates.h"

#include "capture/held_out.h"
#include "capture/response_methods.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace insitu::detail {

namespace {

/// Fewer groups of pixels than this cannot carry a curve.
constexpr std::size_t kFewestGroups = 24;
/// Scale of ResponseOptions::smoothness for groups of pixels and a bracket of 1 EV steps. Chosen on
/// synthetic brackets of one environment and on the truth rooms, which are also what is reported.
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
/// The numbers were chosen on the truth rooms and the three real brackets of response_peers.
constexpr double kBetterBasis = 0.98;
constexpr double kBetterWithoutPrior = 0.88;
/// A curve that rises over so many codes, of those that matter, by less than this share of what the
/// smooth one does has a plateau: codes there mean the same light.
constexpr std::size_t kPlateauCodes = 12;
constexpr double kPlateauShare = 0.125;
constexpr std::size_t kFirstCode = 16;
constexpr std::size_t kLastCode = 250;

std::array<PixelGroups, 3> groupChannels(const std::array<std::vector<FrameTriple>, 3>& triples,
                                         const std::array<int, 3>& floor)
{
    std::array<PixelGroups, 3> groups;
    parallelFor(0, 3, [&](std::int64_t channel) {
        const auto c = static_cast<std::size_t>(channel);
        groups[c] = groupByCode(triples[c], floor[c]);
        if (groups[c].size() < kFewestGroups) groups[c].clear();
    });
    return groups;
}

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

/// Whether light that is put back through the curve falls into steps. Prediction of codes does not
/// mind: what a table without smoothness says of codes that few places show is noise.
bool hasPlateau(const ResponseCurve& curve, const ResponseCurve& smooth)
{
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t z = kFirstCode; z + kPlateauCodes <= kLastCode; ++z) {
            const auto rise = [&](const ResponseCurve& of) {
                return std::log(of.exposure[c][z + kPlateauCodes] / of.exposure[c][z]);
            };
            if (rise(curve) < kPlateauShare * rise(smooth)) return true;
        }
    return false;
}

}  // namespace

Evidence gatherEvidence(const Bracket& bracket,
                        BracketPixels pixels,
                        const std::array<std::vector<FrameTriple>, 3>& triples)
{
    Evidence evidence;
    evidence.groups = groupChannels(triples, pixels.floor);
    evidence.pixels = std::move(pixels);
    evidence.log_exposures = logExposures(bracket);
    return evidence;
}

bool makeCurve(std::array<LogCurve, 3> log_curves,
               const std::array<CodeReach, 3>& reaches,
               const std::array<int, 3>& floor,
               ResponseMethod method,
               ResponseCurve& curve)
{
    borrowShapes(log_curves, reaches);
    for (std::size_t c = 0; c < 3; ++c) {
        for (const double value : log_curves[c])
            if (!std::isfinite(value) || std::abs(value) > 80.0) return false;
        applyFloor(log_curves[c], floor[c], reaches[c].low);
        makeIncreasing(log_curves[c]);
        for (std::size_t z = 0; z < log_curves[c].size(); ++z)
            curve.exposure[c][z] = std::exp(log_curves[c][z] - log_curves[c][128]);
    }
    curve.source = responseMethodName(method);
    return true;
}

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

void solveSmooth(Evidence& evidence, const ResponseOptions& options)
{
    const double step = std::clamp(medianStep(evidence.log_exposures), kLeastStep, kMostStep);
    const CurveModel model =
        smoothModel(options.smoothness * kGroupSmoothness * std::pow(step, 6.0));
    const auto solve = [&] {
        evidence.smooth =
            fitCurves(evidence.groups, evidence.log_exposures, model, options.refine_exposures);
    };
    solve();
    std::vector<double> refined = evidence.log_exposures;
    for (std::size_t k = 0; k < refined.size(); ++k)
        refined[k] += evidence.smooth.log_scale[k];
    BracketPixels still = evidence.pixels;
    const double moved = dropMovedBlocks(still, evidence.smooth.decoder, refined);
    if (moved >= kFewMoved && moved <= kMostMoved) {
        std::array<PixelGroups, 3> groups = groupChannels(countTriples(still), still.floor);
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
        evidence.reaches[c] = reachOf(evidence.groups[c]);
}

Bracket judgedPlaces(const Bracket& bracket, const BracketPixels& pixels)
{
    const std::size_t step = std::max<std::size_t>(1, pixels.usable.size() / kJudgedPixels);
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < pixels.usable.size(); i += step)
        if (pixels.usable[i] != 0) places.push_back(i);
    Bracket judged;
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        const CodePlanes& planes = pixels.frames[k];
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

std::optional<Candidate> tryMethod(const Evidence& evidence, ResponseMethod method)
{
    Decoders decoders;
    switch (method) {
        case ResponseMethod::Auto:
        case ResponseMethod::Debevec:
            decoders = evidence.smooth.decoder;
            break;
        case ResponseMethod::Mitsunaga:
            decoders = fitPolynomials(evidence.groups, evidence.log_exposures);
            break;
        case ResponseMethod::Robertson:
            decoders = iterateTables(evidence.pixels, evidence.log_exposures);
            break;
        case ResponseMethod::Basis:
            decoders =
                fitCurves(evidence.groups, evidence.log_exposures, basisModel(), false).decoder;
            break;
    }
    if (!decoders) return std::nullopt;
    std::array<LogCurve, 3> log_curves{};
    for (std::size_t c = 0; c < 3; ++c)
        log_curves[c] = curveOfDecoder((*decoders)[c], evidence.pixels.rounding_variance);
    Candidate candidate;
    candidate.method = method;
    if (!makeCurve(log_curves, evidence.reaches, evidence.pixels.floor, method, candidate.curve))
        return std::nullopt;
    return candidate;
}

Candidate chooseMethod(const Bracket& places,
                       const Evidence& evidence,
                       const std::vector<double>& scale,
                       Findings& findings)
{
    std::optional<Candidate> best;
    std::optional<ResponseCurve> smooth;
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
        if (!smooth) smooth = candidate->curve;  // the first has a prior of smoothness
        if (hasPlateau(candidate->curve, *smooth)) {
            errors += " (but has plateaus)";
            continue;
        }
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

void loosen(const Bracket& places, Evidence& evidence, const ResponseOptions& options)
{
    const double step = medianStep(evidence.log_exposures);
    if (step < kLongStep) return;
    Evidence loose = evidence;
    loose.smooth = fitCurves(evidence.groups,
                             evidence.log_exposures,
                             smoothModel(options.smoothness * kGroupSmoothness),
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

}  // namespace insitu::detail
