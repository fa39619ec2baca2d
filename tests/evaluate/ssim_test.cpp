#include "evaluate/ssim.h"

#include "core/random.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/quality/qualityssim.hpp>

#include <cmath>
#include <limits>

namespace insitu {
namespace {

Image<float> noisy(int width, int height, float amplitude, std::uint64_t seed)
{
    Image<float> image(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            RandomStream random(seed, static_cast<std::uint64_t>(y * width + x), 0);
            image(x, y) = 120.0f + 60.0f * std::sin(0.2f * static_cast<float>(x)) +
                          amplitude * (random.uniform() - 0.5f);
        }
    return image;
}

TEST(StructuralSimilarity, OfAPictureWithItselfIsOne)
{
    const Image<float> image = noisy(40, 30, 20.0f, 1);
    EXPECT_NEAR(structuralSimilarity(image, image, 255.0).mean, 1.0, tolerance::kDouble);
}

// Plain pictures a and b have no variance: (2ab + C1) / (a² + b² + C1).
TEST(StructuralSimilarity, OfPlainPicturesHasAClosedForm)
{
    const double c1 = 0.01 * 0.01 * 255.0 * 255.0;
    const StructuralSimilarity s =
        structuralSimilarity(Image<float>(12, 13, 100.0f), Image<float>(12, 13, 140.0f), 255.0);
    EXPECT_NEAR(s.mean,
                (2.0 * 100.0 * 140.0 + c1) / (100.0 * 100.0 + 140.0 * 140.0 + c1),
                1e-9);  // variances are differences of squares of 1e4
    EXPECT_EQ(s.map.width(), 2);
    EXPECT_EQ(s.map.height(), 3);
}

// OpenCV's contributed module filters with the same window; it differs at the borders only.
TEST(StructuralSimilarity, AgreesWithAnotherImplementation)
{
    const Image<float> a = noisy(64, 48, 10.0f, 1);
    const Image<float> b = noisy(64, 48, 90.0f, 2);
    const auto matOf = [](const Image<float>& image) {
        return cv::Mat(image.height(), image.width(), CV_32F, const_cast<float*>(&image(0, 0)));
    };
    cv::Mat theirs;
    cv::quality::QualitySSIM::compute(matOf(a), matOf(b), theirs);
    theirs.convertTo(theirs, CV_32F);
    const StructuralSimilarity ours = structuralSimilarity(a, b, 255.0);
    EXPECT_LT(ours.mean, 0.95);
    for (int y = 0; y < ours.map.height(); ++y)
        for (int x = 0; x < ours.map.width(); ++x)
            // Theirs sums squares of 1e4 in single precision.
            ASSERT_NEAR(ours.map(x, y), theirs.at<float>(y + 5, x + 5), 1e-3) << x << ", " << y;
}

TEST(StructuralSimilarity, RefusesWhatItCannotCompare)
{
    const auto compare = [](const Image<float>& a, const Image<float>& b) {
        return inputErrorOf([&] { (void)structuralSimilarity(a, b, 1.0); });
    };
    const Image<float> good(12, 12, 0.5f);
    EXPECT_THAT(compare(good, Image<float>(12, 13, 0.5f)), testing::HasSubstr("12x13"));
    EXPECT_THAT(compare(Image<float>(10, 30), Image<float>(10, 30)), testing::HasSubstr("11x11"));
    Image<float> bad = good;
    bad(3, 4) = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THAT(compare(good, bad), testing::HasSubstr("picture:pixel (3, 4)"));
}

TEST(StructuralSimilarity, EncodedGreyIsTheSrgbCurveOfLuminance)
{
    Image<Rgb> display(2, 1, Rgb(1.0f));
    display(1, 0) = Rgb(0.18f);
    EXPECT_NEAR(encodedGrey(display)(0, 0), 1.0, tolerance::kFloat);
    EXPECT_NEAR(encodedGrey(display)(1, 0), 0.461356, tolerance::kFloat);
}

}  // namespace
}  // namespace insitu
