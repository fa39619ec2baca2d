/// What grain is made of beyond its deviation: correlation between pixels and channels, and what of
/// it pixels have already.

#include "composite/match/grain.h"
#include "composite/match/grain_finish.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

/// White noise of unit variance, a function of the pixel.
double white(int x, int y, std::uint64_t channel)
{
    RandomStream random(
        20261127,
        (static_cast<std::uint64_t>(y + 50) << 32U) | static_cast<std::uint64_t>(x + 50),
        channel);
    return random.normal();
}

/// A grey wall of 16 bits with noise of 2 steps of 8 bits.
template <class Noise>
EncodedImage wall(int width, int height, const Noise& noise)
{
    EncodedImage photo{Image<glm::u16vec3>(width, height), 65535};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            photo.codes(x, y) =
                glm::u16vec3(glm::round((glm::dvec3(120.0) + 2.0 * noise(x, y)) * 257.0));
    return photo;
}

/// Mean product of red here and green `dx` pixels to the right.
double redGreen(const Image<Rgb>& texture, int dx)
{
    double sum = 0.0;
    int count = 0;
    for (int y = 0; y < texture.height(); ++y)
        for (int x = 2; x + 2 < texture.width(); ++x, ++count)
            sum += static_cast<double>(texture(x, y).r) * static_cast<double>(texture(x + dx, y).g);
    return sum / count;
}

TEST(GrainCorrelation, RemembersWhichWayChannelsAreShifted)
{
    // Green is red, moved a pixel to the left.
    const EncodedImage photo = wall(512, 384, [](int x, int y) {
        return glm::dvec3(white(x, y, 0), white(x + 1, y, 0), white(x, y, 2));
    });
    const GrainEstimate estimate = estimateGrain(photo, ResponseCurve::srgb());
    ASSERT_TRUE(estimate.findings.empty());
    const Image<Rgb> texture = grainTexture(estimate.model, 0, 0, 300, 300, 5);
    EXPECT_NEAR(redGreen(texture, -1), 1.0, 0.1);
    EXPECT_NEAR(redGreen(texture, 0), 0.0, 0.1);
    EXPECT_NEAR(redGreen(texture, 1), 0.0, 0.1);
}

TEST(GrainCorrelation, GivesBackWhatAPlaneTakesFromCoarseGrain)
{
    // Means of 5 x 5 pixels: a plane through a block of 16 x 16 takes a good part of them.
    const EncodedImage photo = wall(640, 480, [](int x, int y) {
        glm::dvec3 sum(0.0);
        for (int dy = -2; dy <= 2; ++dy)
            for (int dx = -2; dx <= 2; ++dx)
                for (int c = 0; c < 3; ++c)
                    sum[c] += white(x + dx, y + dy, static_cast<std::uint64_t>(c)) / 5.0;
        return sum;
    });
    const GrainEstimate estimate = estimateGrain(photo, ResponseCurve::srgb());
    ASSERT_TRUE(estimate.findings.empty());
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(estimate.model.sigmaAt(c, 120.0), 2.0, 0.1) << "channel " << c;
}

class GrainFinish : public ::testing::Test {
protected:
    static constexpr int kSide = 64;
    static constexpr double kSigma = 3.0;
    CameraMatch match_ = [] {
        CameraMatch match;
        for (auto& channel : match.grain.sigma)
            channel.fill(kSigma);
        return match;
    }();
    ResponseCurve response_ = ResponseCurve::srgb();
    PhotoNoise noise_{match_.grain, response_, 1.0, 255};
    Image<std::uint8_t> influence_{kSide, kSide, 1};
    GrainFinisher finisher_{match_, noise_, influence_};

    /// Deviation of the codes about their mean, and the mean.
    [[nodiscard]] std::pair<double, double> finished(const PixelChange& change) const
    {
        double sum = 0.0;
        double square = 0.0;
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x) {
                const double code = finisher_.finish(x, y, 1, change, 255);
                sum += code;
                square += code * code;
            }
        const double count = kSide * kSide;
        return {std::sqrt(square / count - sum * sum / count / count), sum / count};
    }
};

TEST_F(GrainFinish, AddsOnlyWhatIsLacking)
{
    const double light = response_.decode(1, 128.0);
    const double of_light = kSigma / noise_.slope(1, 128.0);  // the grain's, in radiance
    // Rendered without noise: all of the grain. With half of its variance: the other half.
    const auto [all, mean] = finished({light, light, light, 0.0});
    EXPECT_NEAR(all, kSigma, 0.1 * kSigma);
    EXPECT_NEAR(mean, 128.0, 0.15);
    EXPECT_NEAR(finished({light, light, light, 0.5 * of_light * of_light}).first,
                std::sqrt(0.5) * kSigma,
                0.1 * kSigma);
    // As noisy as the photograph, and the photograph itself: none.
    EXPECT_LT(finished({light, light, light, of_light * of_light}).first, 1e-9);
    EXPECT_LT(finished({light, light, 0.0, 0.0}).first, 1e-9);
    // Half of the light is the photograph's: a quarter of the variance is there.
    EXPECT_NEAR(
        finished({light, light, 0.5 * light, 0.0}).first, std::sqrt(0.75) * kSigma, 0.1 * kSigma);
}

}  // namespace
}  // namespace insitu
