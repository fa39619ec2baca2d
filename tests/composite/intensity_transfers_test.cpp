#include "composite/intensity_transfers.h"

#include "core/color.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <numeric>

namespace insitu {
namespace {

/// Fifty sources that together give the receiver nine tenths of its light, the brightest first.
std::vector<double> fiftySources(double radiance)
{
    std::vector<double> transfers(50);
    for (std::size_t j = 0; j < transfers.size(); ++j)
        transfers[j] = RandomStream(3, j, 0).uniformDouble();
    std::ranges::sort(transfers, std::greater{});
    const double sum = std::accumulate(transfers.begin(), transfers.end(), 0.0);
    for (double& transfer : transfers)
        transfer *= 0.9 * radiance / sum;
    return transfers;
}

std::vector<std::uint8_t> everySecond()
{
    std::vector<std::uint8_t> set(50);
    for (std::size_t j = 0; j < set.size(); ++j)
        set[j] = static_cast<std::uint8_t>(j % 2);
    return set;
}

struct Left {
    double by_steps = 0.0;
    double by_radiance = 0.0;
};
/// Intensity with these sources occluded, both ways.
Left leftOf(double radiance,
            const std::vector<std::uint8_t>& occluded,
            const std::function<double(double)>& encode)
{
    const std::vector<double> transfers = fiftySources(radiance);
    const std::vector<double> steps =
        intensityTransfers(radiance, transfers, everySecond(), encode);
    Left left{encode(radiance), radiance};
    for (std::size_t j = 0; j < occluded.size(); ++j)
        if (occluded[j] != 0) {
            left.by_steps -= steps[j];
            left.by_radiance -= transfers[j];
        }
    left.by_radiance = encode(left.by_radiance);
    return left;
}

double srgb(double radiance)
{
    return srgbFromLinear(std::min(radiance, 1.0));
}

TEST(IntensityTransfers, AreExactForTheSetsThatTheyAssume)
{
    std::vector<std::uint8_t> set = everySecond();
    for (const bool other : {false, true}) {
        for (std::uint8_t& member : set)
            member = static_cast<std::uint8_t>(other ? 1 - member : member);
        const Left left = leftOf(0.6, set, srgb);
        EXPECT_NEAR(left.by_steps, left.by_radiance, tolerance::kDouble);
    }
    const Left none = leftOf(0.6, std::vector<std::uint8_t>(50, 0), srgb);
    EXPECT_EQ(none.by_steps, none.by_radiance);
}

TEST(IntensityTransfers, AreExactForAnySourcesWhereIntensityIsLinear)
{
    for (std::uint64_t trial = 0; trial < 20; ++trial) {
        std::vector<std::uint8_t> occluded(50);
        for (std::size_t j = 0; j < occluded.size(); ++j)
            occluded[j] = RandomStream(4, j, trial).uniform() < 0.4f ? 1 : 0;
        const Left left = leftOf(0.6, occluded, [](double radiance) { return 2.0 * radiance; });
        EXPECT_NEAR(left.by_steps, left.by_radiance, tolerance::kDouble * 10.0);
    }
}

// Under a curved response the steps of the dimmer half are too large: with everything occluded too
// much goes.
TEST(IntensityTransfers, ErrInACurvedResponseWithinBounds)
{
    const Left all = leftOf(0.6, std::vector<std::uint8_t>(50, 1), srgb);
    EXPECT_LT(std::abs(all.by_steps - all.by_radiance), 0.25);
    EXPECT_GT(std::abs(all.by_steps - all.by_radiance), 0.01);
    double worst = 0.0;
    for (std::uint64_t trial = 0; trial < 200; ++trial) {
        std::vector<std::uint8_t> occluded(50);
        for (std::size_t j = 0; j < occluded.size(); ++j)
            occluded[j] = RandomStream(6, j, trial).uniform() < 0.4f ? 1 : 0;
        const Left left = leftOf(0.6, occluded, srgb);
        worst = std::max(worst, std::abs(left.by_steps - left.by_radiance));
    }
    EXPECT_LT(worst, 0.05) << "at the 30 to 50 % that shadows have";
}

TEST(IntensityTransfers, BlackReceiversHaveNone)
{
    const std::vector<double> nothing(3, 0.0);
    const std::vector<std::uint8_t> sets = {0, 1, 0};
    for (const double step : intensityTransfers(0.0, nothing, sets, srgb))
        EXPECT_EQ(step, 0.0);
    EXPECT_TRUE(intensityTransfers(1.0, {}, {}, srgb).empty());
}

}  // namespace
}  // namespace insitu
