#include "composite/match/camera_match.h"

#include "composite/differential.h"
#include "core/parallel.h"
#include "tests/composite/simulated_photo.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace insitu {
namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 360;
const glm::dvec2 kCentre(kWidth / 2.0, kHeight / 2.0);
const double kHalfDiagonal = glm::length(kCentre);

/// Walls, a floor and pictures of different greys; `shade` of the place across, 0..1.
Image<Rgb> room(double vignetting, const std::function<double(double)>& shade)
{
    return picture(kWidth, kHeight, [&](double x, double y) {
        double grey = y > 230.0 + 0.1 * x ? 0.25 : 0.45;
        if (x > 130.0 && x < 210.0 && y > 60.0 && y < 150.0) grey = 0.15;
        if (x > 330.0 && x < 400.0 && y > 90.0 && y < 170.0) grey = 0.6;
        grey *= shade(x / kWidth);
        const double r = glm::length(glm::dvec2(x, y) - kCentre) / kHalfDiagonal;
        return Rgb(static_cast<float>(grey * Vignetting{vignetting, 0.0}.factor(r)));
    });
}

TEST(CameraMatch, VignettingWithinTenPercentOrNotAtAll)
{
    const Image<std::uint8_t> usable(kWidth, kHeight, 1);
    const auto estimated = [&](double truth, const std::function<double(double)>& shade) {
        return estimateVignetting(
            photographedRadiance(
                SimulatedPhoto{}.take(room(truth, shade), 1), ResponseCurve::srgb(), 1.0),
            usable,
            kCentre);
    };
    const auto fading = [](double u) { return 1.25 * std::exp(-0.5 * u); };
    for (const double truth : {0.08, 0.2, 0.35}) {
        const Vignetting estimate = estimated(truth, fading);
        EXPECT_NEAR(estimate.a, truth, 0.1 * truth);
        EXPECT_GT(estimate.a, 3.0 * estimate.sigma) << "must count as seen";
    }
    const Vignetting none = estimated(0.0, fading);
    EXPECT_LT(none.a, 3.0 * none.sigma) << "must not be seen where there is none";
    // Light that falls off in a curve looks like a lens across it: the sectors disagree.
    const Vignetting curved = estimated(0.08, [](double u) { return 1.25 - 0.5 * u; });
    EXPECT_NEAR(curved.a, 0.08, 3.0 * curved.sigma);
    const Vignetting unknown =
        estimateVignetting(Image<Rgb>(20, 20), Image<std::uint8_t>(20, 20, 1), {10.0, 10.0});
    EXPECT_EQ(unknown.a, 0.0);
    EXPECT_TRUE(std::isinf(unknown.sigma));
}

/// Edges as a lens of this focus and blur would show them at depths of 1 to 5 m.
std::vector<EdgeProfile> edgesAtDepths(const DepthOfField& lens, Image<float>& depth_m)
{
    depth_m = Image<float>(kWidth, kHeight);
    for (int x = 0; x < kWidth; ++x)
        for (int y = 0; y < kHeight; ++y)
            depth_m(x, y) = 1.0f + 4.0f * static_cast<float>(x) / kWidth;
    std::vector<EdgeProfile> edges;
    RandomStream random(21, 0, 0);
    for (int i = 0; i < 200; ++i) {
        EdgeProfile edge;
        edge.at = {kWidth * random.uniformDouble(), kHeight * random.uniformDouble()};
        const double depth = depth_m(static_cast<int>(edge.at.x), static_cast<int>(edge.at.y));
        double spread = std::sqrt(0.7 * 0.7 + 1.0 / 12.0 + std::pow(lens.sigmaAt(depth), 2.0));
        // Every seventh is the soft edge of a shadow.
        if (i % 7 == 0) spread += 1.0 + random.uniformDouble();
        edge.spread_sigma = glm::dvec3(0.04 * spread);
        edge.spread = glm::dvec3(spread * (1.0 + 0.04 * random.normal()));
        edges.push_back(edge);
    }
    return edges;
}

TEST(CameraMatch, FocusWithinTenPercentOrUnknown)
{
    Image<float> depth_m;
    for (const double focus : {1.4, 2.0, 3.0}) {
        const DepthOfField lens{12.0, focus};
        const auto estimate = estimateFocus(edgesAtDepths(lens, depth_m), depth_m, 12.0);
        ASSERT_TRUE(estimate) << focus;
        EXPECT_NEAR(estimate->focus_m, focus, 0.1 * focus);
        const auto blur = blurInFocus(edgesAtDepths(lens, depth_m), depth_m, *estimate);
        ASSERT_TRUE(blur);
        EXPECT_NEAR(*blur, 0.7, 0.07);
    }
    // A phone's lens: everything is sharp.
    const DepthOfField phone{0.3, 2.0};
    EXPECT_FALSE(estimateFocus(edgesAtDepths(phone, depth_m), depth_m, 0.3));
    EXPECT_FALSE(estimateFocus({}, depth_m, 12.0));
    EXPECT_FALSE(estimateFocus(edgesAtDepths(phone, depth_m), Image<float>(kWidth, kHeight), 12.0));
}

TEST(CameraMatch, SharpnessThatDoesNotFollowDepthIsNoFocus)
{
    Image<float> depth_m;
    // Sharp throughout, whatever EXIF says of the aperture: a picture put together, or rendered.
    const std::vector<EdgeProfile> sharp = edgesAtDepths({0.0, 2.0}, depth_m);
    EXPECT_FALSE(estimateFocus(sharp, depth_m, 12.0));
    // The farther, the softer, and more than this lens can do: dark, and smoothed against noise.
    std::vector<EdgeProfile> smoothed = sharp;
    for (EdgeProfile& edge : smoothed)
        edge.spread *= 0.5 + 1.5 * edge.at.x / kWidth;
    const auto estimate = estimateFocus(smoothed, depth_m, 4.4);
    ASSERT_TRUE(estimate);
    EXPECT_GE(estimate->focus_m, 1.0) << "nearer than all that is seen";
}

/// A box 80 pixels wide on a floor, with a soft shadow to its right.
RenderLayers boxLayers()
{
    RenderLayers layers;
    layers.object = layers.probe_radiance = Image<Rgb>(kWidth, kHeight);
    layers.irradiance_without = layers.irradiance_with = Image<Rgb>(kWidth, kHeight, Rgb(3.0f));
    layers.alpha = layers.depth_m = layers.object_variance = layers.ratio_variance =
        Image<float>(kWidth, kHeight);
    for (int y = 100; y < 200; ++y)
        for (int x = 150; x < 300; ++x) {
            if (x < 230) {
                layers.alpha(x, y) = 1.0f;
                layers.object(x, y) = Rgb(0.05f);
                layers.depth_m(x, y) = 2.0f;
                layers.irradiance_without(x, y) = layers.irradiance_with(x, y) = Rgb(0.0f);
            } else {
                layers.irradiance_with(x, y) = Rgb(0.6f);
            }
        }
    return layers;
}

TEST(CameraMatch, BlurLeavesNoLightBetweenObjectAndItsShadow)
{
    const RenderLayers layers = boxLayers();
    CameraMatch match;
    match.blur_px = 1.5;
    const PhotoLayers soft = matchLayers(layers, match);
    // Across the contact every pixel's light is the shadow's, as far as it shows.
    for (int x = 222; x < 240; ++x) {
        if (soft.coverage(x, 150).g > 0.999f) continue;
        const float ratio = soft.irradiance_with(x, 150).g / soft.irradiance_without(x, 150).g;
        EXPECT_NEAR(ratio, 0.2f, 1e-5f) << x;
    }
    // Coverage and light are moved, not made.
    double before = 0.0;
    double after = 0.0;
    for (std::size_t i = 0; i < soft.coverage.pixelCount(); ++i) {
        before += layers.alpha.pixels()[i];
        after += soft.coverage.pixels()[i].g;
    }
    EXPECT_NEAR(after, before, 1e-4 * before);
    // Out of reach nothing changed.
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < 140; ++x) {
            ASSERT_EQ(soft.irradiance_with(x, y), layers.irradiance_with(x, y));
            ASSERT_EQ(soft.coverage(x, y), Rgb(0.0f));
        }
}

TEST(CameraMatch, DefaultChangesNothing)
{
    const RenderLayers layers = boxLayers();
    const PhotoLayers same = matchLayers(layers, {});
    EXPECT_EQ(same.object, layers.object);
    EXPECT_EQ(same.irradiance_with, layers.irradiance_with);
    EXPECT_EQ(same.coverage(200, 150), Rgb(1.0f));
}

TEST(CameraMatch, DefocusSpreadsTheObjectByItsDepth)
{
    RenderLayers layers = boxLayers();
    CameraMatch match;
    match.depth_of_field = DepthOfField{16.0, 4.0};  // at 2 m: 0.25 · 16 · 0.25 = 1 px
    const PhotoLayers soft = matchLayers(layers, match);
    // The edge of a half plane: its derivative has the blur's variance.
    double mean = 0.0;
    double square = 0.0;
    for (int x = 140; x < 160; ++x) {
        const double step = soft.coverage(x + 1, 150).g - soft.coverage(x, 150).g;
        mean += step * (x + 1);
        square += step * (x + 1) * (x + 1);
    }
    EXPECT_NEAR(square - mean * mean, 1.0, 0.03);
    match.depth_of_field->focus_m = 2.0;
    EXPECT_EQ(matchLayers(layers, match).object, layers.object);
}

TEST(CameraMatch, AberrationMovesRedAndBlueApart)
{
    CameraMatch match;
    match.centre_px = kCentre;
    match.magnification = {0.01, 0.0, -0.01};
    const PhotoLayers apart = matchLayers(boxLayers(), match);
    // The left edge, x = 150, lies 90 px left of the centre: 0.9 px outwards in red.
    const auto edge = [&](int c) {
        double at = 0.0;
        for (int x = 140; x < 160; ++x)
            at += double(apart.coverage(x + 1, 180)[c] - apart.coverage(x, 180)[c]) * (x + 1);
        return at;
    };
    EXPECT_NEAR(edge(1), 150.0, 1e-4);
    // Cubic interpolation overshoots beside a hard edge and is cut there.
    EXPECT_NEAR(edge(0), 149.1, 0.05);
    EXPECT_NEAR(edge(2), 150.9, 0.05);
    EXPECT_EQ(apart.irradiance_with(20, 20), Rgb(3.0f));
}

TEST(CameraMatch, CompositeHasThePhotographsGrainAndOptics)
{
    const SimulatedPhoto camera{0.003, 0.0020, false, 0};
    const EncodedImage photo = camera.take(Image<Rgb>(kWidth, kHeight, Rgb(0.30f)), 2);
    const ResponseCurve response = ResponseCurve::srgb();
    CameraMatchEstimate estimate = estimateCameraMatch(
        photo, response, photographedRadiance(photo, response, 1.0), {}, {kCentre, 0.0}, {});
    EXPECT_TRUE(hasFinding(estimate.findings, "camera-matched"));
    EXPECT_TRUE(hasFinding(estimate.findings, "blur-unknown"));
    RenderLayers layers = boxLayers();
    const Composite composite = compositeDifferential(photo,
                                                      response,
                                                      1.0,
                                                      matchLayers(layers, estimate.match),
                                                      {},
                                                      glm::dmat3(1.0),
                                                      estimate.match);
    const auto deviation = [&](int x0, int x1) {
        double mean = 0.0, square = 0.0, count = 0.0;
        for (int y = 110; y < 190; ++y)
            for (int x = x0; x < x1; ++x) {
                const double z = composite.image.codes(x, y).g;
                mean += z;
                square += z * z;
                count += 1.0;
            }
        return std::sqrt(square / count - mean * mean / (count * count));
    };
    // What the camera makes of the object's and the shadow's light by itself.
    const auto truth = [&](float level) {
        const EncodedImage flat = camera.take(Image<Rgb>(100, 100, Rgb(level)), 5);
        double mean = 0.0, square = 0.0;
        for (const auto& z : flat.codes.pixels()) {
            mean += z.g / 1e4;
            square += double(z.g) * z.g / 1e4;
        }
        return std::sqrt(square - mean * mean);
    };
    EXPECT_NEAR(deviation(155, 225), truth(0.05f), 0.1 * truth(0.05f));
    EXPECT_NEAR(deviation(235, 295), truth(0.06f), 0.1 * truth(0.06f));
    // Without it, the object is flat and the shadow too quiet.
    const Composite plain =
        compositeDifferential(photo, response, 1.0, matchLayers(layers, {}), {});
    for (int y = 110; y < 190; ++y)
        EXPECT_EQ(plain.image.codes(200, y), plain.image.codes(200, 110));
    // Pixels out of reach are the photograph's, and threads do not matter.
    for (int x = 0; x < 140; ++x)
        ASSERT_EQ(composite.image.codes(x, 150), photo.codes(x, 150));
    setThreadCount(1);
    const Composite alone = compositeDifferential(photo,
                                                  response,
                                                  1.0,
                                                  matchLayers(layers, estimate.match),
                                                  {},
                                                  glm::dmat3(1.0),
                                                  estimate.match);
    setThreadCount(0);
    EXPECT_EQ(alone.image.codes, composite.image.codes);
}

TEST(CameraMatch, DitherOnlyWhereChangedAndWithoutBias)
{
    const EncodedImage photo{Image<glm::u16vec3>(kWidth, kHeight, glm::u16vec3(149)), 255};
    RenderLayers layers = boxLayers();
    for (Rgb& value : layers.object.pixels())
        value *= 1.013f;  // between two codes
    CameraMatch match;
    match.dither = true;
    const ResponseCurve response = ResponseCurve::srgb();
    const Composite composite = compositeDifferential(
        photo, response, 1.0, matchLayers(layers, match), {}, glm::dmat3(1.0), match);
    double mean = 0.0;
    for (int y = 110; y < 190; ++y)
        for (int x = 155; x < 225; ++x)
            mean += composite.image.codes(x, y).g / (80.0 * 70.0);
    // 5600 pixels of at most half a code: a standard error below 0.007.
    EXPECT_NEAR(mean, response.encode(1, 0.05 * 1.013), 0.03);
    EXPECT_EQ(composite.image.codes(10, 10), glm::u16vec3(149));
}

TEST(CameraMatch, MixedFormKeepsTextureAndSmoothsNoise)
{
    // A bold weave on the left, noise alone on the right.
    const Image<Rgb> light = picture(kWidth, kHeight, [](double x, double y) {
        const bool dark = x < 260.0 && (static_cast<int>(x / 4) + static_cast<int>(y / 4)) % 2 == 0;
        return Rgb(dark ? 0.2f : 0.4f);
    });
    const SimulatedPhoto camera{0.004, 0.0020, false, 0};
    const EncodedImage photo = camera.take(light, 2);
    CameraMatch match;
    match.grain = estimateGrain(photo, ResponseCurve::srgb()).model;
    RenderLayers layers = boxLayers();
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            layers.alpha(x, y) = 0.0f;
            layers.object(x, y) = Rgb(0.0f);
            layers.irradiance_without(x, y) = Rgb(4.0f);
            layers.irradiance_with(x, y) = Rgb(2.0f);
        }
    const auto error = [&](CompositeForm form, int x0, int x1) {
        CompositeOptions options;
        options.form = form;
        const Composite composite = compositeDifferential(photo,
                                                          ResponseCurve::srgb(),
                                                          1.0,
                                                          matchLayers(layers, match),
                                                          options,
                                                          glm::dmat3(1.0),
                                                          match);
        // Of the change that was made against the true one, half of the light.
        const Image<Rgb> before = photographedRadiance(photo, ResponseCurve::srgb(), 1.0);
        double sum = 0.0, count = 0.0;
        for (int y = 20; y < kHeight - 20; ++y)
            for (int x = x0; x < x1; ++x) {
                const double e = composite.linear(x, y).g - before(x, y).g + 0.5 * light(x, y).g;
                sum += e * e;
                count += 1.0;
            }
        return std::sqrt(sum / count);
    };
    const double weave_ratio = error(CompositeForm::Ratio, 20, 240);
    const double weave_difference = error(CompositeForm::Difference, 20, 240);
    const double flat_ratio = error(CompositeForm::Ratio, 280, 460);
    const double flat_difference = error(CompositeForm::Difference, 280, 460);
    EXPECT_LT(weave_ratio, 0.5 * weave_difference);
    EXPECT_LT(flat_difference, 0.5 * flat_ratio);
    EXPECT_LT(error(CompositeForm::Mixed, 20, 240), 1.1 * weave_ratio);
    EXPECT_LT(error(CompositeForm::Mixed, 280, 460), 0.5 * flat_ratio);
}

TEST(CameraMatch, EveryPartCanBeLeftOut)
{
    CameraMatchOptions options;
    for (const std::string& part : kMatchParts)
        if (part != "all") leaveOut(part, options);
    const CameraMatchOptions none = options;
    EXPECT_FALSE(none.grain || none.blur || none.vignetting || none.chromatic_aberration ||
                 none.depth_of_field || none.dither);
    CameraMatchOptions at_once;
    leaveOut("all", at_once);
    EXPECT_FALSE(at_once.grain || at_once.blur || at_once.vignetting ||
                 at_once.chromatic_aberration || at_once.depth_of_field || at_once.dither);
    CameraMatchOptions one;
    leaveOut("blur", one);
    EXPECT_TRUE(!one.blur && one.grain && one.dither && one.chromatic_aberration);
    const EncodedImage photo = SimulatedPhoto{}.take(Image<Rgb>(kWidth, kHeight, Rgb(0.3f)), 2);
    const CameraMatchEstimate estimate =
        estimateCameraMatch(photo,
                            ResponseCurve::srgb(),
                            photographedRadiance(photo, ResponseCurve::srgb(), 1.0),
                            {},
                            {kCentre, 0.0},
                            none);
    EXPECT_TRUE(estimate.findings.empty());
    EXPECT_EQ(estimate.match.grain.sigmaAt(1, 128.0), 0.0);
}

TEST(CameraMatch, OptionsOutOfRangeAreRefused)
{
    for (const double focus : {0.0, -1.0, std::nan("")}) {
        CameraMatchOptions options;
        options.focus_m = focus;
        EXPECT_FALSE(options.validate().empty());
    }
}

}  // namespace
}  // namespace insitu
