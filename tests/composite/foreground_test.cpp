#include "composite/foreground.h"

#include "composite/differential.h"
#include "core/random.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/ximgproc.hpp>

#include <cmath>
#include <functional>

namespace insitu {
namespace {

constexpr int kWidth = 120;
constexpr int kHeight = 80;

/// A disc before a wall: exact coverage by sampling, colours that vary a little.
struct DiscScene {
    glm::dvec2 center{61.3, 40.8};
    double radius = 22.4;
    Image<float> coverage{kWidth, kHeight};
    Image<Rgb> before{kWidth, kHeight};  ///< the photograph, linear
    EncodedImage photo;

    static Rgb wall(int x, int y)
    {
        return Rgb(0.30f, 0.26f, 0.22f) * (1.0f + 0.1f * std::sin(0.05f * float(x + 2 * y)));
    }
    static Rgb disc(int x, int y)
    {
        return Rgb(0.05f, 0.12f, 0.06f) * (1.0f + 0.1f * std::cos(0.07f * float(2 * x - y)));
    }
    DiscScene()
    {
        constexpr int kSub = 16;
        photo.codes = Image<glm::u16vec3>(kWidth, kHeight);
        photo.max_code = 65535;
        const ResponseCurve response = ResponseCurve::srgb();
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x) {
                int inside = 0;
                for (int k = 0; k < kSub * kSub; ++k)
                    inside += glm::distance(center,
                                            {x + (k % kSub + 0.5) / kSub,
                                             y + (k / kSub + 0.5) / kSub}) < radius;
                const float m = static_cast<float>(inside) / (kSub * kSub);
                coverage(x, y) = m;
                before(x, y) = m * disc(x, y) + (1.0f - m) * wall(x, y);
                for (int c = 0; c < 3; ++c)
                    photo.codes(x, y)[c] = static_cast<std::uint16_t>(
                        std::lround(response.encode(c, before(x, y)[c]) * 257.0));
            }
    }
    [[nodiscard]] std::vector<glm::dvec2> outline(double offset, double wobble) const
    {
        std::vector<glm::dvec2> corners;
        RandomStream random(3, 0, 0);
        for (int i = 0; i < 60; ++i) {
            const double angle = 2 * 3.14159265358979 * i / 60;
            const double r = radius + offset + wobble * (2.0 * random.uniformDouble() - 1.0);
            corners.push_back(center + r * glm::dvec2(std::cos(angle), std::sin(angle)));
        }
        return corners;
    }
};

double meanError(const Image<float>& a, const Image<float>& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.pixelCount(); ++i)
        sum += std::abs(static_cast<double>(a.pixels()[i] - b.pixels()[i]));
    return sum;
}

TEST(Foreground, PolygonsCoverTheirArea)
{
    EncodedImage photo;
    photo.codes = Image<glm::u16vec3>(20, 10);
    ForegroundMark mark;
    mark.feather_px = 0.0;
    mark.polygon_px = {{2.25, 1.5}, {10.0, 1.5}, {10.0, 6.0}, {2.25, 6.0}};
    const Image<float> box = foregroundCoverage(mark, photo);
    EXPECT_NEAR(box(2, 1), 0.75 * 0.5, tolerance::kFloat);
    EXPECT_EQ(box(5, 3), 1.0f);
    EXPECT_EQ(box(10, 3), 0.0f);
    double area = 0.0;
    for (const float value : box.pixels())
        area += static_cast<double>(value);
    EXPECT_NEAR(area, 7.75 * 4.5, 1e-4);
    // Beyond the picture's border it is cut off.
    mark.polygon_px = {{-5, -5}, {5, -5}, {5, 50}, {-5, 50}};
    EXPECT_EQ(foregroundCoverage(mark, photo)(4, 9), 1.0f);
}

TEST(Foreground, FeatherBlursAndLeavesTheRest)
{
    const DiscScene scene;
    ForegroundMark mark;
    mark.polygon_px = scene.outline(0.0, 0.0);
    mark.feather_px = 2.0;
    const Image<float> soft = foregroundCoverage(mark, scene.photo);
    EXPECT_EQ(soft(61, 40), 1.0f);
    EXPECT_EQ(soft(3, 3), 0.0f);
    EXPECT_NEAR(soft(int(scene.center.x + scene.radius), 40), 0.5, 0.12);
}

TEST(Foreground, TheEdgeMovesToThePicturesEdge)
{
    const DiscScene scene;
    for (const double offset : {-2.5, 2.5}) {
        ForegroundMark mark;
        mark.feather_px = 0.0;
        mark.polygon_px = scene.outline(offset, 1.5);
        const double drawn = meanError(foregroundCoverage(mark, scene.photo), scene.coverage);
        mark.refine_px = 8;
        const Image<float> better = foregroundCoverage(mark, scene.photo);
        EXPECT_LT(meanError(better, scene.coverage), 0.35 * drawn) << offset;
        EXPECT_EQ(better(61, 40), 1.0f);
        EXPECT_EQ(better(10, 70), 0.0f);
    }
}

TEST(Foreground, TheGuidedFilterIsOpenCVs)
{
    const DiscScene scene;
    Image<float> input(kWidth, kHeight);
    RandomStream random(5, 0, 0);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
            input(x, y) = x > 60 ? 1.0f : 0.2f * random.uniform();
    const Image<float> ours = guidedFilter(scene.before, input, 6, 1e-2);
    cv::Mat guide(kHeight, kWidth, CV_32FC3);
    cv::Mat source(kHeight, kWidth, CV_32F);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const Rgb g = scene.before(x, y);
            guide.at<cv::Vec3f>(y, x) = {g.r, g.g, g.b};
            source.at<float>(y, x) = input(x, y);
        }
    cv::Mat theirs;
    cv::ximgproc::guidedFilter(guide, source, theirs, 6, 1e-2);
    // The border is treated differently: twice the radius of it is left out.
    for (int y = 13; y < kHeight - 13; ++y)
        for (int x = 13; x < kWidth - 13; ++x)
            // Theirs is computed in float, where variances keep three digits.
            ASSERT_NEAR(ours(x, y), theirs.at<float>(y, x), 1e-3) << x << " " << y;
}

/// Layers with an object of one colour over the right half, a shadow of half the light left of it.
RenderLayers halfObject(Rgb color)
{
    RenderLayers layers;
    layers.object = layers.irradiance_without = layers.irradiance_with = layers.probe_radiance =
        Image<Rgb>(kWidth, kHeight);
    layers.alpha = layers.depth_m = layers.object_variance = layers.ratio_variance =
        Image<float>(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            layers.irradiance_without(x, y) = Rgb(1.0f);
            layers.irradiance_with(x, y) = Rgb(x >= 40 && x < 60 ? 0.5f : 1.0f);
            if (x < 60) continue;
            layers.object(x, y) = color;
            layers.alpha(x, y) = 1.0f;
            layers.depth_m(x, y) = 3.0f;
        }
    return layers;
}

TEST(Foreground, ObjectsAndShadowsAreCompositedUnderIt)
{
    const DiscScene scene;
    const Rgb color(0.4f, 0.1f, 0.3f);
    PhotoLayers layers = matchLayers(halfObject(color), {});
    putBehindForeground(scene.coverage, std::nullopt, scene.before, layers);
    const Composite composite =
        compositeDifferential(scene.photo, ResponseCurve::srgb(), 1.0, layers, CompositeOptions{});
    double worst = 0.0;
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const float m = scene.coverage(x, y);
            const Rgb behind = x >= 60   ? color
                               : x >= 40 ? 0.5f * DiscScene::wall(x, y)
                                         : DiscScene::wall(x, y);
            const Rgb truth = m * DiscScene::disc(x, y) + (1.0f - m) * behind;
            for (int c = 0; c < 3; ++c)
                worst = std::max(
                    worst, std::abs(static_cast<double>(composite.linear(x, y)[c] - truth[c])));
            // What is all foreground stays byte for byte, and so does what nothing changes.
            if (m == 1.0f || (x < 40)) {
                EXPECT_EQ(composite.image.codes(x, y), scene.photo.codes(x, y)) << x << " " << y;
                EXPECT_EQ(composite.influence(x, y), 0);
            }
        }
    // The wall behind the disc's edge is taken from beside it: within its own variation. Without
    // it the edge would be up to 0.06 off.
    EXPECT_LT(worst, 0.015);
}

TEST(Foreground, ASofterMarkThanThePictureLeavesNoDarkSeam)
{
    // A sharp dark thing before a bright wall, marked with a soft edge: the wall that the mark
    // takes out of dark pixels is not in them.
    const Rgb dark(0.02f, 0.05f, 0.02f);
    const Rgb wall(0.6f, 0.5f, 0.4f);
    const Rgb color(0.3f, 0.1f, 0.1f);
    Image<Rgb> seen(kWidth, kHeight);
    EncodedImage photo;
    photo.codes = Image<glm::u16vec3>(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            seen(x, y) = x < 80 ? dark : wall;
            for (int c = 0; c < 3; ++c)
                photo.codes(x, y)[c] = static_cast<std::uint16_t>(
                    255.0 * std::pow(static_cast<double>(seen(x, y)[c]), 1.0 / 2.2));
        }
    ForegroundMark mark;
    mark.polygon_px = {{0, 0}, {80, 0}, {80, kHeight}, {0, kHeight}};
    mark.feather_px = 1.2;
    const auto composed = [&](int refine_px) {
        mark.refine_px = refine_px;
        PhotoLayers layers = matchLayers(halfObject(color), {});
        putBehindForeground(foregroundCoverage(mark, photo), std::nullopt, seen, layers);
        Image<Rgb> result(kWidth, kHeight);
        for (std::size_t i = 0; i < result.pixelCount(); ++i)
            result.pixels()[i] =
                layers.object.pixels()[i] + (1.0f - layers.coverage.pixels()[i]) * seen.pixels()[i];
        return result;
    };
    const Image<Rgb> soft = composed(0);
    const Image<Rgb> refined = composed(4);
    for (int x = 60; x < kWidth; ++x)
        for (int c = 0; c < 3; ++c) {
            // Light is left of the dark where the mark says that half of it is wall.
            EXPECT_GE(soft(x, 40)[c], 0.4f * dark[c]) << x;
            // The picture's edge, but for an eighth of the wall that a guided filter of radius 2
            // leaves.
            EXPECT_NEAR(refined(x, 40)[c], (x < 80 ? dark : color)[c], 0.06) << x;
        }
}

TEST(Foreground, TheCamerasBlurDoesNotReachOverIt)
{
    // The disc's edge is the photograph's own; an object behind it is blurred before it is hidden.
    const DiscScene scene;
    CameraMatch match;
    match.blur_px = 1.5;
    const RenderLayers sharp = halfObject(Rgb(0.4f, 0.1f, 0.3f));
    PhotoLayers layers = matchLayers(sharp, match);
    EXPECT_GT(layers.coverage(58, 5).g, 0.0f) << "the object's own edge is soft";
    putBehindForeground(scene.coverage, std::nullopt, scene.before, layers);
    const Composite composite = compositeDifferential(
        scene.photo, ResponseCurve::srgb(), 1.0, layers, {}, glm::dmat3(1.0), match);
    int covered = 0;
    for (int y = 0; y < kHeight; ++y)
        for (int x = 60; x < kWidth; ++x) {
            if (scene.coverage(x, y) < 1.0f) continue;
            ++covered;
            ASSERT_EQ(composite.image.codes(x, y), scene.photo.codes(x, y)) << x << " " << y;
        }
    EXPECT_GT(covered, 100);
}

TEST(Foreground, WhatIsNearerStaysBefore)
{
    const DiscScene scene;
    const PhotoLayers untouched = matchLayers(halfObject(Rgb(0.4f)), {});
    PhotoLayers layers = untouched;
    putBehindForeground(scene.coverage, 4.0, scene.before, layers);  // the object is at 3 m
    EXPECT_EQ(layers.coverage, untouched.coverage);
    EXPECT_EQ(layers.object(70, 40), untouched.object(70, 40));
    EXPECT_EQ(layers.irradiance_with(50, 40), Rgb(1.0f));  // the disc itself is not shadowed
    putBehindForeground(scene.coverage, 2.0, scene.before, layers);
    EXPECT_EQ(layers.coverage(70, 40), Rgb(0.0f));
}

TEST(Foreground, OptionsAreChecked)
{
    const DiscScene scene;
    const auto complaint = [&](const std::function<void(ForegroundMark&)>& change) {
        ForegroundMark mark;
        mark.polygon_px = scene.outline(0, 0);
        change(mark);
        return inputErrorOf([&] { (void)foregroundCoverage(mark, scene.photo); });
    };
    using testing::HasSubstr;
    EXPECT_THAT(complaint([](auto& m) { m.feather_px = -1; }), HasSubstr("feather_px"));
    EXPECT_THAT(complaint([](auto& m) { m.refine_px = 300; }), HasSubstr("refine_px"));
    EXPECT_THAT(complaint([](auto& m) { m.distance_m = 0.0; }), HasSubstr("distance_m"));
    EXPECT_THAT(complaint([](auto& m) { m.polygon_px.resize(2); }), HasSubstr("three corners"));
    EXPECT_THAT(complaint([](auto& m) { m.polygon_px.clear(); }), HasSubstr("polygon or a mask"));
    EXPECT_THAT(complaint([](auto& m) {
                    m.polygon_px.clear();
                    m.mask = Image<float>(3, 3, 1.0f);
                }),
                HasSubstr("the mask is 3x3"));
}

}  // namespace
}  // namespace insitu
