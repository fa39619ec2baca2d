#include "evaluate/visible_differences.h"

#include "evaluate/cortex_transform.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

constexpr int kSize = 144;
constexpr ViewingConditions kViewing{};

/// Mean display luminance of the gratings, cd/m²: value 0.5.
constexpr double kMean = 50.5;
constexpr double kArea = kSize * kSize / (30.0 * 30.0);

/// A grating of `contrast` around the mean, `cycles` per pixel, added to `image`.
void addGrating(Image<float>& image, double contrast, double cycles, double orientation = 0.0)
{
    const double amplitude = contrast * kMean / (kViewing.white_cd_m2 - kViewing.black_cd_m2);
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
            image(x, y) += static_cast<float>(
                amplitude * std::cos(2.0 * pi * cycles *
                                     (x * std::cos(orientation) + y * std::sin(orientation))));
}

Image<float> plain()
{
    return Image<float>(kSize, kSize, 0.5f);
}

double threshold(double cycles, double orientation = 0.0)
{
    return 1.0 /
           contrastSensitivity(
               cycles * kViewing.pixels_per_degree, orientation, kMean, kArea, kViewing.distance_m);
}

VisibleDifferences compared(const Image<float>& a, const Image<float>& b)
{
    Progress silent;
    return visibleDifferences(a, b, kViewing, silent);
}

/// Largest probability away from the border.
double seen(const Image<float>& a, const Image<float>& b)
{
    const VisibleDifferences result = compared(a, b);
    float largest = 0.0f;
    for (int y = kSize / 4; y < 3 * kSize / 4; ++y)
        for (int x = kSize / 4; x < 3 * kSize / 4; ++x)
            largest = std::max(largest, result.probability(x, y));
    return static_cast<double>(largest);
}

TEST(CortexTransform, BandsSumToOne)
{
    for (double y = -0.5; y <= 0.5; y += 0.0417)
        for (double x = -0.5; x <= 0.5; x += 0.0313) {
            double sum = 0.0;
            for (int band = 0; band < cortex::kBands; ++band) {
                const double weight = cortex::bandWeight(band, x, y);
                EXPECT_GE(weight, -0.2);  // the base's Gaussian exceeds its mesa
                EXPECT_NEAR(weight, cortex::bandWeight(band, -x, -y), tolerance::kDouble);
                sum += weight;
            }
            ASSERT_NEAR(sum, 1.0, tolerance::kDouble) << x << ", " << y;
        }
}

// The curve's published shape: band-pass, peak between 2 and 6 cycles a degree and near 250 by day,
// lower and at coarser gratings in the dark, oblique gratings harder.
TEST(ContrastSensitivity, HasThePublishedShape)
{
    const auto at = [](double cycles, double luminance) {
        return contrastSensitivity(cycles, 0.0, luminance, 60.0, 0.5);
    };
    const auto peak = [&](double luminance) {
        double best = 0.1;
        for (double cycles = 0.1; cycles < 40.0; cycles *= 1.02)
            if (at(cycles, luminance) > at(best, luminance)) best = cycles;
        return best;
    };
    EXPECT_GT(peak(100.0), 2.0);
    EXPECT_LT(peak(100.0), 6.0);
    EXPECT_GT(at(peak(100.0), 100.0), 180.0);
    EXPECT_LT(at(peak(100.0), 100.0), 270.0);
    EXPECT_LT(peak(0.01), peak(100.0));
    EXPECT_LT(at(peak(0.01), 0.01), 0.25 * at(peak(100.0), 100.0));
    EXPECT_LT(at(50.0, 100.0), 5.0);
    EXPECT_LT(contrastSensitivity(16.0, pi / 4.0, 100.0, 60.0, 0.5), 0.8 * at(16.0, 100.0));
}

// k1 k2^0.7 = 1 with the published constants: a mask at its threshold raises it by 2^(1/4), strong
// ones by mask^0.7.
TEST(ThresholdElevation, FollowsTheMask)
{
    EXPECT_NEAR(thresholdElevation(0.0), 1.0, tolerance::kDouble);
    EXPECT_NEAR(thresholdElevation(1.0), std::pow(2.0, 0.25), tolerance::kDouble);
    EXPECT_NEAR(thresholdElevation(1000.0), std::pow(1000.0, 0.7), 1e-6);
}

// The calibration of the predictor: gratings at their threshold are seen by half of the observers.
// Frequencies at the middle of an octave, so that one band holds all of each.
TEST(VisibleDifferences, GratingsAtTheirThresholdAreSeenByHalf)
{
    for (const double cycles : {1.0 / 3.0, 1.0 / 6.0, 1.0 / 12.0, 1.0 / 24.0})
        for (const double orientation : {0.0, pi / 2.0}) {
            if (orientation > 0.0 && cycles != 1.0 / 6.0) continue;
            const auto seenAt = [&](double times) {
                Image<float> grating = plain();
                addGrating(grating, times * threshold(cycles, orientation), cycles, orientation);
                return seen(plain(), grating);
            };
            // Pixels beside the crest and the response's curvature take a little.
            EXPECT_NEAR(seenAt(1.0), 0.5, 0.06) << cycles << ", " << orientation;
            EXPECT_LT(seenAt(0.5), 0.08) << cycles;
            EXPECT_GT(seenAt(2.0), 0.99) << cycles;
        }
}

// A grating hides one of the same kind, not one across it or two octaves off.
TEST(VisibleDifferences, MasksHideWhatIsLikeThem)
{
    constexpr double kCycles = 1.0 / 6.0;
    Image<float> masked = plain();
    addGrating(masked, 30.0 * threshold(kCycles), kCycles);
    const auto seenBeforeMask = [&](double times, double cycles, double orientation) {
        Image<float> both = masked;
        addGrating(both, times * threshold(cycles, orientation), cycles, orientation);
        return seen(masked, both);
    };
    EXPECT_LT(seenBeforeMask(2.0, kCycles, 0.0), 0.1);
    EXPECT_GT(seenBeforeMask(30.0, kCycles, 0.0), 0.9);
    EXPECT_GT(seenBeforeMask(2.0, kCycles, pi / 2.0), 0.9);
    EXPECT_GT(seenBeforeMask(2.0, kCycles / 4.0, 0.0), 0.9);
}

TEST(VisibleDifferences, CountsPixelsWhereTheyAreSeen)
{
    const Image<float> reference = plain();
    EXPECT_EQ(compared(reference, reference).percent_seen, 0.0);
    Image<float> spot = reference;
    for (int y = 100; y < 110; ++y)
        for (int x = 60; x < 70; ++x)
            spot(x, y) = 0.9f;
    const VisibleDifferences result = compared(reference, spot);
    EXPECT_GT(result.probability(65, 105), 0.99f);
    EXPECT_LT(result.probability(135, 20), 0.01f);
    EXPECT_GT(result.percent_seen, 100.0 * 100 / (kSize * kSize) / 2.0);
    EXPECT_LT(result.percent_seen, 20.0);
    EXPECT_LE(result.percent_certain, result.percent_seen);
}

TEST(VisibleDifferences, AnySizeAndBadInput)
{
    EXPECT_EQ(compared(Image<float>(1, 1, 0.3f), Image<float>(1, 1, 0.3f)).percent_seen, 0.0);
    EXPECT_EQ(compared(Image<float>(1, 300, 0.3f), Image<float>(1, 300, 0.3f)).percent_seen, 0.0);
    EXPECT_THAT(inputErrorOf([] { (void)compared(Image<float>(4, 3), Image<float>(3, 4)); }),
                testing::HasSubstr("3x4"));
    EXPECT_THAT(inputErrorOf([] { (void)compared({}, {}); }), testing::HasSubstr("empty"));
    Image<float> bad(4, 3, 0.5f);
    bad(2, 1) = std::numeric_limits<float>::infinity();
    EXPECT_THAT(inputErrorOf([&] { (void)compared(bad, Image<float>(4, 3)); }),
                testing::HasSubstr("reference:pixel (2, 1)"));
    ViewingConditions viewing;
    viewing.black_cd_m2 = 0.0;
    viewing.pixels_per_degree = -1.0;
    EXPECT_EQ(viewing.validate().size(), 2u);
    EXPECT_TRUE(hasFinding(viewing.validate(), "viewing-conditions"));
}

}  // namespace
}  // namespace insitu
