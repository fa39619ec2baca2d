#include "core/color.h"

#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

TEST(Color, LuminanceWeightsAreThoseOfRec709)
{
    EXPECT_NEAR(kLuminanceWeights[0] + kLuminanceWeights[1] + kLuminanceWeights[2], 1.0, 1e-7);
    EXPECT_FLOAT_EQ(luminance(Rgb(1.0f, 0.0f, 0.0f)), 0.2126f);
    EXPECT_FLOAT_EQ(luminance(Rgb(0.0f, 1.0f, 0.0f)), 0.7152f);
    EXPECT_FLOAT_EQ(luminance(Rgb(0.0f, 0.0f, 1.0f)), 0.0722f);
}

// Absolute values, since a round trip passes for any curve: IEC 61966-2-1.
TEST(Color, SrgbHasItsPublishedValues)
{
    EXPECT_EQ(linearFromSrgb(0.0), 0.0);
    EXPECT_NEAR(linearFromSrgb(1.0), 1.0, tolerance::kDouble);
    EXPECT_NEAR(linearFromSrgb(0.04), 0.04 / 12.92, tolerance::kDouble);
    EXPECT_NEAR(linearFromSrgb(0.5), 0.214041140482232, tolerance::kDouble);
    EXPECT_NEAR(linearFromSrgb(128.0 / 255.0), 0.215860500113899, tolerance::kDouble);
    EXPECT_NEAR(srgbFromLinear(0.18), 0.461356129500442, tolerance::kDouble);
    EXPECT_NEAR(srgbFromLinear(0.001), 0.01292, tolerance::kDouble);
}

TEST(Color, SrgbIsMonotoneAndInverse)
{
    double previous = -1.0;
    for (int i = 0; i <= 4096; ++i) {
        const double encoded = i / 4096.0;
        const double linear = linearFromSrgb(encoded);
        EXPECT_GT(linear, previous);
        previous = linear;
        // The standard's two branches meet only to its printed digits: 0.04045, 0.0031308.
        EXPECT_NEAR(srgbFromLinear(linear), encoded, 1e-7);
    }
}

}  // namespace
}  // namespace insitu
