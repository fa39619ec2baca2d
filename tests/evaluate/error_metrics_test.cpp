#include "evaluate/error_metrics.h"

#include "core/color.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace insitu {
namespace {

/// Two pixels a row: what the closed forms below are worked out for.
Image<Rgb> pair(Rgb left, Rgb right)
{
    Image<Rgb> image(2, 1);
    image(0, 0) = left;
    image(1, 0) = right;
    return image;
}

Image<Rgb> noise(int width, int height, std::uint64_t seed)
{
    Image<Rgb> image(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            RandomStream random(seed, static_cast<std::uint64_t>(y * width + x), 0);
            for (int c = 0; c < 3; ++c)
                image(x, y)[c] = 0.1f + random.uniform();
        }
    return image;
}

TEST(CompareImages, EqualImagesHaveNoError)
{
    const Image<Rgb> image = noise(17, 11, 1);
    const auto metrics = compareImages(image, image);
    ASSERT_TRUE(metrics);
    EXPECT_EQ(metrics->pixels, 17 * 11);
    EXPECT_EQ(metrics->nrmse, 0.0);
    EXPECT_EQ(metrics->rms_percent, 0.0);
    EXPECT_EQ(metrics->mean_percent, 0.0);
    EXPECT_EQ(metrics->max_difference, 0.0);
}

// Red differs by 0.5 in one of two pixels: rmse = sqrt(0.25 / 2). Its values are 1, 3, 1, 2.5:
// range 2. Green differs by 1 in both, values 0, 1, 1, 2: rmse 1, range 2. Blue is equal.
TEST(CompareImages, Equation17PerChannelThenAveraged)
{
    const auto metrics = compareImages(pair({1.0f, 0.0f, 4.0f}, {3.0f, 1.0f, 8.0f}),
                                       pair({1.0f, 1.0f, 4.0f}, {2.5f, 2.0f, 8.0f}));
    ASSERT_TRUE(metrics);
    EXPECT_NEAR(metrics->rmse.x, std::sqrt(0.125), tolerance::kDouble);
    EXPECT_NEAR(metrics->range.x, 2.0, tolerance::kDouble);
    EXPECT_NEAR(metrics->nrmse_channels.x, std::sqrt(0.125) / 2.0, tolerance::kDouble);
    EXPECT_NEAR(metrics->nrmse_channels.y, 0.5, tolerance::kDouble);
    EXPECT_EQ(metrics->nrmse_channels.z, 0.0);
    EXPECT_NEAR(metrics->nrmse, (std::sqrt(0.125) / 2.0 + 0.5) / 3.0, tolerance::kDouble);
    EXPECT_EQ(metrics->max_difference, 1.0);
}

// Greys 1 and 4 shown as 1.5 and 3: relative errors of luminance 0.5 and 0.25.
TEST(CompareImages, Equations18And19AreRelativeToTheReference)
{
    const auto metrics = compareImages(pair(Rgb(1.0f), Rgb(4.0f)), pair(Rgb(1.5f), Rgb(3.0f)));
    ASSERT_TRUE(metrics);
    EXPECT_NEAR(
        metrics->rms_percent, 100.0 * std::sqrt((0.25 + 0.0625) / 2.0), 100.0 * tolerance::kFloat);
    EXPECT_NEAR(metrics->mean_percent, 37.5, 100.0 * tolerance::kFloat);
}

// A channel's share in the relative error is its Rec. 709 luminance weight.
TEST(CompareImages, RelativeErrorsAreOfLuminance)
{
    const auto metrics =
        compareImages(pair(Rgb(1.0f), Rgb(1.0f)), pair({1.0f, 1.5f, 1.0f}, {1.0f, 1.5f, 1.0f}));
    ASSERT_TRUE(metrics);
    EXPECT_NEAR(metrics->mean_percent, 50.0 * 0.7152, 100.0 * tolerance::kFloat);
}

TEST(CompareImages, BlackReferencePixelsHaveNoRelativeError)
{
    const auto metrics = compareImages(pair(Rgb(0.0f), Rgb(2.0f)), pair(Rgb(1.0f), Rgb(1.0f)));
    ASSERT_TRUE(metrics);
    EXPECT_EQ(metrics->black_pixels, 1);
    EXPECT_EQ(metrics->pixels, 2);
    EXPECT_NEAR(metrics->mean_percent, 50.0, 100.0 * tolerance::kFloat);
    EXPECT_NEAR(metrics->rmse.x, 1.0, tolerance::kDouble);
}

// NRMSE has no unit; the percentages have none either.
TEST(CompareImages, DoesNotDependOnTheUnit)
{
    const Image<Rgb> reference = noise(40, 30, 1);
    const Image<Rgb> picture = noise(40, 30, 2);
    Image<Rgb> scaled_reference = reference;
    Image<Rgb> scaled_picture = picture;
    for (Rgb& pixel : scaled_reference.pixels())
        pixel *= 1024.0f;
    for (Rgb& pixel : scaled_picture.pixels())
        pixel *= 1024.0f;
    const auto metrics = compareImages(reference, picture);
    const auto scaled = compareImages(scaled_reference, scaled_picture);
    ASSERT_TRUE(metrics && scaled);
    EXPECT_NEAR(scaled->nrmse, metrics->nrmse, tolerance::kDouble);
    EXPECT_NEAR(scaled->rms_percent, metrics->rms_percent, 100.0 * tolerance::kFloat);
    EXPECT_NEAR(scaled->mean_percent, metrics->mean_percent, 100.0 * tolerance::kFloat);
}

// Outside the mask anything may stand, even what is no number.
TEST(CompareImages, MaskChoosesPixels)
{
    PixelMask mask(2, 1, 0);
    mask(1, 0) = 200;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto metrics = compareImages(pair(Rgb(nan), Rgb(2.0f)), pair(Rgb(7.0f), Rgb(1.0f)), mask);
    ASSERT_TRUE(metrics);
    EXPECT_EQ(metrics->pixels, 1);
    EXPECT_NEAR(metrics->nrmse, 1.0, tolerance::kDouble);
    EXPECT_FALSE(
        compareImages(pair(Rgb(1.0f), Rgb(1.0f)), pair(Rgb(1.0f), Rgb(1.0f)), PixelMask(2, 1, 0)));
}

TEST(CompareImages, RefusesWhatIsNoNumberAndNamesThePixel)
{
    const float infinity = std::numeric_limits<float>::infinity();
    try {
        (void)compareImages(pair(Rgb(1.0f), Rgb(1.0f)), pair(Rgb(1.0f), {1.0f, infinity, 1.0f}));
        FAIL() << "accepted an infinite value";
    } catch (const InputError& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr("picture:pixel (1, 0)"));
    }
}

TEST(CompareImages, SizesMustAgree)
{
    const Image<Rgb> image(4, 3);
    EXPECT_THROW((void)compareImages(image, Image<Rgb>(3, 4)), LogicError);
    EXPECT_THROW((void)compareImages(image, image, PixelMask(3, 4)), LogicError);
}

TEST(CompareImages, SameBitsForAnyNumberOfThreads)
{
    const Image<Rgb> reference = noise(97, 131, 1);
    const Image<Rgb> picture = noise(97, 131, 2);
    setThreadCount(1);
    const auto one = compareImages(reference, picture);
    setThreadCount(0);
    const auto all = compareImages(reference, picture);
    ASSERT_TRUE(one && all);
    EXPECT_EQ(one->nrmse, all->nrmse);
    EXPECT_EQ(one->rms_percent, all->rms_percent);
    EXPECT_EQ(one->mean_percent, all->mean_percent);
}

TEST(CompareCodes, CountsWhatIsNotTheSameByte)
{
    EncodedImage reference{Image<glm::u16vec3>(3, 1, glm::u16vec3(10)), 255};
    EncodedImage picture = reference;
    picture.codes(1, 0).y = 7;
    picture.codes(2, 0).z = 11;
    const CodeDifference all = compareCodes(reference, picture);
    EXPECT_EQ(all.pixels, 3);
    EXPECT_EQ(all.differing_pixels, 2);
    EXPECT_EQ(all.max_codes, 3);
    PixelMask mask(3, 1, 1);
    mask(1, 0) = 0;
    const CodeDifference masked = compareCodes(reference, picture, mask);
    EXPECT_EQ(masked.pixels, 2);
    EXPECT_EQ(masked.differing_pixels, 1);
    EXPECT_EQ(masked.max_codes, 1);
    picture.max_code = 65535;
    EXPECT_THROW((void)compareCodes(reference, picture), LogicError);
}

// IEC 61966-2-1: code 118 of 255 is 18.1 % grey; the curve's ends are exact.
TEST(DecodeSrgb, FollowsTheStandard)
{
    EncodedImage image{Image<glm::u16vec3>(1, 1, glm::u16vec3(0, 118, 255)), 255};
    const Rgb linear = decodeSrgb(image)(0, 0);
    EXPECT_EQ(linear.r, 0.0f);
    EXPECT_NEAR(linear.g, std::pow((118.0 / 255.0 + 0.055) / 1.055, 2.4), tolerance::kFloat);
    EXPECT_EQ(linear.b, 1.0f);
}

}  // namespace
}  // namespace insitu
