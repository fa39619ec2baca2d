// Photographs and objects at the limits of what the compositor is asked for.
#include "composite/differential.h"
#include "composite/match/grain.h"
#include "core/color.h"
#include "core/quantile.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu {
namespace {

constexpr int kWidth = 24;
constexpr int kHeight = 16;
constexpr double kExposure = 0.02;

EncodedImage plainPhoto(std::uint16_t code, int max_code = 255)
{
    return {Image<glm::u16vec3>(kWidth, kHeight, glm::u16vec3(code)), max_code};
}

PhotoLayers plainLayers(float with = 20.0f)
{
    PhotoLayers layers;
    layers.object = layers.coverage = layers.probe_radiance = Image<Rgb>(kWidth, kHeight);
    layers.irradiance_without = Image<Rgb>(kWidth, kHeight, Rgb(20.0f));
    layers.irradiance_with = Image<Rgb>(kWidth, kHeight, Rgb(with));
    layers.object_variance = layers.depth_m = Image<float>(kWidth, kHeight);
    return layers;
}

/// Grain of two codes everywhere.
CameraMatch grainy()
{
    CameraMatch match;
    for (auto& channel : match.grain.sigma)
        channel.fill(2.0);
    return match;
}

void expectFinite(const Composite& composite)
{
    for (const Rgb& value : composite.linear.pixels())
        for (int c = 0; c < 3; ++c)
            ASSERT_TRUE(std::isfinite(value[c]) && value[c] >= 0.0f);
}

TEST(CompositeLimits, ABlackPlateStaysBlackInShadeAndShowsObjects)
{
    for (const CompositeForm form :
         {CompositeForm::Ratio, CompositeForm::Difference, CompositeForm::Mixed}) {
        CompositeOptions options;
        options.form = form;
        PhotoLayers layers = plainLayers(5.0f);
        layers.object(3, 3) = Rgb(10.0f);
        layers.coverage(3, 3) = Rgb(1.0f);
        const Composite composite =
            compositeDifferential(plainPhoto(0), ResponseCurve::srgb(), kExposure, layers, options);
        expectFinite(composite);
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x)
                if (x != 3 || y != 3) {
                    EXPECT_EQ(composite.image.codes(x, y), glm::u16vec3(0));
                }
        EXPECT_NEAR(
            composite.image.codes(3, 3).g, ResponseCurve::srgb().encode(1, 10.0 * kExposure), 0.51);
    }
}

TEST(CompositeLimits, APlateWithoutLightOnItsReceiversIsNotDividedBy)
{
    PhotoLayers layers = plainLayers();
    for (Rgb& value : layers.irradiance_without.pixels())
        value = Rgb(0.0f);
    const Composite composite =
        compositeDifferential(plainPhoto(90), ResponseCurve::srgb(), kExposure, layers, {});
    expectFinite(composite);
    // No reflectance can be known of what got no light: nothing changes.
    EXPECT_EQ(composite.image.codes, plainPhoto(90).codes);
}

// A glow that covers nothing: premultiplied colour adds, and hides nothing of the photograph.
TEST(CompositeLimits, ColourWithoutCoverageAdds)
{
    PhotoLayers layers = plainLayers();
    layers.object(5, 5) = Rgb(4.0f, 0.0f, 0.0f);
    const ResponseCurve srgb = ResponseCurve::srgb();
    const Composite composite = compositeDifferential(plainPhoto(90), srgb, kExposure, layers, {});
    const double before = srgb.decode(0, 90);
    EXPECT_NEAR(composite.image.codes(5, 5).r, srgb.encode(0, before + 4.0 * kExposure), 0.51);
    EXPECT_EQ(composite.image.codes(5, 5).g, 90);
    EXPECT_EQ(composite.image.codes(6, 5), glm::u16vec3(90));
}

TEST(CompositeLimits, AnObjectThatCoversEverythingIsAllThatIsSeen)
{
    PhotoLayers layers = plainLayers(0.0f);
    layers.object = Image<Rgb>(kWidth, kHeight, Rgb(10.0f, 6.0f, 2.0f));
    layers.coverage = Image<Rgb>(kWidth, kHeight, Rgb(1.0f));
    const ResponseCurve srgb = ResponseCurve::srgb();
    for (const std::uint16_t code : {std::uint16_t{0}, std::uint16_t{90}, std::uint16_t{255}}) {
        const Composite composite =
            compositeDifferential(plainPhoto(code), srgb, kExposure, layers, {});
        EXPECT_EQ(composite.influence_fraction, 1.0);
        for (const glm::u16vec3& made : composite.image.codes.pixels())
            // A clipped channel keeps its code unless less light comes.
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(made[c], srgb.encode(c, layers.object(0, 0)[c] * kExposure), 0.51);
    }
    // It gets all of the grain, which nothing of the photograph is left to bring.
    const CameraMatch match = grainy();
    const Composite noisy =
        compositeDifferential(plainPhoto(90), srgb, kExposure, layers, {}, glm::dmat3(1), match);
    double square = 0.0;
    for (const glm::u16vec3& made : noisy.image.codes.pixels()) {
        const double off = made.g - srgb.encode(1, 6.0 * kExposure);
        square += off * off;
    }
    // 384 samples: their standard deviation is known within 4 % (one sigma), rounding adds 1 %.
    EXPECT_NEAR(std::sqrt(square / (kWidth * kHeight)), 2.0, 0.3);
}

TEST(CompositeLimits, AWhollySaturatedPlateIsABoundUnderShade)
{
    PhotoLayers layers = plainLayers(10.0f);
    for (Rgb& value : layers.irradiance_without.pixels())
        value = Rgb(1e4f);
    for (Rgb& value : layers.irradiance_with.pixels())
        value = Rgb(5e3f);
    const ResponseCurve srgb = ResponseCurve::srgb();
    const Composite composite = compositeDifferential(plainPhoto(255), srgb, kExposure, layers, {});
    expectFinite(composite);
    for (const glm::u16vec3& made : composite.image.codes.pixels())
        EXPECT_NEAR(made.g, srgb.encode(1, 0.5), 0.51);
}

/// An HDR photograph over eight decades.
Image<Rgb> wideRange()
{
    Image<Rgb> radiance(kWidth, kHeight);
    RandomStream random(11, 0, 0);
    for (Rgb& value : radiance.pixels())
        for (int c = 0; c < 3; ++c)
            value[c] = static_cast<float>(std::pow(10.0, 8.0 * random.uniformDouble() - 4.0));
    radiance(0, 0) = Rgb(0.0f);
    return radiance;
}

TEST(CompositeOfRadiance, KeepsEveryValueThatIsNotTouched)
{
    const Photo photo = photoFromRadiance(wideRange());
    PhotoLayers layers = plainLayers();
    layers.irradiance_without = Image<Rgb>(kWidth, kHeight, Rgb(1e6f));
    layers.irradiance_with = layers.irradiance_without;
    for (int x = 4; x < 9; ++x)
        layers.irradiance_with(x, 7) *= 0.25f;
    layers.object(20, 3) = Rgb(3.0f, 2.0f, 1.0f);
    layers.object(21, 3) = Rgb(1e7f);
    layers.coverage(20, 3) = layers.coverage(21, 3) = Rgb(1.0f);
    const Composite composite =
        compositeDifferential(photo.image, photo.metadata.color.transfer, 1.0, layers, {});
    const Image<Rgb> made = radianceOfComposite(photo, composite);
    std::vector<double> luminances;
    for (const Rgb& value : photo.radiance.pixels())
        luminances.push_back(luminance(value));
    const double median = quantile(luminances, 0.5);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const bool shaded = y == 7 && x >= 4 && x < 9;
            const bool covered = y == 3 && (x == 20 || x == 21);
            if (covered) continue;
            if (!shaded) {
                EXPECT_EQ(made(x, y), photo.radiance(x, y)) << x << ' ' << y;
                continue;
            }
            for (int c = 0; c < 3; ++c) {
                // Two codes off at most, each as fine as photoFromRadiance() says.
                const double expected = 0.25 * photo.radiance(x, y)[c];
                EXPECT_NEAR(made(x, y)[c], expected, 6e-4 * std::max(expected, 0.01 * median));
            }
        }
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(made(20, 3)[c], 3.0 - c, 6e-4 * std::max(3.0, 0.01 * median));
    // Brighter than all of the photograph: no code stands for it.
    EXPECT_EQ(made(21, 3), Rgb(1e7f));
}

}  // namespace
}  // namespace insitu
