#include "capture/response_recovery.h"

#include "capture/response_samples.h"
#include "capture/response_solve.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu {

namespace {

using detail::kPatchSide;
using detail::LogCurve;
using detail::PatchObservation;
using detail::PatchObservations;
using detail::ResponseSample;
using detail::ResponseSolution;

/// Fewer patches than this cannot carry a curve.
constexpr std::size_t kFewestPatches = 20;
/// Exposures nearer than this are no two exposures.
constexpr double kLeastRatio = 1.01;
/// Smallest step of ln(exposure) between codes after the monotone fix.
constexpr double kSmallestStep = 1e-5;
/// Codes that every channel's samples should reach; else the curve's ends are extrapolated.
constexpr double kLowReach = 16.0;
constexpr double kHighReach = 240.0;

PatchObservation observe(const BracketFrame& frame, ResponseSample sample, int channel)
{
    PatchObservation observation;
    observation.log_exposure = std::log(frame.relative_exposure);
    std::array<double, 256> shares{};
    double squares = 0.0;
    constexpr double kShare = 1.0 / (kPatchSide * kPatchSide);
    for (int y = sample.y; y < sample.y + kPatchSide; ++y) {
        for (int x = sample.x; x < sample.x + kPatchSide; ++x) {
            const double code = detail::codeOn255(frame.image, x, y, channel);
            const auto low = std::min<std::size_t>(static_cast<std::size_t>(code), 254);
            const double t = code - static_cast<double>(low);
            shares[low] += (1.0 - t) * kShare;
            shares[low + 1] += t * kShare;
            observation.mean_code += code * kShare;
            squares += code * code * kShare;
        }
    }
    observation.code_variance =
        std::max(squares - observation.mean_code * observation.mean_code, 0.0);
    for (std::size_t z = 0; z < shares.size(); ++z)
        if (shares[z] > 0.0) observation.histogram.emplace_back(static_cast<int>(z), shares[z]);
    return observation;
}

/// The patches of one channel that are useful in two different exposures or more.
std::vector<PatchObservations> observeChannel(const Bracket& bracket,
                                              const std::vector<ResponseSample>& samples,
                                              int channel)
{
    std::vector<PatchObservations> patches;
    for (const ResponseSample sample : samples) {
        PatchObservations patch;
        double longest = 0.0;
        double shortest = std::numeric_limits<double>::infinity();
        for (const BracketFrame& frame : bracket.frames) {
            patch.push_back(observe(frame, sample, channel));
            patch.back().clean = detail::usefulMeanCode(frame.image, sample, channel) >= 0.0;
            if (!patch.back().clean) continue;
            longest = std::max(longest, frame.relative_exposure);
            shortest = std::min(shortest, frame.relative_exposure);
        }
        if (longest < kLeastRatio * shortest) continue;
        patches.push_back(std::move(patch));
    }
    return patches;
}

/// Isotonic regression (pool adjacent violators, [BarBrunk72]) and then a least step, so that the
/// table is strictly increasing.
void makeIncreasing(LogCurve& curve)
{
    struct Pool {
        double sum;
        int count;
    };
    std::vector<Pool> pools;
    for (const double value : curve) {
        pools.push_back({value, 1});
        while (pools.size() > 1) {
            const Pool last = pools.back();
            Pool& before = pools[pools.size() - 2];
            if (before.sum / before.count < last.sum / last.count) break;
            before.sum += last.sum;
            before.count += last.count;
            pools.pop_back();
        }
    }
    std::size_t z = 0;
    for (const Pool& pool : pools) {
        for (int i = 0; i < pool.count; ++i, ++z) {
            double value = pool.sum / pool.count;
            if (z > 0) value = std::max(value, curve[z - 1] + kSmallestStep);
            curve[z] = value;
        }
    }
}

ResponseRecovery notRecoverable(const std::string& why)
{
    ResponseRecovery recovery;
    recovery.curve = ResponseCurve::srgb();
    recovery.findings.push_back(
        {Severity::Warning,
         "response-not-recoverable",
         fmt::format("the camera's response cannot be measured from this bracket ({}); the sRGB "
                     "curve is used, so radiance between exposures may be wrong",
                     why)});
    return recovery;
}

void reportReach(const std::array<std::vector<PatchObservations>, 3>& channels, Findings& findings)
{
    double low = 0.0;
    double high = 255.0;
    for (const auto& patches : channels) {
        double channel_low = 255.0;
        double channel_high = 0.0;
        for (const PatchObservations& patch : patches) {
            for (const PatchObservation& o : patch) {
                if (!o.clean) continue;
                channel_low = std::min(channel_low, o.mean_code);
                channel_high = std::max(channel_high, o.mean_code);
            }
        }
        low = std::max(low, channel_low);
        high = std::min(high, channel_high);
    }
    if (low > kLowReach || high < kHighReach)
        findings.push_back(
            {Severity::Info,
             "response-partly-extrapolated",
             fmt::format("the bracket shows codes {:.0f} to {:.0f} in all channels; the camera's "
                         "response outside is extrapolated",
                         low,
                         high)});
}

void checkOptions(const ResponseOptions& options)
{
    const Findings problems = options.validate();
    if (!problems.empty()) throw InputError("response options", problems.front().message);
}

}  // namespace

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
        return notRecoverable("all images have the same exposure");

    const std::vector<ResponseSample> samples =
        detail::selectResponseSamples(bracket, options.samples);
    std::array<std::vector<PatchObservations>, 3> channels;
    for (std::size_t c = 0; c < 3; ++c) {
        channels[c] = observeChannel(bracket, samples, static_cast<int>(c));
        if (channels[c].size() < kFewestPatches)
            return notRecoverable(
                fmt::format("only {} places are neither clipped nor black in two "
                            "exposures",
                            channels[c].size()));
    }
    std::array<ResponseSolution, 3> solutions;
    parallelFor(0, 3, [&](std::int64_t c) {
        const auto channel = static_cast<std::size_t>(c);
        solutions[channel] = detail::solveResponse(channels[channel], options.smoothness);
    });

    ResponseRecovery recovery;
    recovery.curve.source = "debevec";
    for (std::size_t c = 0; c < 3; ++c) {
        LogCurve& log_curve = solutions[c].log_curve;
        for (const double value : log_curve)
            if (!std::isfinite(value)) return notRecoverable("the equations have no solution");
        makeIncreasing(log_curve);
        for (std::size_t z = 0; z < log_curve.size(); ++z)
            recovery.curve.exposure[c][z] = std::exp(log_curve[z] - log_curve[128]);
        recovery.residual[c] = solutions[c].residual;
    }
    reportReach(channels, recovery.findings);
    return recovery;
}

}  // namespace insitu
