#include "lighting/alias_table.h"

#include "core/check.h"
#include "core/random.h"
#include "tests/support/chi_square.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace insitu {
namespace {

/// Share of each index over u on a regular grid: exact up to the grid's spacing.
std::vector<double> sharesOnGrid(const AliasTable& table, int points)
{
    std::vector<double> share(table.size(), 0.0);
    for (int i = 0; i < points; ++i)
        share[table.sample((i + 0.5) / points).index] += 1.0 / points;
    return share;
}

TEST(AliasTable, DrawsInProportionToTheWeights)
{
    const std::vector<double> weights = {1.0, 0.0, 2.5, 1e-3, 7.0, 0.0, 0.25};
    const AliasTable table(weights);
    constexpr int kPoints = 1 << 20;
    const std::vector<double> share = sharesOnGrid(table, kPoints);
    EXPECT_NEAR(table.totalWeight(), 10.751, 1e-12);
    for (std::size_t i = 0; i < weights.size(); ++i) {
        EXPECT_NEAR(table.probability(i), weights[i] / 10.751, tolerance::kDouble) << i;
        // Each of the n slots has one boundary, which the grid may miss by one point.
        EXPECT_NEAR(share[i], table.probability(i), 7.0 / kPoints) << i;
    }
}

TEST(AliasTable, NeverDrawsWhatWeighsNothing)
{
    std::vector<double> weights(1000, 0.0);
    for (std::size_t i = 0; i < weights.size(); i += 7)
        weights[i] = 1.0 / (1.0 + static_cast<double>(i));
    const AliasTable table(weights);
    const std::vector<double> share = sharesOnGrid(table, 1 << 18);
    for (std::size_t i = 0; i < weights.size(); ++i)
        if (weights[i] == 0.0) {
            EXPECT_EQ(share[i], 0.0) << i;
        }
}

TEST(AliasTable, OneItemTakesAll)
{
    const std::vector<double> weights = {0.3};
    const AliasTable table(weights);
    for (const double u : {0.0, 0.5, std::nextafter(1.0, 0.0), 1.0}) {
        EXPECT_EQ(table.sample(u).index, 0u);
        EXPECT_LT(table.sample(u).remapped, 1.0);
    }
}

// What is left of u is uniform within every index: its mean is 1/2 and its mean square 1/3.
TEST(AliasTable, TheRestOfUIsUniformAgain)
{
    const std::vector<double> weights = {3.0, 1.0, 0.5, 8.0};
    const AliasTable table(weights);
    std::vector<double> count(4, 0.0), sum(4, 0.0), squares(4, 0.0);
    constexpr int kPoints = 1 << 20;
    for (int i = 0; i < kPoints; ++i) {
        const AliasTable::Draw draw = table.sample((i + 0.5) / kPoints);
        ASSERT_GE(draw.remapped, 0.0);
        ASSERT_LT(draw.remapped, 1.0);
        count[draw.index] += 1.0;
        sum[draw.index] += draw.remapped;
        squares[draw.index] += draw.remapped * draw.remapped;
    }
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(sum[i] / count[i], 0.5, tolerance::kQuadrature) << i;
        EXPECT_NEAR(squares[i] / count[i], 1.0 / 3.0, tolerance::kQuadrature) << i;
    }
}

TEST(AliasTable, RandomDrawsPassChiSquare)
{
    RandomStream random(11, 0, 0);
    std::vector<double> weights(500);
    for (double& weight : weights)
        weight = std::exp(3.0 * random.normal());
    const AliasTable table(weights);
    constexpr int kDraws = 200000;
    std::vector<double> observed(500, 0.0), expected(500, 0.0);
    for (int i = 0; i < kDraws; ++i)
        observed[table.sample(random.uniformDouble()).index] += 1.0;
    for (std::size_t i = 0; i < 500; ++i)
        expected[i] = kDraws * table.probability(i);
    EXPECT_GT(chi_square::compare(observed, expected).p, chi_square::sidakLevel(1));
}

TEST(AliasTable, RefusesWeightsItCannotUse)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double infinity = std::numeric_limits<double>::infinity();
    for (const std::vector<double>& weights : {std::vector<double>{},
                                               std::vector<double>{0.0, 0.0},
                                               std::vector<double>{1.0, -1.0},
                                               std::vector<double>{1.0, nan},
                                               std::vector<double>{1.0, infinity}})
        EXPECT_THROW(AliasTable{weights}, LogicError);
}

// The test's own tool: quantiles from tables of the χ² distribution.
TEST(ChiSquare, UpperTailMatchesTables)
{
    EXPECT_NEAR(chi_square::upperTail(3.841458821, 1), 0.05, 1e-9);
    EXPECT_NEAR(chi_square::upperTail(18.30703805, 10), 0.05, 1e-9);
    EXPECT_NEAR(chi_square::upperTail(2.558212160, 10), 0.99, 1e-9);
    EXPECT_NEAR(chi_square::upperTail(135.8067232, 100), 0.01, 1e-9);
}

}  // namespace
}  // namespace insitu
