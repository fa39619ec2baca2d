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

/// Blocks span several of JPEG's 8x8, whose own means are coded too.
constexpr int kBlock = 16;
constexpr int kBlockPixels = kBlock * kBlock;
/// Per block: pixels less the plane that is taken out.
constexpr double kFreedoms = kBlockPixels - 3;
/// Blocks taken from all pairs of frames together, evenly.
constexpr std::int64_t kBlocks = 3000;
/// Codes used, fractions of full scale: away from black and from clipping.
constexpr double kLeastCode = 0.04;
constexpr double kGreatestCode = 0.97;
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

/// One block of a pair of frames: second moments of both after a plane was taken out.
struct Block {
    double x1 = 0.0;  ///< mean exposure in the longer frame
    double x2 = 0.0;  ///< in the shorter frame
    double z1 = 0.0;  ///< their codes, 8-bit steps
    double z2 = 0.0;
    double var1 = 0.0;
    double var2 = 0.0;  ///< of rho x_2
    double covariance = 0.0;
    double neighbours = 0.0;  ///< mean product of residuals side by side
    double rho = 1.0;
    double flatness = 0.0;  ///< variance of the best mean of both, over what noise explains

    [[nodiscard]] double residual() const { return var1 + var2 - 2.0 * covariance; }
};

/// Mean over blocks of one level: an equation row · unknowns = residual.
struct Level {
    Unknowns row{};
    double residual = 0.0;
    double rounding = 0.0;  ///< part of the residual that is known
    double blocks = 0.0;
};

using Samples = std::array<double, kBlockPixels>;

/// Takes the mean and the plane out of the samples; returns the mean.
double removePlane(Samples& samples)
{
    double sum = 0.0;
    double sum_x = 0.0;
    double sum_y = 0.0;
    constexpr double kMiddle = 0.5 * (kBlock - 1);
    for (int i = 0; i < kBlockPixels; ++i) {
        const double value = samples[static_cast<std::size_t>(i)];
        sum += value;
        sum_x += value * (i % kBlock - kMiddle);
        sum_y += value * (i / kBlock - kMiddle);
    }
    constexpr double kSquares = kBlockPixels * (kBlock * kBlock - 1) / 12.0;
    const double mean = sum / kBlockPixels;
    for (int i = 0; i < kBlockPixels; ++i)
        samples[static_cast<std::size_t>(i)] -= mean + sum_x / kSquares * (i % kBlock - kMiddle) +
                                                sum_y / kSquares * (i / kBlock - kMiddle);
    return mean;
}

double meanProduct(const Samples& a, const Samples& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        sum += a[i] * b[i];
    return sum / kFreedoms;
}

double neighbourProduct(const Samples& a, const Samples& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        if (i % kBlock + 1 < kBlock) sum += (a[i] - b[i]) * (a[i + 1] - b[i + 1]);
    return sum / (kBlock * (kBlock - 1));
}

class Estimator {
public:
    Estimator(const Bracket& bracket, const ResponseCurve& response)
        : bracket_(bracket),
          response_(response),
          max_code_(bracket.frames.front().image.max_code),
          assumed_(assumedNoise(response, bracket.metadata.exposure.iso, max_code_))
    {
        for (std::size_t c = 0; c < 3; ++c) {
            exposure_[c].resize(static_cast<std::size_t>(max_code_) + 1);
            for (std::size_t z = 0; z < exposure_[c].size(); ++z)
                exposure_[c][z] = response.decode(static_cast<int>(c),
                                                  static_cast<double>(z) * 255.0 / max_code_);
        }
    }

    [[nodiscard]] NoiseEstimate estimate() const
    {
        NoiseEstimate result{assumed_, {}};
        const std::size_t pairs = bracket_.frames.size() - 1;
        std::vector<std::array<std::vector<Block>, 3>> blocks(pairs);
        parallelFor(0, static_cast<std::int64_t>(pairs), [&](std::int64_t pair) {
            const auto k = static_cast<std::size_t>(pair);
            blocks[k] = blocksOf(bracket_.frames[k], bracket_.frames[k + 1]);
        });
        std::string untold;
        for (std::size_t c = 0; c < 3; ++c) {
            std::vector<std::vector<Block>> of_channel;
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

    /// Codes of one channel of a block as exposures times `factor`; false when one is unusable.
    [[nodiscard]] bool read(
        const EncodedImage& image, int x0, int y0, int c, double factor, Samples& samples) const
    {
        const int least = static_cast<int>(std::ceil(kLeastCode * max_code_));
        const int greatest = static_cast<int>(kGreatestCode * max_code_);
        const auto& table = exposure_[static_cast<std::size_t>(c)];
        std::size_t i = 0;
        for (int y = y0; y < y0 + kBlock; ++y) {
            for (int x = x0; x < x0 + kBlock; ++x) {
                const int code = image.codes(x, y)[c];
                if (code < least || code > greatest) return false;
                samples[i++] = factor * table[static_cast<std::size_t>(code)];
            }
        }
        return true;
    }

    [[nodiscard]] std::array<std::vector<Block>, 3> blocksOf(const BracketFrame& longer,
                                                             const BracketFrame& shorter) const
    {
        std::array<std::vector<Block>, 3> blocks;
        if (shorter.image.max_code != max_code_ || longer.image.max_code != max_code_)
            return blocks;
        const double rho = longer.relative_exposure / shorter.relative_exposure;
        const std::int64_t columns = longer.image.codes.width() / kBlock;
        const std::int64_t all = columns * (longer.image.codes.height() / kBlock);
        const auto pairs = static_cast<std::int64_t>(bracket_.frames.size()) - 1;
        const std::int64_t taken = std::min(all, kBlocks / pairs + 1);
        Samples first{};
        Samples second{};
        for (std::int64_t i = 0; i < taken; ++i) {
            const std::int64_t place = i * all / taken;
            const int x0 = static_cast<int>(place % columns) * kBlock;
            const int y0 = static_cast<int>(place / columns) * kBlock;
            for (int c = 0; c < 3; ++c) {
                if (!read(longer.image, x0, y0, c, 1.0, first)) continue;
                if (!read(shorter.image, x0, y0, c, rho, second)) continue;
                Block block;
                block.rho = rho;
                block.x1 = removePlane(first);
                block.x2 = removePlane(second) / rho;
                block.z1 = response_.encode(c, block.x1);
                block.z2 = response_.encode(c, block.x2);
                block.var1 = meanProduct(first, first);
                block.var2 = meanProduct(second, second);
                block.covariance = meanProduct(first, second);
                block.neighbours = neighbourProduct(first, second);
                blocks[static_cast<std::size_t>(c)].push_back(block);
            }
        }
        return blocks;
    }

    [[nodiscard]] double slopeAt(int c, double code) const
    {
        const double z = std::clamp(code, 0.5, 254.5);
        return response_.decode(c, z + 0.5) - response_.decode(c, z - 0.5);
    }

    [[nodiscard]] double rounding() const { return 255.0 * 255.0 / (12.0 * max_code_ * max_code_); }

    [[nodiscard]] double flatnessOf(const Block& block, int c, const NoiseModel& noise) const
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
    [[nodiscard]] Level levelOf(std::span<Block> blocks, int c, const NoiseModel& noise) const
    {
        for (Block& block : blocks)
            block.flatness = flatnessOf(block, c, noise);
        std::ranges::sort(blocks, {}, &Block::flatness);
        const auto used =
            static_cast<std::size_t>(std::ceil(kFlatShare * static_cast<double>(blocks.size())));
        const std::span<Block> flat = blocks.first(used);
        std::ranges::sort(flat, {}, [](const Block& b) { return b.residual() / b.x1; });
        Level level;
        level.residual = flat[used / 2].residual() / flat[used / 2].x1;
        double x1 = 0.0;
        for (const Block& b : flat) {
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

    [[nodiscard]] std::vector<Level> levelsOf(std::vector<std::vector<Block>>& pairs,
                                              int c,
                                              const NoiseModel& noise) const
    {
        const auto levelIndex = [](const Block& b) {
            return std::floor(kLevelsPerOctave * std::log2(b.x1));
        };
        std::vector<Level> levels;
        for (auto& blocks : pairs) {
            std::ranges::stable_sort(blocks, {}, [](const Block& b) { return b.x1; });
            for (auto first = blocks.begin(); first != blocks.end();) {
                const auto last = std::find_if(first, blocks.end(), [&](const Block& b) {
                    return levelIndex(b) != levelIndex(*first);
                });
                levels.push_back(levelOf({first, last}, c, noise));
                first = last;
            }
        }
        return levels;
    }

    [[nodiscard]] bool estimateChannel(int c,
                                       std::vector<std::vector<Block>>& pairs,
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
    /// (a median of variances of kFreedoms degrees each), with the assumed noise as a weak prior.
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
            const double weight = level.blocks * kFreedoms / (2.0 * kMedianSpread);
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
        for (int sweep = 0; sweep < kSweeps; ++sweep) {
            for (std::size_t i = 0; i < 3; ++i) {
                double rest = right[i];
                for (std::size_t j = 0; j < 3; ++j)
                    if (j != i) rest -= normal[i][j] * x[j];
                x[i] = std::max(0.0, rest / normal[i][i]);
            }
        }
        return x;
    }

    /// Median over all blocks of what neighbours share.
    [[nodiscard]] static double correlation(const std::vector<std::vector<Block>>& pairs)
    {
        std::vector<double> ratios;
        for (const auto& blocks : pairs)
            for (const Block& block : blocks)
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
    std::array<std::vector<double>, 3> exposure_;
};

}  // namespace

NoiseEstimate estimateNoise(const Bracket& bracket, const ResponseCurve& response)
{
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    return Estimator(bracket, response).estimate();
}

}  // namespace insitu
