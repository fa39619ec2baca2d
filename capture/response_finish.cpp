#include "capture/response_finish.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace insitu::detail {

namespace {

/// The next code's exposure over that of the level of black, which is any lower one.
constexpr double kBlackRatio = 1000.0;
/// Smallest step of ln(exposure) between codes after the monotone fix.
constexpr double kSmallestStep = 1e-5;
/// Codes that every channel's samples should reach; else the curve's ends are extrapolated.
constexpr double kLowReach = 16.0;
constexpr double kHighReach = 240.0;
/// Share of a view that lies beyond what counts as its reach, at either end.
constexpr double kTail = 0.02;
/// Codes before the end of a reach over which slopes are compared; a quarter at the dark end.
constexpr std::size_t kJunction = 32;
/// Corrections of ln exposure beyond rounding of nominal times: the list is wrong.
constexpr double kMismatch = 0.15;
/// Two frames whose codes differ by less than this share are the same picture; codes below
/// kShowsFrom may be black, fewer pixels than kFewestCompared say nothing.
constexpr double kSamePicture = 0.03;
constexpr int kShowsFrom = 48;
constexpr double kFewestCompared = 200.0;
/// Neighbours whose exposures (ln) differ by less may look the same.
constexpr double kVisibleRatio = 0.35;

double inEv(double log_ratio)
{
    return log_ratio / std::log(2.0);
}

/// Mean of the channels that reach from `low` to `high` of how far their curves rise there; nothing
/// when there are none.
std::optional<double> meanRise(const std::array<LogCurve, 3>& curves,
                               const std::array<CodeReach, 3>& reaches,
                               std::size_t low,
                               std::size_t high)
{
    double rise = 0.0;
    int channels = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        if (reaches[c].low > static_cast<double>(low)) continue;
        if (reaches[c].high < static_cast<double>(high)) continue;
        rise += curves[c][high] - curves[c][low];
        ++channels;
    }
    if (channels == 0) return std::nullopt;
    return rise / channels;
}

/// Own rise over that of the channels which go on beyond, where both are known, [low, high].
double steepness(const LogCurve& curve,
                 const std::array<LogCurve, 3>& curves,
                 const std::array<CodeReach, 3>& reaches,
                 std::size_t low,
                 std::size_t high,
                 std::size_t beyond)
{
    double own = 0.0;
    double others = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
        const double needed_low = static_cast<double>(std::min(low, beyond));
        const double needed_high = static_cast<double>(std::max(high, beyond));
        if (reaches[c].low > needed_low || reaches[c].high < needed_high) continue;
        own += curve[high] - curve[low];
        others += curves[c][high] - curves[c][low];
    }
    return others > 0.0 && own > 0.0 ? std::clamp(own / others, 0.5, 2.0) : 1.0;
}

/// Continues one curve step by step away from its reach; where no channel reaches, all go on alike,
/// so that greys stay grey.
void continueCurve(LogCurve& curve,
                   const std::array<LogCurve, 3>& curves,
                   const std::array<CodeReach, 3>& reaches,
                   CodeReach own)
{
    const auto top = static_cast<std::size_t>(std::clamp(own.high, 2.0, 254.0));
    const auto bottom = static_cast<std::size_t>(std::clamp(own.low, 1.0, 253.0));
    if (top <= bottom) return;
    const LogCurve measured = curve;
    // Of every channel that is measured anywhere, for steps that none of them is measured at.
    std::array<CodeReach, 3> anywhere = reaches;
    for (CodeReach& reach : anywhere)
        if (reach.low <= reach.high) reach = {0.0, 255.0};
    const auto riseOf = [&](std::size_t z, std::size_t from, std::size_t to, std::size_t beyond) {
        if (const auto others = meanRise(curves, reaches, z, z + 1))
            return *others * steepness(measured, curves, reaches, from, to, beyond);
        return *meanRise(curves, anywhere, z, z + 1);
    };
    const std::size_t inner = std::max(bottom, top - std::min(top, kJunction));
    for (std::size_t z = top; z + 1 < curve.size(); ++z)
        curve[z + 1] = curve[z] + riseOf(z, inner, top, z + 1);
    const std::size_t outer = std::min(top, bottom + kJunction / 4);
    for (std::size_t z = bottom; z > 0; --z)
        curve[z - 1] = curve[z] - riseOf(z - 1, bottom, outer, z - 1);
}

std::string describe(const Bracket& bracket, std::size_t frame, double log_scale)
{
    const double nominal = bracket.frames[frame].relative_exposure;
    return fmt::format("{}: given {:.4g}, measured {:.4g} ({:+.2f} EV)",
                       bracket.frames[frame].name,
                       nominal,
                       nominal * std::exp(log_scale),
                       inEv(log_scale));
}

/// Whether the second frame is hardly darker than the first where that shows something.
bool hardlyDarker(const JointCounts& counts)
{
    double difference = 0.0;
    double sum = 0.0;
    double total = 0.0;
    for (int a = kShowsFrom; a < 245; ++a) {
        for (int b = 0; b < kCodes; ++b) {
            const double n = counts[static_cast<std::size_t>(a * kCodes + b)];
            difference += n * (a - b);
            sum += n * a;
            total += n;
        }
    }
    return total >= kFewestCompared && difference < kSamePicture * sum;
}

}  // namespace

CodeReach reachOf(const PixelGroups& groups)
{
    CodeReach reach;
    for (const PixelGroup& group : groups) {
        for (const GroupView& view : group.views) {
            double below = 0.0;
            for (std::size_t i = 0; i < view.shares.size(); ++i) {
                const double code = view.low + static_cast<double>(i);
                const double share = static_cast<double>(view.shares[i]);
                if (below < 1.0 - kTail && below + share >= kTail) {
                    reach.low = std::min(reach.low, code);
                    reach.high = std::max(reach.high, code);
                }
                below += share;
            }
        }
    }
    return reach;
}

CodeReach reachOf(const std::vector<PatchObservations>& patches)
{
    CodeReach reach;
    for (const PatchObservations& patch : patches) {
        for (const PatchObservation& o : patch) {
            if (!o.clean) continue;
            reach.low = std::min(reach.low, o.mean_code);
            reach.high = std::max(reach.high, o.mean_code);
        }
    }
    return reach;
}

void borrowShapes(std::array<LogCurve, 3>& curves, const std::array<CodeReach, 3>& reaches)
{
    const std::array<LogCurve, 3> measured = curves;
    for (std::size_t c = 0; c < 3; ++c) {
        if (reaches[c].low <= reaches[c].high) {
            continueCurve(curves[c], measured, reaches, reaches[c]);
            continue;
        }
        LogCurve sum{};
        double channels = 0.0;
        for (std::size_t other = 0; other < 3; ++other) {
            if (reaches[other].low > reaches[other].high) continue;
            channels += 1.0;
            for (std::size_t z = 0; z < sum.size(); ++z)
                sum[z] += measured[other][z];
        }
        for (std::size_t z = 0; z < sum.size() && channels > 0.0; ++z)
            curves[c][z] = sum[z] / channels;
    }
}

void applyFloor(LogCurve& curve, int floor, double lowest)
{
    if (floor <= 0) return;
    const auto black = static_cast<std::size_t>(floor);
    const std::size_t from =
        std::clamp(static_cast<std::size_t>(lowest), black + 2, curve.size() - 2);
    for (std::size_t z = black + 1; z < from; ++z)
        curve[z] = curve[from] +
                   std::log(static_cast<double>(z - black) / static_cast<double>(from - black));
    curve[black] = curve[black + 1] - std::log(kBlackRatio);
    for (std::size_t z = black; z-- > 0;)
        curve[z] = curve[z + 1] - std::log(2.0);
}

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

Findings reachFindings(const std::array<CodeReach, 3>& reaches)
{
    Findings findings;
    double low = 0.0;
    double high = 255.0;
    for (std::size_t c = 0; c < 3; ++c) {
        if (reaches[c].low > reaches[c].high) {
            findings.push_back(
                {Severity::Warning,
                 "response-channel-borrowed",
                 fmt::format("the {} channel is neither clipped nor black in too few places; its "
                             "response is taken from the other channels",
                             std::array{"red", "green", "blue"}[c])});
            continue;
        }
        low = std::max(low, reaches[c].low);
        high = std::min(high, reaches[c].high);
    }
    if (low > kLowReach || high < kHighReach)
        findings.push_back(
            {Severity::Info,
             "response-partly-extrapolated",
             fmt::format("the bracket shows codes {:.0f} to {:.0f} in all channels; the camera's "
                         "response outside is extrapolated",
                         low,
                         high)});
    return findings;
}

Findings exposureFindings(const Bracket& bracket, const std::vector<double>& log_scale)
{
    Findings findings;
    std::string changed;
    for (std::size_t k = 0; k < log_scale.size(); ++k) {
        if (std::abs(log_scale[k]) > kMismatch)
            findings.push_back(
                {Severity::Warning,
                 "bracket-exposure-mismatch",
                 fmt::format("{}; the other exposures do not confirm it: check the list of "
                             "exposures, and that light and aperture did not change",
                             describe(bracket, k, log_scale[k]))});
        if (log_scale[k] != 0.0)
            changed += (changed.empty() ? "" : "; ") + describe(bracket, k, log_scale[k]);
    }
    if (!changed.empty())
        findings.push_back(
            {Severity::Info,
             "response-exposures-refined",
             fmt::format("the pictures show other exposures than given; the response "
                         "was found with: {}",
                         changed)});
    return findings;
}

Findings orderFindings(const Bracket& bracket, const std::vector<FrameTriple>& triples)
{
    Findings findings;
    for (std::size_t k = 0; k + 1 < bracket.frames.size(); ++k) {
        const BracketFrame& longer = bracket.frames[k];
        const BracketFrame& shorter = bracket.frames[k + 1];
        const double nominal = std::log(longer.relative_exposure / shorter.relative_exposure);
        const JointCounts& counts =
            k < triples.size() ? triples[k].first_middle : triples.back().middle_last;
        if (nominal < kVisibleRatio || !hardlyDarker(counts)) continue;
        findings.push_back({Severity::Warning,
                            "bracket-exposure-mismatch",
                            fmt::format("{} is given {:.4g}, {} {:.4g} ({:+.2f} EV), but it is not "
                                        "darker in the picture: check the list of exposures",
                                        longer.name,
                                        longer.relative_exposure,
                                        shorter.name,
                                        shorter.relative_exposure,
                                        -inEv(nominal))});
    }
    return findings;
}

}  // namespace insitu::detail
