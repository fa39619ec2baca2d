#include "composite/match/grain.h"

#include "composite/match/grain_blocks.h"
#include "core/parallel.h"
#include "core/quantile.h"
#include "core/random.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu {

namespace {

constexpr double kLevelStep = 256.0 / GrainModel::kLevels;
constexpr std::size_t kMinFlatBlocks = 40;
/// Variance against the law's beyond which a block counts as textured whatever the crowd says.
constexpr double kMaxExcess = 3.0;
/// Levels that no flat block shows get at most this times the largest variance of one that does:
/// the law follows the response, and where the bracket does not show that it may be as good as
/// flat.
constexpr double kMostUnseen = 4.0;
/// Blocks that weigh as much as the sensor's law in the correction of one level.
constexpr double kLawWeight = 20.0;

double levelMiddle(int level)
{
    return (level + 0.5) * kLevelStep - 0.5;
}

/// var(z) = p[0]·g² + p[1]·E·g² + p[2] of one channel, g = dz/dE.
struct SensorLaw {
    std::array<double, 256> slope_squared{};
    std::array<double, 256> exposure{};
    glm::dvec3 p{0.0};

    SensorLaw(const ResponseCurve& response, int channel)
    {
        const auto& table = response.exposure[static_cast<std::size_t>(channel)];
        for (int z = 0; z < 256; ++z) {
            const int a = std::max(0, z - 1);
            const int b = std::min(255, z + 1);
            const double rise =
                table[static_cast<std::size_t>(b)] - table[static_cast<std::size_t>(a)];
            const auto k = static_cast<std::size_t>(z);
            slope_squared[k] = rise > 0.0 ? ((b - a) / rise) * ((b - a) / rise) : 0.0;
            exposure[k] = table[k];
        }
    }
    [[nodiscard]] glm::dvec3 terms(double code) const
    {
        const auto k = static_cast<std::size_t>(std::clamp(std::lround(code), 0l, 255l));
        return {slope_squared[k], exposure[k] * slope_squared[k], 1.0};
    }
    [[nodiscard]] double variance(double code) const { return glm::dot(p, terms(code)); }

    /// Least squares of relative errors with p >= 0: the first set of terms whose squares are no
    /// more than chance above the best one's. Where levels are few, several do, and what is fitted
    /// to bright walls must hold in the dark: photon noise alone is asked first.
    void fit(const std::vector<GrainBlock>& blocks,
             const std::vector<std::uint8_t>& flat,
             int channel)
    {
        constexpr std::array<unsigned, 7> kOrder = {
            0b010, 0b110, 0b011, 0b100, 0b001, 0b101, 0b111};
        // Squares that one more parameter takes by chance: nine times its share.
        const double count =
            std::max<double>(1.0, double(std::count(flat.begin(), flat.end(), std::uint8_t{1})));
        const double chance = 1.0 + 9.0 / count;
        const glm::dvec3 before = p;
        double best = std::numeric_limits<double>::infinity();
        for (const unsigned used : kOrder) {
            glm::dmat3 normal(0.0);
            glm::dvec3 right(0.0);
            const auto relativeTerms = [&](const GrainBlock& block) {
                glm::dvec3 t = terms(block.level[channel]);
                const double expected = std::max(glm::dot(before, t), 1e-6);
                for (int k = 0; k < 3; ++k)
                    t[k] *= (used >> k & 1u) / expected;
                return std::pair(t, block.variance[channel] / expected);
            };
            for (std::size_t i = 0; i < blocks.size(); ++i) {
                if (!flat[i]) continue;
                const auto [t, value] = relativeTerms(blocks[i]);
                normal += glm::outerProduct(t, t);
                right += value * t;
            }
            for (int k = 0; k < 3; ++k)
                if (!(used >> k & 1u)) normal[k][k] = 1.0;
            // Columns of very unequal size: scale to a unit diagonal.
            glm::dvec3 scale;
            for (int k = 0; k < 3; ++k)
                scale[k] = normal[k][k] > 0.0 ? 1.0 / std::sqrt(normal[k][k]) : 1.0;
            for (int i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k)
                    normal[i][k] *= scale[i] * scale[k];
            for (int k = 0; k < 3; ++k)
                normal[k][k] += 1e-9;
            const glm::dvec3 solution = scale * (glm::inverse(normal) * (scale * right));
            if (!(glm::all(glm::greaterThanEqual(solution, glm::dvec3(0.0))))) continue;
            double cost = 0.0;
            for (std::size_t i = 0; i < blocks.size(); ++i) {
                if (!flat[i]) continue;
                const auto [t, value] = relativeTerms(blocks[i]);
                const double error = glm::dot(t, solution) - value;
                cost += error * error;
            }
            if (cost * chance < best) {
                best = cost;
                p = solution;
            }
        }
    }
};

/// The densest half of the densest half of ... sorted values: where they crowd. [BicFru06]
double halfSampleMode(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    std::size_t first = 0;
    std::size_t count = values.size();
    while (count > 2) {
        const std::size_t half = (count + 1) / 2;
        std::size_t best = first;
        for (std::size_t i = first; i + half <= first + count; ++i)
            if (values[i + half - 1] - values[i] < values[best + half - 1] - values[best]) best = i;
        first = best;
        count = half;
    }
    return 0.5 * (values[first] + values[first + count - 1]);
}

/// Photon noise of the range of levels that is quietest against it: where a range holds nothing but
/// texture its blocks are louder, and must not start the search.
double quietestPhotonNoise(const std::vector<GrainBlock>& blocks, const SensorLaw& law, int channel)
{
    constexpr std::size_t kRanges = 16;
    constexpr std::size_t kEnough = 8;
    std::array<std::vector<double>, kRanges> ratios;
    for (const GrainBlock& block : blocks) {
        const double photons = law.terms(block.level[channel])[1];
        const auto k = static_cast<std::size_t>(
            std::clamp(block.level[channel] / (256.0 / kRanges), 0.0, kRanges - 1.0));
        if (photons > 0.0)
            ratios[k].push_back(std::max(block.variance[channel] - kRoundingVariance, 1e-6) /
                                photons);
    }
    std::vector<double> floors;
    for (auto& range : ratios)
        if (range.size() >= kEnough) floors.push_back(quantile(range, 0.1));
    return floors.empty() ? 0.0 : *std::min_element(floors.begin(), floors.end());
}

/// Marks the blocks whose variance is the noise's, and fits the three laws to them.
std::vector<std::uint8_t> separateTexture(const std::vector<GrainBlock>& blocks,
                                          std::array<SensorLaw, 3>& laws)
{
    std::vector<std::uint8_t> flat(blocks.size(), 1);
    for (int c = 0; c < 3; ++c) {
        SensorLaw& law = laws[static_cast<std::size_t>(c)];
        law.p = {0.0, quietestPhotonNoise(blocks, law, c), kRoundingVariance};
    }
    const auto excessOf = [&](const GrainBlock& block) {
        double sum = 0.0;
        for (int c = 0; c < 3; ++c)
            sum +=
                block.variance[c] /
                (3.0 * std::max(laws[static_cast<std::size_t>(c)].variance(block.level[c]), 1e-3));
        return sum;
    };
    for (std::size_t i = 0; i < blocks.size(); ++i)
        flat[i] = excessOf(blocks[i]) <= kMaxExcess;
    for (int round = 0; round < 8; ++round) {
        if (std::count(flat.begin(), flat.end(), std::uint8_t{1}) <
            static_cast<std::ptrdiff_t>(kMinFlatBlocks))
            break;
        for (int c = 0; c < 3; ++c)
            laws[static_cast<std::size_t>(c)].fit(blocks, flat, c);
        std::vector<double> excess(blocks.size());
        std::vector<double> quiet;
        for (std::size_t i = 0; i < blocks.size(); ++i) {
            excess[i] = excessOf(blocks[i]);
            if (excess[i] <= kMaxExcess) quiet.push_back(excess[i]);
        }
        if (quiet.size() < kMinFlatBlocks) break;
        const double mode = halfSampleMode(quiet);
        double below = 0.0;
        double count = 0.0;
        for (const double e : excess)
            if (e < mode) {
                below += (mode - e) * (mode - e);
                count += 1.0;
            }
        const double spread = std::sqrt(below / std::max(count, 1.0));
        // Texture only adds: blocks far above the crowd are textured.
        for (std::size_t i = 0; i < blocks.size(); ++i)
            flat[i] = excess[i] <= mode + 2.5 * spread + 0.02;
    }
    return flat;
}

/// Variance by level: the law's, corrected by the mean of measured over expected among the flat
/// blocks.
std::array<double, GrainModel::kLevels> varianceByLevel(const std::vector<GrainBlock>& blocks,
                                                        const std::vector<std::uint8_t>& flat,
                                                        const SensorLaw& law,
                                                        int channel)
{
    std::array<double, GrainModel::kLevels> sum{};
    std::array<double, GrainModel::kLevels> count{};
    for (std::size_t i = 0; i < blocks.size(); ++i) {
        if (!flat[i]) continue;
        const double level = blocks[i].level[channel];
        const auto k = static_cast<std::size_t>(
            std::clamp(level / kLevelStep, 0.0, GrainModel::kLevels - 1.0));
        sum[k] += blocks[i].variance[channel] / std::max(law.variance(level), 1e-3);
        count[k] += 1.0;
    }
    std::array<double, GrainModel::kLevels> variance{};
    double largest = 0.0;
    for (std::size_t k = 0; k < variance.size(); ++k) {
        variance[k] = law.variance(levelMiddle(static_cast<int>(k))) * (sum[k] + kLawWeight) /
                      (count[k] + kLawWeight);
        if (count[k] > 0.0) largest = std::max(largest, variance[k]);
    }
    for (std::size_t k = 0; k < variance.size(); ++k)
        if (count[k] == 0.0) variance[k] = std::min(variance[k], kMostUnseen * largest);
    return variance;
}

}  // namespace

double GrainModel::sigmaAt(int channel, double code) const
{
    const auto& table = sigma[static_cast<std::size_t>(channel)];
    const double at = std::clamp((code + 0.5) / kLevelStep - 0.5, 0.0, kLevels - 1.0);
    const auto k = static_cast<std::size_t>(std::min(at, kLevels - 2.0));
    const double t = at - static_cast<double>(k);
    return table[k] * (1.0 - t) + table[k + 1] * t;
}

GrainEstimate estimateGrain(const EncodedImage& photo, const ResponseCurve& response)
{
    GrainEstimate estimate;
    const std::vector<GrainBlock> blocks = grainBlocks(photo);
    std::array<SensorLaw, 3> laws{
        SensorLaw(response, 0), SensorLaw(response, 1), SensorLaw(response, 2)};
    std::vector<std::uint8_t> flat;
    if (blocks.size() >= kMinFlatBlocks) flat = separateTexture(blocks, laws);
    const auto flat_count =
        static_cast<std::size_t>(std::count(flat.begin(), flat.end(), std::uint8_t{1}));
    if (!blocks.empty())
        estimate.flat_fraction =
            static_cast<double>(flat_count) / static_cast<double>(blocks.size());
    if (flat_count < kMinFlatBlocks) {
        estimate.findings.push_back(
            {Severity::Info,
             "grain-unknown",
             fmt::format("only {} of the photograph's blocks are flat and well exposed ({} are "
                         "needed): no grain is added to the objects",
                         flat_count,
                         kMinFlatBlocks)});
        return estimate;
    }

    std::vector<GrainBlock> kept;
    for (std::size_t i = 0; i < blocks.size(); ++i)
        if (flat[i]) kept.push_back(blocks[i]);
    // Total deviation, rounding included, normalises the residuals whose correlation is wanted.
    std::array<std::array<double, GrainModel::kLevels>, 3> total{};
    const double rounding = kRoundingVariance * (255.0 / photo.max_code) * (255.0 / photo.max_code);
    for (std::size_t c = 0; c < 3; ++c) {
        const auto variances = varianceByLevel(blocks, flat, laws[c], static_cast<int>(c));
        for (int k = 0; k < GrainModel::kLevels; ++k) {
            const auto i = static_cast<std::size_t>(k);
            const double variance = std::max(variances[i], rounding);
            total[c][i] = std::sqrt(variance);
            estimate.model.sigma[c][i] = std::sqrt(variance - rounding);
        }
    }
    const GrainModel measured{total, {glm::mat3(1.0f)}, 0};
    const GrainCorrelation correlation = grainCorrelation(photo, kept, measured, rounding);
    setKernel(correlation, estimate.model);
    // What the plane took from correlated noise.
    for (std::size_t c = 0; c < 3; ++c)
        for (double& sigma : estimate.model.sigma[c])
            sigma /= std::sqrt(correlation.left_by_plane[static_cast<int>(c)]);
    return estimate;
}

Image<Rgb> grainTexture(
    const GrainModel& model, int x0, int y0, int width, int height, std::uint64_t seed)
{
    const int r = model.radius;
    Image<Rgb> white(width + 2 * r, height + 2 * r);
    parallelFor(0, white.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < white.width(); ++x) {
            // A pixel's number is its place in an unbounded plane.
            const auto column = static_cast<std::uint32_t>(x + x0 - r);
            const auto line = static_cast<std::uint32_t>(y + y0 - r);
            RandomStream random(seed, (static_cast<std::uint64_t>(line) << 32) | column, 0);
            for (int c = 0; c < 3; ++c)
                white(x, y)[c] = static_cast<float>(random.normal());
        }
    });
    Image<Rgb> texture(width, height);
    const int side = 2 * r + 1;
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int dy = 0; dy < side; ++dy)
            for (int dx = 0; dx < side; ++dx) {
                const glm::mat3& tap = model.kernel[static_cast<std::size_t>(dy * side + dx)];
                for (int x = 0; x < width; ++x)
                    texture(x, y) += tap * white(x + dx, y + dy);
            }
    });
    return texture;
}

}  // namespace insitu
