#include "composite/match/layer_blur.h"

#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace insitu {
namespace {

constexpr int kWidth = 41;
constexpr int kHeight = 83;  // more than one strip of rows

PhotoLayers emptyLayers()
{
    PhotoLayers layers;
    layers.object = layers.coverage = layers.probe_radiance = Image<Rgb>(kWidth, kHeight);
    layers.irradiance_without = layers.irradiance_with = Image<Rgb>(kWidth, kHeight, Rgb(1.0f));
    layers.object_variance = layers.depth_m = Image<float>(kWidth, kHeight);
    return layers;
}

LayerBlur uniformBlur(float sigma)
{
    return {Image<float>(kWidth, kHeight, sigma), Image<float>(kWidth, kHeight, sigma), sigma};
}

TEST(BlurTaps, KeepSumAndVariance)
{
    for (double sigma = 0.0; sigma <= 10.0; sigma += 0.07) {
        const BlurTaps taps(sigma);
        double sum = taps.weight[0];
        double variance = 0.0;
        for (int i = 1; i <= taps.reach; ++i) {
            sum += 2.0 * taps.weight[static_cast<std::size_t>(i)];
            variance += 2.0 * i * i * taps.weight[static_cast<std::size_t>(i)];
        }
        EXPECT_NEAR(sum, 1.0, tolerance::kFloat);
        // Cut at three deviations a Gaussian loses 2.7 % of its variance.
        EXPECT_NEAR(variance, sigma * sigma, 0.03 * sigma * sigma + 1e-12);
    }
}

/// An object with holes over a lit floor, all at random.
PhotoLayers randomLayers()
{
    RandomStream random(31, 0, 0);
    PhotoLayers layers = emptyLayers();
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const auto number = [&] { return static_cast<float>(random.uniformDouble()); };
            layers.irradiance_without(x, y) = Rgb(1.0f + number(), 2.0f, 1.0f + number());
            layers.irradiance_with(x, y) =
                (0.2f + 0.7f * number()) * layers.irradiance_without(x, y);
            if (number() < 0.4f) continue;
            const float alpha = number() < 0.5f ? 1.0f : number();
            layers.coverage(x, y) = Rgb(alpha, alpha, alpha);
            layers.object(x, y) = alpha * Rgb(number(), number(), 3.0f);
            layers.object_variance(x, y) = number();
            layers.depth_m(x, y) = 1.0f + number();
        }
    return layers;
}

// One sum over both directions at once; receivers by how much of each is seen.
TEST(BlurLayers, OfOneDeviationIsTheConvolution)
{
    const PhotoLayers sharp = randomLayers();
    PhotoLayers blurred = sharp;
    blurLayers(uniformBlur(1.25f), blurred);
    const BlurTaps taps(1.25);
    const auto nearly = [](float a, double b) {
        EXPECT_NEAR(a, b, tolerance::kFloat * std::max(1.0, std::abs(b)));
    };
    for (const auto& [x, y] : {std::pair(0, 0), std::pair(20, 41), std::pair(40, 64)}) {
        glm::dvec3 object(0.0), without(0.0), with(0.0);
        double coverage = 0.0, variance = 0.0, depth = 0.0, seen = 0.0;
        for (int dy = -taps.reach; dy <= taps.reach; ++dy)
            for (int dx = -taps.reach; dx <= taps.reach; ++dx) {
                const int sx = std::clamp(x + dx, 0, kWidth - 1);
                const int sy = std::clamp(y + dy, 0, kHeight - 1);
                const double w =
                    static_cast<double>(taps.weight[static_cast<std::size_t>(std::abs(dx))]) *
                    static_cast<double>(taps.weight[static_cast<std::size_t>(std::abs(dy))]);
                const double alpha = sharp.coverage(sx, sy).g;
                object += w * glm::dvec3(sharp.object(sx, sy));
                coverage += w * alpha;
                variance += w * w * sharp.object_variance(sx, sy);
                depth += w * alpha * sharp.depth_m(sx, sy);
                without += w * (1.0 - alpha) * glm::dvec3(sharp.irradiance_without(sx, sy));
                with += w * (1.0 - alpha) * glm::dvec3(sharp.irradiance_with(sx, sy));
                seen += w * (1.0 - alpha);
            }
        SCOPED_TRACE(::testing::Message() << x << " " << y);
        nearly(blurred.object(x, y).r, object.r);
        nearly(blurred.object(x, y).b, object.b);
        nearly(blurred.coverage(x, y).g, coverage);
        nearly(blurred.object_variance(x, y), variance);
        nearly(blurred.depth_m(x, y), depth / coverage);
        nearly(blurred.irradiance_without(x, y).r, without.r / seen);
        nearly(blurred.irradiance_with(x, y).b, with.b / seen);
    }
}

// Two points of an object at different depths spread by their own blurs, alike in both directions.
TEST(BlurLayers, EveryPointOfAnObjectSpreadsByItsOwn)
{
    PhotoLayers layers = emptyLayers();
    LayerBlur blur = uniformBlur(0.0f);
    const glm::ivec2 places[2] = {{10, 20}, {28, 60}};
    const float sigmas[2] = {1.0f, 3.0f};
    blur.max_sigma_px = 3.0f;
    for (int i = 0; i < 2; ++i) {
        layers.object(places[i].x, places[i].y) = Rgb(1.0f);
        layers.coverage(places[i].x, places[i].y) = Rgb(1.0f);
        blur.object_sigma_px(places[i].x, places[i].y) = sigmas[i];
    }
    blurLayers(blur, layers);
    for (int i = 0; i < 2; ++i) {
        double sum = 0.0;
        glm::dvec2 square(0.0);
        for (int y = places[i].y - 12; y <= places[i].y + 12; ++y)
            for (int x = places[i].x - 10; x <= places[i].x + 10; ++x) {
                const double w = layers.object(x, y).g;
                const glm::dvec2 off(x - places[i].x, y - places[i].y);
                sum += w;
                square += w * off * off;
            }
        EXPECT_NEAR(sum, 1.0, tolerance::kFloat);
        // Cut at three deviations a Gaussian loses 2.7 % of its variance.
        const double variance = sigmas[i] * sigmas[i];
        EXPECT_NEAR(square.x, variance, 0.03 * variance);
        EXPECT_NEAR(square.y, variance, 0.03 * variance);
    }
}

TEST(BlurLayers, LeavesAloneWhatNoObjectReaches)
{
    PhotoLayers layers = randomLayers();
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < kWidth; ++x) {
            layers.object(x, y) = layers.coverage(x, y) = Rgb(0.0f);
            // Rounding of a light that the objects do not change.
            layers.irradiance_with(x, y) = layers.irradiance_without(x, y) * (1.0f - 1e-6f);
        }
    const PhotoLayers sharp = layers;
    blurLayers(uniformBlur(2.0f), layers);
    for (int y = 0; y < 40 - 6; ++y)
        for (int x = 0; x < kWidth; ++x) {
            ASSERT_EQ(layers.irradiance_with(x, y), sharp.irradiance_with(x, y)) << x << " " << y;
            ASSERT_EQ(layers.irradiance_without(x, y), sharp.irradiance_without(x, y));
        }
}

}  // namespace
}  // namespace insitu
