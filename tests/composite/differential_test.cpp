#include "composite/differential.h"

#include "core/color.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

/// A photograph with every code 5..245 somewhere, sRGB.
EncodedImage rampPhoto(int max_code = 255)
{
    EncodedImage photo{Image<glm::u16vec3>(32, 24), max_code};
    for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 32; ++x) {
            const int code = (5 + (x + 32 * y) % 240) * max_code / 255;
            photo.codes(x, y) = glm::u16vec3(code, code, (code + max_code / 8) % max_code);
        }
    return photo;
}

RenderLayers quietLayers(int width, int height)
{
    RenderLayers layers;
    layers.object = layers.probe_radiance = Image<Rgb>(width, height);
    layers.irradiance_with = layers.irradiance_without = Image<Rgb>(width, height, Rgb(20.0f));
    layers.alpha = layers.depth_m = layers.object_variance = layers.ratio_variance =
        Image<float>(width, height);
    return layers;
}

constexpr double kExposure = 0.02;

TEST(CompositeDifferential, NothingAddedLeavesEveryCode)
{
    for (const int max_code : {255, 65535}) {
        const EncodedImage photo = rampPhoto(max_code);
        const Composite composite = compositeDifferential(
            photo, ResponseCurve::srgb(), kExposure, matchLayers(quietLayers(32, 24), {}), {});
        EXPECT_EQ(composite.image.codes, photo.codes);
        EXPECT_EQ(composite.influence_fraction, 0.0);
        EXPECT_TRUE(composite.findings.empty());
    }
}

TEST(CompositeDifferential, HalfTheLightIsHalfTheRadiance)
{
    const EncodedImage photo = rampPhoto(65535);
    const ResponseCurve response = ResponseCurve::srgb();
    RenderLayers layers = quietLayers(32, 24);
    // Dim enough that no receiver counts as shining.
    layers.irradiance_without = Image<Rgb>(32, 24, Rgb(400.0f));
    layers.irradiance_with = Image<Rgb>(32, 24, Rgb(200.0f));
    const Composite composite =
        compositeDifferential(photo, response, kExposure, matchLayers(layers, {}), {});
    const Image<Rgb> before = photographedRadiance(photo, response, kExposure);
    for (std::size_t i = 0; i < before.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c) {
            EXPECT_NEAR(composite.linear.pixels()[i][c],
                        0.5f * before.pixels()[i][c],
                        tolerance::kFloat * before.pixels()[i][c]);
            const double code =
                response.encode(c, 0.5 * before.pixels()[i][c] * kExposure) * 65535 / 255;
            EXPECT_NEAR(composite.image.codes.pixels()[i][c], code, 0.51);
        }
}

TEST(CompositeDifferential, ChangesBelowHalfACodeAreNotMade)
{
    const EncodedImage photo = rampPhoto();
    RenderLayers layers = quietLayers(32, 24);
    layers.irradiance_with = Image<Rgb>(32, 24, Rgb(20.0f * 0.9995f));
    EXPECT_EQ(
        compositeDifferential(photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {})
            .image.codes,
        photo.codes);
}

TEST(CompositeDifferential, OnlyPixelsUnderTheInfluenceChange)
{
    const EncodedImage photo = rampPhoto();
    RenderLayers layers = quietLayers(32, 24);
    for (int y = 10; y < 15; ++y)
        for (int x = 8; x < 20; ++x)
            layers.irradiance_with(x, y) *= 0.4f;
    const Composite composite =
        compositeDifferential(photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {});
    for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 32; ++x) {
            const bool inside = y >= 10 && y < 15 && x >= 8 && x < 20;
            EXPECT_EQ(composite.influence(x, y) != 0, inside);
            if (!inside) {
                EXPECT_EQ(composite.image.codes(x, y), photo.codes(x, y));
            }
        }
}

TEST(CompositeDifferential, OpaqueObjectReplacesThePhotograph)
{
    const EncodedImage photo = rampPhoto();
    const ResponseCurve response = ResponseCurve::srgb();
    RenderLayers layers = quietLayers(32, 24);
    const Rgb radiance(10.0f, 5.0f, 20.0f);
    layers.object(4, 4) = radiance;
    layers.alpha(4, 4) = 1.0f;
    layers.object(5, 4) = 0.5f * radiance;
    layers.alpha(5, 4) = 0.5f;
    const Composite composite =
        compositeDifferential(photo, response, kExposure, matchLayers(layers, {}), {});
    const Image<Rgb> before = photographedRadiance(photo, response, kExposure);
    for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(
            composite.image.codes(4, 4)[c], response.encode(c, radiance[c] * kExposure), 0.51);
        const double mixed = 0.5 * radiance[c] + 0.5 * before(5, 4)[c];
        EXPECT_NEAR(composite.image.codes(5, 4)[c], response.encode(c, mixed * kExposure), 0.51);
    }
}

TEST(CompositeDifferential, FormsAgreeWhenReflectanceIsPerPixel)
{
    const EncodedImage photo = rampPhoto(65535);
    RenderLayers layers = quietLayers(32, 24);
    layers.irradiance_without = Image<Rgb>(32, 24, Rgb(300.0f));
    layers.irradiance_with = Image<Rgb>(32, 24, Rgb(210.0f));
    CompositeOptions ratio;
    CompositeOptions difference;
    difference.form = CompositeForm::Difference;
    difference.reflectance_window = 1;
    const Composite a = compositeDifferential(
        photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), ratio);
    const Composite b = compositeDifferential(
        photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), difference);
    EXPECT_EQ(a.image.codes, b.image.codes);
}

TEST(CompositeDifferential, SmoothedReflectanceIgnoresNoiseInTheDark)
{
    // A dark grey floor with noise: the shadow's depth must not copy the noise.
    EncodedImage photo{Image<glm::u16vec3>(64, 64), 255};
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x)
            photo.codes(x, y) =
                glm::u16vec3(static_cast<std::uint16_t>(20 + ((x * 7 + y * 13) % 9)));
    RenderLayers layers = quietLayers(64, 64);
    layers.irradiance_with = Image<Rgb>(64, 64, Rgb(10.0f));
    CompositeOptions options;
    options.form = CompositeForm::Difference;
    const Image<Rgb> before = photographedRadiance(photo, ResponseCurve::srgb(), kExposure);
    const Composite composite = compositeDifferential(
        photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), options);
    float least = 1e9f;
    float most = 0.0f;
    for (int y = 16; y < 48; ++y)
        for (int x = 16; x < 48; ++x) {
            const float change = before(x, y).g - composite.linear(x, y).g;
            least = std::min(least, change);
            most = std::max(most, change);
        }
    EXPECT_LT(most - least, 0.15f * most);
}

TEST(CompositeDifferential, ClippedChannelIsABound)
{
    EncodedImage photo{Image<glm::u16vec3>(3, 1, glm::u16vec3(255)), 255};
    RenderLayers layers = quietLayers(3, 1);
    const float bound = static_cast<float>(1.0 / kExposure);
    // Pixel 0: the probe saw three times the bound; shade of 0.6 leaves it clipped.
    layers.probe_radiance(0, 0) = Rgb(3.0f * bound);
    layers.irradiance_without(0, 0) = Rgb(100.0f * bound);
    layers.irradiance_with(0, 0) = Rgb(60.0f * bound);
    // Pixel 1: the same surface in deep shade falls below the clipping.
    layers.probe_radiance(1, 0) = Rgb(3.0f * bound);
    layers.irradiance_without(1, 0) = Rgb(100.0f * bound);
    layers.irradiance_with(1, 0) = Rgb(10.0f * bound);
    // Pixel 2: nothing known but the bound.
    layers.irradiance_without(2, 0) = Rgb(100.0f * bound);
    layers.irradiance_with(2, 0) = Rgb(50.0f * bound);
    const Composite composite =
        compositeDifferential(photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {});
    EXPECT_EQ(composite.image.codes(0, 0).g, 255);
    EXPECT_NEAR(composite.image.codes(1, 0).g, ResponseCurve::srgb().encode(1, 0.3), 0.51);
    EXPECT_NEAR(composite.image.codes(2, 0).g, ResponseCurve::srgb().encode(1, 0.5), 0.51);
    EXPECT_TRUE(hasFinding(composite.findings, "composite-clipped-pixels"));
}

TEST(CompositeDifferential, ALampIsNotShadowedLikeAWall)
{
    // Twenty times brighter than any reflection: shade takes at most what it reflects.
    EncodedImage photo{Image<glm::u16vec3>(1, 1, glm::u16vec3(230)), 255};
    RenderLayers layers = quietLayers(1, 1);
    const float radiance = photographedRadiance(photo, ResponseCurve::srgb(), kExposure)(0, 0).g;
    layers.irradiance_without(0, 0) = Rgb(radiance * 3.14159f / 20.0f);
    const Composite composite =
        compositeDifferential(photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {});
    layers.irradiance_with(0, 0) = Rgb(0.0f);
    EXPECT_GT(
        compositeDifferential(photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {})
            .linear(0, 0)
            .g,
        0.9f * radiance);
}

/// Linear Rec. 709 from Display P3, column by column: SMPTE EG 432-1's primaries, both D65.
const glm::dmat3 kRec709FromP3(
    1.2249401, -0.0420569, -0.0196376, -0.2249404, 1.0420571, -0.0786361, 0.0, 0.0, 1.0982735);

TEST(CompositeDifferential, WidePrimariesKeepEveryCodeThatIsNotTouched)
{
    const EncodedImage photo = rampPhoto();
    RenderLayers layers = quietLayers(32, 24);
    layers.irradiance_with(5, 5) *= 0.4f;
    const Composite composite = compositeDifferential(
        photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {}, kRec709FromP3);
    for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 32; ++x)
            if (x != 5 || y != 5) {
                EXPECT_EQ(composite.image.codes(x, y), photo.codes(x, y));
            }
    EXPECT_LT(composite.image.codes(5, 5).g, photo.codes(5, 5).g);
    const Image<Rgb> seen =
        photographedRadiance(photo, ResponseCurve::srgb(), kExposure, kRec709FromP3);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(
            composite.linear(20, 3)[c], seen(20, 3)[c], tolerance::kFloat * luminance(seen(20, 3)));
}

TEST(CompositeDifferential, ObjectsGetTheCodesOfThePhotographsPrimaries)
{
    const EncodedImage photo = rampPhoto(65535);
    RenderLayers layers = quietLayers(32, 24);
    const glm::dvec3 red(20.0, 4.0, 2.0);  // inside both
    layers.object(5, 5) = Rgb(red);
    layers.alpha(5, 5) = 1.0f;
    const Composite composite = compositeDifferential(
        photo, ResponseCurve::srgb(), kExposure, matchLayers(layers, {}), {}, kRec709FromP3);
    const glm::dvec3 wide = glm::inverse(kRec709FromP3) * red;
    for (int c = 0; c < 3; ++c) {
        const double code = ResponseCurve::srgb().encode(c, wide[c] * kExposure) * 257.0;
        EXPECT_NEAR(composite.image.codes(5, 5)[c], code, 0.6) << c;  // rounding to a code
        EXPECT_NEAR(composite.linear(5, 5)[c], red[c], tolerance::kFloat * red.r);
    }
}

TEST(CompositeOptions, ValidateNamesEveryMistake)
{
    CompositeOptions options;
    EXPECT_TRUE(options.validate().empty());
    options.reflectance_window = 4;
    options.clip_fraction = 1.5;
    EXPECT_EQ(options.validate().size(), 2u);
}

}  // namespace
}  // namespace insitu
