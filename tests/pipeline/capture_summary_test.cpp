#include "pipeline/capture_summary.h"

#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

/// A linear camera of photon noise alone; exposures 1, 1/4 and 1/16.
CapturedRadiance photonLimited()
{
    CapturedRadiance captured;
    for (auto& table : captured.response.exposure)
        for (std::size_t z = 0; z < table.size(); ++z)
            table[z] = static_cast<double>(z) / 255.0;
    for (const double exposure : {1.0, 0.25, 0.0625})
        captured.frames.push_back({"frame", exposure, exposure});
    for (ChannelNoise& noise : captured.merged.noise.channels) {
        noise.gain = 1e-4;
        noise.code_variance = 1e-12;  // no rounding
    }
    captured.clip_fraction = 0.98;
    captured.black_fraction = 0.02;
    return captured;
}

double weightAt(const WeightCurve& curve, std::size_t frame, double radiance)
{
    for (std::size_t i = 0; i < curve.radiance.size(); ++i)
        if (std::abs(curve.radiance[i] / radiance - 1.0) < 1e-9) return curve.weight[frame][i];
    ADD_FAILURE() << "no level of " << radiance;
    return -1.0;
}

// Photon noise: the variance of L from one frame is gain L / t, so weights go with t.
TEST(MergeWeights, OfPhotonNoiseGoWithTheExposure)
{
    const WeightCurve curve = mergeWeights(photonLimited(), 1);
    EXPECT_NEAR(weightAt(curve, 0, 0.5), 16.0 / 21.0, 1e-6);  // the rest of rounding
    EXPECT_NEAR(weightAt(curve, 1, 0.5), 4.0 / 21.0, 1e-6);
    EXPECT_NEAR(weightAt(curve, 2, 0.5), 1.0 / 21.0, 1e-6);
    // Clipped in the longest.
    EXPECT_EQ(weightAt(curve, 0, 2.0), 0.0);
    EXPECT_NEAR(weightAt(curve, 1, 2.0), 4.0 / 5.0, 1e-6);
    EXPECT_EQ(weightAt(curve, 2, 8.0), 1.0);
    // Black but in the longest.
    EXPECT_EQ(weightAt(curve, 0, 0.0625), 1.0);
    EXPECT_EQ(weightAt(curve, 1, 0.0625), 0.0);
    EXPECT_TRUE(mergeWeights({}, 0).radiance.empty());
}

TEST(MergedDeviations, AreThoseOfTheVarianceByLuminance)
{
    MergeResult merged;
    merged.radiance.pixels = Image<Rgb>(20, 20, Rgb(1.1f));
    merged.variance = Image<Rgb>(20, 20, Rgb(0.0121f));
    merged.validity = Image<std::uint8_t>(20, 20);
    for (int i = 0; i < 20; ++i)
        merged.validity(i, 0) = kMergeClipped;
    merged.radiance.pixels(3, 3) = Rgb(0.0f);
    merged.radiance.pixels(4, 4) = Rgb(300.0f);  // too few to tell
    const std::vector<DeviationStep> steps = mergedDeviations(merged);
    ASSERT_EQ(steps.size(), 1u);
    EXPECT_EQ(steps[0].pixels, 378u);
    // Equal channels of independent noise: 0.1 times the root of the sum of squared weights.
    const double expected = 0.1 * std::sqrt(0.2126 * 0.2126 + 0.7152 * 0.7152 + 0.0722 * 0.0722);
    EXPECT_NEAR(steps[0].median, expected, tolerance::kFloat);
    EXPECT_NEAR(steps[0].low, expected, tolerance::kFloat);
    EXPECT_NEAR(std::log2(steps[0].radiance / 1.1), 0.0, 0.25);
}

}  // namespace
}  // namespace insitu
