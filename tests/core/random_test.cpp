#include "core/random.h"

#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>

namespace insitu {
namespace {

constexpr int kDraws = 100000;

TEST(RandomStream, IsAFunctionOfItsThreeNumbers)
{
    const auto first = [](std::uint64_t seed, std::uint64_t pixel, std::uint64_t sample) {
        RandomStream stream(seed, pixel, sample);
        return stream.uniformDouble();
    };
    EXPECT_EQ(first(1, 2, 3), first(1, 2, 3));
    std::set<double> seen;
    for (std::uint64_t i = 0; i < 30; ++i)
        for (std::uint64_t j = 0; j < 30; ++j)
            for (std::uint64_t k = 0; k < 30; ++k)
                seen.insert(first(i, j, k));
    EXPECT_EQ(seen.size(), 27000u);
}

TEST(RandomStream, StaysBelowOne)
{
    RandomStream stream(1, 0, 0);
    for (int i = 0; i < kDraws; ++i) {
        const float value = stream.uniform();
        ASSERT_GE(value, 0.0f);
        ASSERT_LT(value, 1.0f);
        ASSERT_LT(stream.below(7), 7u);
    }
}

// Mean 1/2 and variance 1/12; standard errors sqrt(1/12n) and sqrt(1/180n).
TEST(RandomStream, MeanAndVarianceAcrossPixelsAndSamples)
{
    double sum = 0.0;
    double squares = 0.0;
    for (int i = 0; i < kDraws; ++i) {
        RandomStream stream(
            5, static_cast<std::uint64_t>(i / 16), static_cast<std::uint64_t>(i % 16));
        const double value = stream.uniform() - 0.5;
        sum += value;
        squares += value * value;
    }
    EXPECT_LT(std::abs(sum / kDraws), tolerance::kStandardErrors * std::sqrt(1.0 / 12.0 / kDraws));
    EXPECT_LT(std::abs(squares / kDraws - 1.0 / 12.0),
              tolerance::kStandardErrors * std::sqrt(1.0 / 180.0 / kDraws));
}

// Chi-square of pairs over 16 x 16 bins, 255 degrees of freedom: below 310.5 with p = 0.99.
TEST(RandomStream, PairsFillTheSquareEvenly)
{
    constexpr int kSide = 16;
    constexpr double kQuantile99 = 310.457;
    for (const bool across_samples : {false, true}) {
        std::array<int, kSide * kSide> counts{};
        RandomStream one(17, 3, 0);
        for (int i = 0; i < kDraws; ++i) {
            RandomStream fresh(17, 3, static_cast<std::uint64_t>(i));
            const glm::vec2 p = across_samples ? fresh.uniform2() : one.uniform2();
            ++counts[static_cast<std::size_t>(static_cast<int>(p.x * kSide) * kSide +
                                              static_cast<int>(p.y * kSide))];
        }
        constexpr double kExpected = static_cast<double>(kDraws) / (kSide * kSide);
        double chi_square = 0.0;
        for (const int count : counts)
            chi_square += (count - kExpected) * (count - kExpected) / kExpected;
        EXPECT_LT(chi_square, kQuantile99) << across_samples;
    }
}

TEST(RandomStream, NormalHasUnitVariance)
{
    RandomStream stream(2, 0, 0);
    double sum = 0.0;
    double squares = 0.0;
    int beyond_two = 0;
    for (int i = 0; i < kDraws; ++i) {
        const double value = stream.normal();
        sum += value;
        squares += value * value;
        beyond_two += std::abs(value) > 2.0 ? 1 : 0;
    }
    EXPECT_LT(std::abs(sum / kDraws), tolerance::kStandardErrors / std::sqrt(kDraws));
    EXPECT_LT(std::abs(squares / kDraws - 1.0),
              tolerance::kStandardErrors * std::sqrt(2.0 / kDraws));
    constexpr double kTail = 0.0455002638963584;  // erfc(2/sqrt 2)
    EXPECT_LT(std::abs(static_cast<double>(beyond_two) / kDraws - kTail),
              tolerance::kStandardErrors * std::sqrt(kTail * (1.0 - kTail) / kDraws));
}

}  // namespace
}  // namespace insitu
