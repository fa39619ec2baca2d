#include "capture/noise_blocks.h"
#include "capture/noise_model.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

// Two neighbouring frames show the same scene: with rho = t_1 / t_2, the residual of exposures
// d = x_1 - rho x_2 holds noise only, of variance V(x_1) + rho^2 V(x_2). V is linear in its three
// unknowns (read variance, gain, code variance), so many blocks at many levels give a linear least
// squares problem. In each block the best mean u = a x_1 + (1 - a) rho x_2, a = rho^2 V_2 /
// (V_1 + rho^2 V_2), is uncorrelated with d, for Gaussian noise independent of it: taking the
// blocks where u is flattest avoids texture without preferring quiet samples of the noise.

namespace insitu {

namespace {

/// Blocks taken from all pairs of frames together, evenly.
constexpr std::int64_t kBlocks = 3000;
/// Levels per factor of two; the flattest share of the blocks of each is used.
constexpr double kLevelsPerOctave = 2.0;
constexpr double kFlatShare = 0.5;
/// A residual below this many times its rounding is not used: rounding is noise of its own only
/// when other noise is a third of a code or more.
constexpr double kLeastOverRounding = 2.3;
/// Below so many blocks in use, or so wide a range of levels, a channel cannot tell.
constexpr std::size_t kLeastBlocks = 24;
constexpr double kLeastRange = 2.0;
/// Levels whose residual is so far above the fit hold texture or motion.
constexpr double kOutlierRatio = 1.5;
/// A factor e of uncertainty in each unknown of the assumed noise, as a weight.
constexpr double kPriorWeight = 1.0;

using Unknowns = std::array<double, 3>;  // read variance, gain, code variance beyond rounding

/// Mean over blocks of one level: an equation row · unknowns = residual.
struct Level {
    Unknowns row{};
    double residual = 0.0;
    double rounding = 0.0;  ///< part of the residual that is known
    double blocks = 0.0;
};

class Estimator {
public:
    Estimator(const Bracket& bracket, const ResponseCurve& response)
        : bracket_(bracket),
          response_(response),
          max_code_(bracket.frames.front().image.max_code),
          assumed_(assumedNoise(response, bracket.metadata.exposure.iso, max_code_))
    {
    }

    [[nodiscard]] NoiseEstimate estimate() const
    {
        NoiseEstimate result{assumed_, {}};
        const std::size_t pairs = bracket_.frames.size() - 1;
        std::vector<std::array<std::vector<NoiseBlock>, 3>> blocks(pairs);
        if (pairs > 0) {
            const std::int64_t most = kBlocks / static_cast<std::int64_t>(pairs) + 1;
            const NoiseBlockReader reader(response_, max_code_);
            parallelFor(0, static_cast<std::int64_t>(pairs), [&](std::int64_t pair) {
                const auto k = static_cast<std::size_t>(pair);
                blocks[k] = reader.read(bracket_.frames[k], bracket_.frames[k + 1], most);
            });
        }
        std::string untold;
        for (std::size_t c = 0; c < 3; ++c) {
            std::vector<std::vector<NoiseBlock>> of_channel;
            for (auto& pair : blocks)
                of_channel.push_back(std::move(pair[c]));
            if (!estimateChannel(static_cast<int>(c), of_channel, result.model.channels[c]))
                untold += fmt::format("{}{}", untold.empty() ? "" : ", ", "RGB"[c]);
        }
        if (!untold.empty()) result.findings.push_back(assumedFinding(untold));
        return result;
    }

private:
    [[nodiscard]] Finding assumedFinding(const std::string& channels) const
    {
        const auto iso = bracket_.metadata.exposure.iso;
        return {Severity::Info,
                "noise-model-assumed",
                fmt::format("the bracket does not show its noise (channels {}): weights and stated "
                            "variance take a common camera's at ISO {}",
                            channels,
                            iso ? fmt::format("{:g}", *iso) : "800, since none is known")};
    }

    [[nodiscard]] double slopeAt(int c, double code) const
    {
        const double z = std::clamp(code, 0.5, 254.5);
        return response_.decode(c, z + 0.5) - response_.decode(c, z - 0.5);
    }

    [[nodiscard]] double rounding() const { return 255.0 * 255.0 / (12.0 * max_code_ * max_code_); }

    [[nodiscard]] double flatnessOf(const NoiseBlock& block, int c, const NoiseModel& noise) const
    {
        const double v1 = noise.variance(response_, c, block.z1);
        const double v2 = block.rho * block.rho * noise.variance(response_, c, block.z2);
        const double a = v2 / (v1 + v2);
        const double b = 1.0 - a;
        const double variance =
            a * a * block.var1 + b * b * block.var2 + 2.0 * a * b * block.covariance;
        return variance * (v1 + v2) / (v1 * v2);
    }

    /// The flattest blocks of one level of one pair as one equation; `blocks` is reordered.
    [[nodiscard]] Level levelOf(std::span<NoiseBlock> blocks, int c, const NoiseModel& noise) const
    {
        for (NoiseBlock& block : blocks)
            block.flatness = flatnessOf(block, c, noise);
        std::ranges::sort(blocks, {}, &NoiseBlock::flatness);
        const auto used =
            static_cast<std::size_t>(std::ceil(kFlatShare * static_cast<double>(blocks.size())));
        const std::span<NoiseBlock> flat = blocks.first(used);
        std::ranges::sort(flat, {}, [](const NoiseBlock& b) { return b.residual() / b.x1; });
        Level level;
        level.residual = flat[used / 2].residual() / flat[used / 2].x1;
        double x1 = 0.0;
        for (const NoiseBlock& b : flat) {
            const double s1 = slopeAt(c, b.z1);
            const double s2 = b.rho * slopeAt(c, b.z2);
            level.row[0] += 1.0 + b.rho * b.rho;
            level.row[1] += b.x1 + b.rho * b.rho * b.x2;
            level.row[2] += s1 * s1 + s2 * s2;
            x1 += b.x1;
        }
        for (double& value : level.row)
            value /= static_cast<double>(used);
        level.residual *= x1 / static_cast<double>(used);
        level.rounding = rounding() * level.row[2];
        level.blocks = static_cast<double>(used);
        return level;
    }

    [[nodiscard]] std::vector<Level> levelsOf(std::vector<std::vector<NoiseBlock>>& pairs,
                                              int c,
                                              const NoiseModel& noise) const
    {
        const auto levelIndex = [](const NoiseBlock& b) {
            return std::floor(kLevelsPerOctave * std::log2(b.x1));
        };
        std::vector<Level> levels;
        for (auto& blocks : pairs) {
            std::ranges::stable_sort(blocks, {}, [](const NoiseBlock& b) { return b.x1; });
            for (auto first = blocks.begin(); first != blocks.end();) {
                const auto last = std::find_if(first, blocks.end(), [&](const NoiseBlock& b) {
                    return levelIndex(b) != levelIndex(*first);
                });
                levels.push_back(levelOf({first, last}, c, noise));
                first = last;
            }
        }
        return levels;
    }

    [[nodiscard]] bool estimateChannel(int c,
                                       std::vector<std::vector<NoiseBlock>>& pairs,
                                       ChannelNoise& result) const
    {
        NoiseModel noise = assumed_;
        ChannelNoise& fitted = noise.channels[static_cast<std::size_t>(c)];
        constexpr int kRounds = 3;
        for (int round = 0; round < kRounds; ++round) {
            std::vector<Level> levels = levelsOf(pairs, c, noise);
            if (!canTell(levels)) return false;
            const std::vector<Level> all = levels;
            std::erase_if(levels, [&](const Level& level) {
                return level.residual <= kLeastOverRounding * level.rounding;
            });
            if (!canTell(levels)) {
                result = belowRounding(all);
                return true;
            }
            fitted = fit(levels, c, fitted);
            std::erase_if(levels, [&](const Level& level) {
                return level.residual > kOutlierRatio * predicted(level, fitted);
            });
            if (!canTell(levels)) return false;
            fitted = fit(levels, c, fitted);
        }
        fitted.neighbour_correlation = correlation(pairs);
        result = fitted;
        return true;
    }

    /// Noise that rounding hides nearly everywhere: what is left above rounding counts as photons'.
    [[nodiscard]] ChannelNoise belowRounding(const std::vector<Level>& levels) const
    {
        double excess = 0.0;
        double exposure = 0.0;
        for (const Level& level : levels) {
            excess += level.blocks * (level.residual - level.rounding);
            exposure += level.blocks * level.row[1];
        }
        ChannelNoise noise;
        noise.gain = std::max(0.0, excess) / exposure;
        noise.code_variance = rounding();
        return noise;
    }

    [[nodiscard]] static bool canTell(const std::vector<Level>& levels)
    {
        double blocks = 0.0;
        double least = 0.0;
        double greatest = 0.0;
        for (const Level& level : levels) {
            blocks += level.blocks;
            least = least > 0.0 ? std::min(least, level.row[1]) : level.row[1];
            greatest = std::max(greatest, level.row[1]);
        }
        return blocks >= static_cast<double>(kLeastBlocks) && greatest >= kLeastRange * least;
    }

    [[nodiscard]] double predicted(const Level& level, const ChannelNoise& noise) const
    {
        return level.row[0] * noise.read_variance + level.row[1] * noise.gain +
               level.row[2] * noise.code_variance;
    }

    /// Weighted least squares for unknowns >= 0, weights by the residuals' own spread at `current`
    /// (a median of variances of NoiseBlock::kFreedoms degrees each), with the assumed noise as a
    /// weak prior.
    [[nodiscard]] ChannelNoise fit(const std::vector<Level>& levels,
                                   int c,
                                   const ChannelNoise& current) const
    {
        const ChannelNoise& prior = assumed_.channels[static_cast<std::size_t>(c)];
        const Unknowns scale = {prior.read_variance, prior.gain, rounding()};
        std::array<Unknowns, 3> normal{};
        Unknowns right{};
        for (const Level& level : levels) {
            const double expected = predicted(level, current);
            constexpr double kMedianSpread = 1.57;  // pi / 2: a median against a mean
            const double weight = level.blocks * NoiseBlock::kFreedoms / (2.0 * kMedianSpread);
            for (std::size_t i = 0; i < 3; ++i) {
                const double row_i = level.row[i] * scale[i] / expected;
                right[i] += weight * row_i * (level.residual - level.rounding) / expected;
                for (std::size_t j = 0; j < 3; ++j)
                    normal[i][j] += weight * row_i * level.row[j] * scale[j] / expected;
            }
        }
        const Unknowns assumed = {1.0, 1.0, 0.0};
        for (std::size_t i = 0; i < 3; ++i) {
            normal[i][i] += kPriorWeight;
            right[i] += kPriorWeight * assumed[i];
        }
        const Unknowns solution = solveNotNegative(normal, right);
        ChannelNoise result = current;
        result.read_variance = solution[0] * scale[0];
        result.gain = solution[1] * scale[1];
        result.code_variance = rounding() + solution[2] * scale[2];
        return result;
    }

    /// Minimum of a convex quadratic over unknowns >= 0, by coordinate descent.
    [[nodiscard]] static Unknowns solveNotNegative(const std::array<Unknowns, 3>& normal,
                                                   const Unknowns& right)
    {
        Unknowns x{};
        constexpr int kSweeps = 2000;
        constexpr double kStill = 1e-9;
        double change = 1.0;
        for (int sweep = 0; sweep < kSweeps && change > kStill; ++sweep) {
            change = 0.0;
            for (std::size_t i = 0; i < 3; ++i) {
                double rest = right[i];
                for (std::size_t j = 0; j < 3; ++j)
                    if (j != i) rest -= normal[i][j] * x[j];
                const double better = std::max(0.0, rest / normal[i][i]);
                change = std::max(change, std::abs(better - x[i]));
                x[i] = better;
            }
        }
        return x;
    }

    /// Median over all blocks of what neighbours share.
    [[nodiscard]] static double correlation(const std::vector<std::vector<NoiseBlock>>& pairs)
    {
        std::vector<double> ratios;
        for (const auto& blocks : pairs)
            for (const NoiseBlock& block : blocks)
                if (block.residual() > 0.0) ratios.push_back(block.neighbours / block.residual());
        if (ratios.empty()) return 0.0;
        const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
        std::ranges::nth_element(ratios, middle);
        return std::clamp(*middle, -1.0, 1.0);
    }

    const Bracket& bracket_;
    const ResponseCurve& response_;
    int max_code_;
    NoiseModel assumed_;
};

}  // namespace

NoiseEstimate estimateNoise(const Bracket& bracket, const ResponseCurve& response)
{
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    return Estimator(bracket, response).estimate();
}

}  // namespace insitu
