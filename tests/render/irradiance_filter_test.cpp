#include "render/irradiance_filter.h"

#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

constexpr int kSize = 96;
constexpr float kNoise = 0.1f;

struct Noisy {
    Image<Rgb> values{kSize, kSize};
    Image<float> variance{kSize, kSize, kNoise* kNoise};
    Image<std::int32_t> surface{kSize, kSize, 0};
};

/// Level 1 left of the middle and `right` on it, with normal noise.
Noisy halves(float right)
{
    Noisy noisy;
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
            RandomStream random(3, static_cast<std::uint64_t>(y * kSize + x), 0);
            noisy.values(x, y) =
                Rgb((x < kSize / 2 ? 1.0f : right) + kNoise * static_cast<float>(random.normal()));
        }
    return noisy;
}

double rms(const Image<Rgb>& values, int left, int end, float truth)
{
    double sum = 0.0;
    for (int y = 0; y < kSize; ++y)
        for (int x = left; x < end; ++x)
            sum += std::pow(values(x, y).g - truth, 2);
    return std::sqrt(sum / (kSize * (end - left)));
}

TEST(FilterIrradiance, NoiseFallsTenfoldOnAnEvenSurface)
{
    Noisy noisy = halves(1.0f);
    filterIrradiance(noisy.values, noisy.variance, noisy.surface, {});
    EXPECT_LT(rms(noisy.values, 0, kSize, 1.0f), 0.1f * kNoise);
}

TEST(FilterIrradiance, AShadowsEdgeTenSigmasDeepStaysSharp)
{
    Noisy noisy = halves(0.0f);
    filterIrradiance(noisy.values, noisy.variance, noisy.surface, {});
    EXPECT_LT(rms(noisy.values, kSize / 2 - 2, kSize / 2, 1.0f), 0.5f * kNoise);
    EXPECT_LT(rms(noisy.values, kSize / 2, kSize / 2 + 2, 0.0f), 0.5f * kNoise);
}

TEST(FilterIrradiance, APixelThatSeemsCertainByChanceIsStillSmoothed)
{
    Noisy noisy = halves(1.0f);
    noisy.values(40, 40) = Rgb(1.25f);
    noisy.variance(40, 40) = 0.0f;
    filterIrradiance(noisy.values, noisy.variance, noisy.surface, {});
    EXPECT_NEAR(noisy.values(40, 40).g, 1.0f, 0.5f * kNoise);
}

TEST(FilterIrradiance, SurfacesDoNotMixAndPixelsWithoutOneStay)
{
    Noisy noisy = halves(1.15f);
    for (int y = 0; y < kSize; ++y)
        for (int x = kSize / 2; x < kSize; ++x)
            noisy.surface(x, y) = 1;
    noisy.surface(10, 10) = -1;
    const Rgb lonely = noisy.values(10, 10);
    filterIrradiance(noisy.values, noisy.variance, noisy.surface, {});
    EXPECT_EQ(noisy.values(10, 10), lonely);
    EXPECT_NEAR(noisy.values(kSize / 2 - 1, 50).g, 1.0f, 0.05f);
    EXPECT_NEAR(noisy.values(kSize / 2, 50).g, 1.15f, 0.05f);
}

TEST(FilterIrradiance, NoNoiseNoChangeAndNoLevelsNoFilter)
{
    Noisy exact = halves(0.5f);
    const Image<Rgb> before = exact.values;
    IrradianceFilterOptions none;
    none.levels = 0;
    filterIrradiance(exact.values, exact.variance, exact.surface, none);
    EXPECT_EQ(exact.values, before);
    exact.variance = Image<float>(kSize, kSize, 0.0f);
    filterIrradiance(exact.values, exact.variance, exact.surface, {});
    for (std::size_t i = 0; i < before.pixelCount(); ++i)
        EXPECT_NEAR(exact.values.pixels()[i].g, before.pixels()[i].g, tolerance::kFloat);
}

}  // namespace
}  // namespace insitu
