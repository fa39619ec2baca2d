#include "lighting/light_reference.h"

#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

const glm::dvec3 kTruth(50.0, 40.0, 30.0);

/// Of a hemisphere of normals around +Y: measured light from all sides, a clipped lamp straight
/// above, which each place gets by its cosine.
PredictedIrradiance predictedAt(glm::dvec3 normal)
{
    return {glm::dvec3(3.0, 2.5, 2.0) * (1.0 + 0.3 * normal.x),
            glm::dvec3(0.2) * std::max(0.0, normal.y)};
}

LightReference referenceAt(glm::dvec3 normal, glm::dvec3 truth, double times, double log_sigma)
{
    const PredictedIrradiance p = predictedAt(normal);
    return {{}, normal, times * (p.measured + truth * p.clipped), log_sigma};
}

std::vector<PredictedIrradiance> predictedFor(const std::vector<ReferenceGroup>& groups)
{
    std::vector<PredictedIrradiance> all;
    for (const ReferenceGroup& group : groups)
        for (const LightReference& place : group.places)
            all.push_back(predictedAt(place.normal));
    return all;
}

/// A grey ball seen from +Z.
ReferenceGroup ball(double times, bool scale_free)
{
    ReferenceGroup group{.name = "the grey ball", .places = {}, .scale_free = scale_free};
    for (int i = 0; i < 100; ++i) {
        const double x = -0.9 + 0.2 * (i % 10);
        const double y = -0.9 + 0.2 * (i / 10);
        if (x * x + y * y > 0.9) continue;
        const glm::dvec3 normal(x, y, std::sqrt(1.0 - x * x - y * y));
        group.places.push_back(referenceAt(normal, kTruth, times, 0.02));
    }
    return group;
}

ReferenceGroup card(double times = 1.0)
{
    return {.name = "the grey card",
            .places = {referenceAt({0, 1, 0}, kTruth, times, 0.03)},
            .common_log_sigma = 0.0};
}

TEST(SolveClipped, ACardTellsTheStrengthAndItsDeviation)
{
    const std::vector<ReferenceGroup> groups = {card()};
    const auto solution = solveClipped(groups, predictedFor(groups));
    ASSERT_TRUE(solution);
    for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(solution->factor[c], kTruth[c], tolerance::kIterative * kTruth[c]);
        // d log E = (s G / E) d log s.
        const PredictedIrradiance p = predictedAt({0, 1, 0});
        const double missing = kTruth[c] * p.clipped[c];
        EXPECT_NEAR(solution->log_sigma[c],
                    0.03 * (p.measured[c] + missing) / missing,
                    tolerance::kIterative);
        EXPECT_FALSE(solution->open[c]);
    }
    EXPECT_EQ(solution->excess, 0.0);
}

TEST(SolveClipped, ABallOfUnknownReflectanceTellsByItsShading)
{
    const std::vector<ReferenceGroup> groups = {ball(0.37, /*scale_free=*/true)};
    const auto solution = solveClipped(groups, predictedFor(groups));
    ASSERT_TRUE(solution);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(solution->factor[c], kTruth[c], tolerance::kIterative * kTruth[c]);
    // The same ball, wrongly taken as white.
    const std::vector<ReferenceGroup> wrong = {ball(0.37, /*scale_free=*/false)};
    const auto misled = solveClipped(wrong, predictedFor(wrong));
    EXPECT_TRUE(!misled || misled->residual > 3.0);
}

TEST(SolveClipped, ReadingsInLuxCompareWithEachOther)
{
    const glm::dvec3 color(2.0, 1.0, 1.0);
    ReferenceGroup meter{.name = "the light meter", .places = {}, .scale_free = true};
    meter.luminance_only = true;
    for (const glm::dvec3& normal : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0)}) {
        const LightReference full = referenceAt(normal, 25.0 * color, 730.0, 0.03);
        // 0.2126, 0.7152, 0.0722: luminance of Rec. 709.
        const double lux =
            0.2126 * full.irradiance.r + 0.7152 * full.irradiance.g + 0.0722 * full.irradiance.b;
        meter.places.push_back({{}, normal, glm::dvec3(lux), 0.03});
    }
    const std::vector<ReferenceGroup> groups = {meter};
    const auto solution = solveClipped(groups, predictedFor(groups), {color, std::nullopt});
    ASSERT_TRUE(solution);
    // Float weights of luminance.
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(solution->factor[c], 25.0 * color[c], 1e-3 * 25.0);
    // One reading in a unit of its own says nothing.
    meter.places.resize(1);
    const std::vector<ReferenceGroup> one = {meter};
    EXPECT_FALSE(solveClipped(one, predictedFor(one)));
}

TEST(SolveClipped, APlaceInTheLampsShadeSaysNothing)
{
    const std::vector<ReferenceGroup> groups = {
        {.name = "the card", .places = {referenceAt({1, 0, 0}, kTruth, 1.0, 0.03)}}};
    EXPECT_FALSE(solveClipped(groups, predictedFor(groups)));
}

TEST(SolveClipped, ABlackChannelStaysOpen)
{
    std::vector<ReferenceGroup> groups = {card()};
    groups[0].places[0].irradiance.b = 0.0;
    const auto solution = solveClipped(groups, predictedFor(groups));
    ASSERT_TRUE(solution);
    EXPECT_EQ(solution->open, glm::bvec3(false, false, true));
    EXPECT_EQ(solution->factor.b, 1.0);
    EXPECT_NEAR(solution->factor.r, kTruth.r, tolerance::kIterative * kTruth.r);
    EXPECT_TRUE(hasFinding(referenceFindings(groups, predictedFor(groups), *solution),
                           "light-clipped-unsolved"));
}

TEST(SolveClipped, WhatTheSurfacesSayTakesPartByItsDeviation)
{
    const std::vector<ReferenceGroup> groups = {card()};
    const auto alone = solveClipped(groups, predictedFor(groups));
    const ClippedPrior prior{0.5 * kTruth, glm::dvec3(0.3)};
    const auto both = solveClipped(groups, predictedFor(groups), prior);
    ASSERT_TRUE(alone && both);
    for (int c = 0; c < 3; ++c) {
        // Two independent witnesses in logarithms, weighted by their information.
        const double a = 1.0 / (alone->log_sigma[c] * alone->log_sigma[c]);
        const double b = 1.0 / (0.3 * 0.3);
        const double expected = kTruth[c] * std::exp(std::log(0.5) * b / (a + b));
        // Linearised at the truth; the shift is 1 to 2 %.
        EXPECT_NEAR(both->factor[c] / expected, 1.0, 0.002);
        EXPECT_LT(both->log_sigma[c], alone->log_sigma[c]);
    }
}

// 1000 cards with errors of 3 % of their own and 5 % in common with a second one that faces
// another way: the stated deviation covers the truth as it should.
TEST(SolveClipped, StatedDeviationsCoverTheTruth)
{
    int within_one = 0;
    int within_two = 0;
    constexpr int kDraws = 1000;
    for (int i = 0; i < kDraws; ++i) {
        RandomStream random(11, static_cast<std::uint64_t>(i), 0);
        ReferenceGroup two{.name = "cards", .places = {}, .common_log_sigma = 0.05};
        const double common = std::exp(0.05 * random.normal());
        for (const glm::dvec3& normal :
             {glm::dvec3(0, 1, 0), glm::dvec3(std::sqrt(0.5), std::sqrt(0.5), 0)})
            two.places.push_back(
                referenceAt(normal, kTruth, common * std::exp(0.03 * random.normal()), 0.03));
        const std::vector<ReferenceGroup> groups = {two};
        const auto solution = solveClipped(groups, predictedFor(groups));
        ASSERT_TRUE(solution);
        const double off =
            std::abs(std::log(solution->factor.g / kTruth.g)) / solution->log_sigma.g;
        within_one += off < 1.0;
        within_two += off < 1.96;
    }
    // Four standard errors of a share of 1000.
    EXPECT_NEAR(within_one / double(kDraws), 0.683, 0.059);
    EXPECT_NEAR(within_two / double(kDraws), 0.95, 0.028);
}

TEST(ReferenceFindings, TooLittleLightAndContradictionsAreTold)
{
    const std::vector<ReferenceGroup> dim = {card(0.2)};
    const auto less = solveClipped(dim, predictedFor(dim));
    if (less) {
        EXPECT_GT(less->excess, 0.0);
        EXPECT_TRUE(hasFinding(referenceFindings(dim, predictedFor(dim), *less),
                               "light-reference-disagrees"));
    }
    // A second card that says twice as much.
    std::vector<ReferenceGroup> two = {card(), card(2.0)};
    const auto solution = solveClipped(two, predictedFor(two));
    ASSERT_TRUE(solution);
    EXPECT_TRUE(hasFinding(referenceFindings(two, predictedFor(two), *solution),
                           "light-reference-disagrees"));
}

/// White all around, and a lamp of 3 degrees straight above that is clipped at `bound`.
EnvironmentMap skyWithLamp(double bound)
{
    constexpr int kHeight = 128;
    EnvironmentMap map{Image<Rgb>(2 * kHeight, kHeight, Rgb(1.0f))};
    map.clipped = Image<Rgb>(2 * kHeight, kHeight, Rgb(0.0f));
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 2 * kHeight; ++x)
            map.pixels(x, y) = map.clipped(x, y) = Rgb(static_cast<float>(bound));
    return map;
}

TEST(ApplyReferences, SolvesAnEnvironmentAtInfinity)
{
    EnvironmentMap map = skyWithLamp(5.0);
    const glm::dvec3 full = irradiance(skyWithLamp(500.0), {0, 1, 0});
    const std::vector<ReferenceGroup> groups = {
        {.name = "the card", .places = {{{}, {0, 1, 0}, full, 0.02}}}};
    const Findings findings = applyReferences(groups, map);
    EXPECT_TRUE(hasFinding(findings, "light-clipped-solved"));
    const glm::dvec3 solved = irradiance(map, {0, 1, 0});
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(solved[c] / full[c], 1.0, tolerance::kFloat);
    EXPECT_NEAR(map.pixels(0, 0).g, 500.0f, 0.1f);
    EXPECT_EQ(map.pixels(0, 100), Rgb(1.0f));
}

TEST(ApplyReferences, WithoutAReferenceTheBoundIsTold)
{
    EnvironmentMap map = skyWithLamp(5.0);
    const EnvironmentMap before = map;
    EXPECT_TRUE(hasFinding(applyReferences({}, map), "light-clipped-unsolved"));
    EXPECT_EQ(map.pixels, before.pixels);
    // A card that faces away.
    const std::vector<ReferenceGroup> away = {
        {.name = "the card", .places = {{{}, {0, -1, 0}, glm::dvec3(pi), 0.02}}}};
    EXPECT_TRUE(hasFinding(applyReferences(away, map), "light-clipped-unsolved"));
    EXPECT_EQ(map.pixels, before.pixels);
}

TEST(ApplyReferences, WhereNothingIsClippedReferencesOnlyCheck)
{
    EnvironmentMap map{Image<Rgb>(64, 32, Rgb(1.0f))};
    const auto say = [&](double irradiance) {
        const std::vector<ReferenceGroup> groups = {
            {.name = "the card", .places = {{{}, {0, 1, 0}, glm::dvec3(irradiance), 0.02}}}};
        return applyReferences(groups, map);
    };
    EXPECT_TRUE(hasFinding(say(pi), "light-reference-unneeded"));
    EXPECT_TRUE(hasFinding(say(0.5 * pi), "light-reference-disagrees"));
}

}  // namespace
}  // namespace insitu
