#include "lighting/light_fit.h"

#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace insitu {
namespace {

/// Two faces with reflectance 0.6 and 0.3 under light whose unseen part is `truth` times the guess;
/// `pattern` is the relative scatter of the reflectance.
std::vector<LitCell> litCells(const std::array<glm::dvec3, kLightBands>& truth, double pattern)
{
    std::vector<LitCell> cells;
    for (std::size_t i = 0; i < 600; ++i) {
        RandomStream random(5, i, 0);
        LitCell cell;
        cell.face = i % 2;
        cell.area = 0.02;
        const double along = random.uniformDouble();
        const double aside = random.uniformDouble();
        cell.known = glm::dvec3(5.0 - 2.0 * along);
        cell.guessed[0] = glm::dvec3(4.0 * along * along);
        cell.guessed[1] = glm::dvec3(0.8 * aside);
        cell.guessed[2] = glm::dvec3(1.5 * (1.0 - along) * aside);
        glm::dvec3 irradiance = cell.known;
        for (std::size_t b = 0; b < kLightBands; ++b)
            irradiance += truth[b] * cell.guessed[b];
        const double rho = (cell.face == 0 ? 0.6 : 0.3) * (1.0 + pattern * random.normal());
        cell.radiance = rho * irradiance / std::numbers::pi;
        cells.push_back(cell);
    }
    return cells;
}

TEST(FitLightBands, ExactLightIsLeftAlone)
{
    std::array<glm::dvec3, kLightBands> ones;
    ones.fill(glm::dvec3(1.0));
    for (const glm::dvec3& s : fitLightBands(litCells(ones, 0.0)).factors)
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(s[c], 1.0, tolerance::kIterative);
}

TEST(FitLightBands, FindsTheSkyThatTheProbeDidNotSee)
{
    const std::array<glm::dvec3, kLightBands> truth = {
        glm::dvec3(2.0, 2.5, 4.0), glm::dvec3(0.5), glm::dvec3(1.2), glm::dvec3(1.0)};
    const auto factors = fitLightBands(litCells(truth, 0.1)).factors;
    // 600 cells with 10 % of pattern: the strong band within 10 %.
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(factors[0][c], truth[0][c], 0.1 * truth[0][c]);
    // The weak band is held by the prior, but leans the right way.
    for (int c = 0; c < 3; ++c) {
        EXPECT_LT(factors[1][c], 0.95);
        EXPECT_GT(factors[1][c], 0.3);
    }
}

TEST(FitLightBands, ADarkRugDoesNotBendTheLight)
{
    const std::array<glm::dvec3, kLightBands> truth = {
        glm::dvec3(2.0), glm::dvec3(1.0), glm::dvec3(1.0), glm::dvec3(1.0)};
    std::vector<LitCell> cells = litCells(truth, 0.05);
    for (std::size_t i = 0; i < cells.size(); ++i)
        if (i % 2 == 0 && cells[i].guessed[0].x > 2.0) cells[i].radiance *= 0.3;
    const auto factors = fitLightBands(cells).factors;
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(factors[0][c], 2.0, 0.4);
}

TEST(FitLightBands, NothingToLearnFromKeepsTheGuess)
{
    EXPECT_EQ(fitLightBands({}).factors[0], glm::dvec3(1.0));
    std::array<glm::dvec3, kLightBands> ones;
    ones.fill(glm::dvec3(1.0));
    std::vector<LitCell> black = litCells(ones, 0.0);
    for (LitCell& cell : black)
        cell.radiance = glm::dvec3(0.0);
    EXPECT_EQ(fitLightBands(black).factors[0], glm::dvec3(1.0));
}

// A sun that is clipped a thousandfold: its patch on the floor, a tenth of the cells, says so.
TEST(FitLightBands, APatchOfSunTellsHowFarTheSunIsClipped)
{
    std::array<glm::dvec3, kLightBands> ones;
    ones.fill(glm::dvec3(1.0));
    std::vector<LitCell> cells = litCells(ones, 0.1);
    const glm::dvec3 truth(1500.0, 800.0, 300.0);
    for (std::size_t i = 0; i < cells.size(); ++i) {
        LitCell& cell = cells[i];
        if (i % 10 != 0) continue;
        cell.guessed[kClippedBand] = glm::dvec3(0.01);
        glm::dvec3 before = cell.known;
        for (const glm::dvec3& band : cell.guessed)
            before += band;
        cell.radiance *= (before - 0.01 + truth * 0.01) / before;
    }
    const LightFit fit = fitLightBands(cells);
    for (int c = 0; c < 3; ++c) {
        // 60 cells with 10 % of pattern, one of two faces: 2 % expected, five times that allowed.
        EXPECT_NEAR(fit.factors[kClippedBand][c] / truth[c], 1.0, 0.1);
        EXPECT_LT(fit.log_sigma[kClippedBand][c], 0.3);
    }
}

TEST(FitLightBands, AClippedLightThatFallsNowhereStaysUnknown)
{
    std::array<glm::dvec3, kLightBands> ones;
    ones.fill(glm::dvec3(1.0));
    const LightFit fit = fitLightBands(litCells(ones, 0.05));
    EXPECT_EQ(fit.factors[kClippedBand], glm::dvec3(1.0));
    EXPECT_GT(fit.log_sigma[kClippedBand].g, 2.0);
}

}  // namespace
}  // namespace insitu
