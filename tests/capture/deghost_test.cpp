#include "capture/deghost.h"

#include "capture/alignment.h"
#include "capture/hdr_merge.h"
#include "core/check.h"
#include "core/parallel.h"
#include "tests/capture/handheld_scene.h"
#include "tests/support/tolerance.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace insitu {
namespace {

constexpr int kWidth = 300;
constexpr int kHeight = 200;
/// Of the pixels of a bracket in which nothing moved.
constexpr double kFalseAlarms = 1e-3;

/// Where something stands in frame k: true inside.
using Silhouette = std::function<bool(int k, double x, double y)>;

/// A disc that crosses the picture.
bool crossingDisc(int k, double x, double y)
{
    return std::hypot(x - (40.0 + 52.0 * k), y - (70.0 + 18.0 * k)) < 20.0;
}

/// Head, body and two legs of a person who walks by.
bool walkingPerson(int k, double x, double y)
{
    const double u = x - (35.0 + 55.0 * k);
    if (std::hypot(u, y - 60.0) < 10.0) return true;
    if (std::abs(u) < 14.0 && y >= 68.0 && y < 130.0) return true;
    return std::abs(std::abs(u) - 8.0) < 4.5 && y >= 130.0 && y < 185.0;
}

struct Captured {
    Bracket bracket;
    Image<Rgb> truth;  ///< of the empty scene
    ResponseCurve response;
};

std::vector<double> exposures(int count, double ev_step)
{
    std::vector<double> seconds;
    for (int k = 0; k < count; ++k)
        seconds.push_back(4.0 * std::exp2(-ev_step * (k - count / 2)));
    return seconds;
}

/// A scene through which something of the given radiance moves.
Captured capture(int count, double ev_step, std::uint64_t seed, const Silhouette& moving, Rgb color)
{
    Captured result;
    result.truth = viewOf(RectangleScene(kWidth, kHeight, seed), kWidth, kHeight, glm::dmat3(1.0));
    SyntheticCamera camera = contrastyCamera(seed);
    result.response = tableOf(camera);
    const std::vector<double> seconds = exposures(count, ev_step);
    std::vector<BracketFrame> frames;
    for (int k = 0; k < count; ++k) {
        Image<Rgb> view = result.truth;
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x)
                if (moving && moving(k, x + 0.5, y + 0.5)) view(x, y) = color;
        camera.seed += 1000;
        frames.push_back(
            photograph(view, {seconds[static_cast<std::size_t>(k)]}, camera).frames.front());
        frames.back().name = fmt::format("frame_{}", k);
    }
    result.bracket = makeBracket(std::move(frames));
    return result;
}

double share(const std::vector<Image<std::uint8_t>>& masks)
{
    std::size_t any = 0;
    for (std::size_t i = 0; i < masks.front().pixelCount(); ++i)
        any += std::ranges::any_of(masks, [&](const auto& mask) { return mask.pixels()[i] != 0; });
    return static_cast<double>(any) / static_cast<double>(masks.front().pixelCount());
}

/// The plainest merge there is: hats about the middle of the codes times the exposure. With masks
/// or without.
Image<Rgb> mergePlainly(const Bracket& bracket,
                        const ResponseCurve& response,
                        const std::vector<Image<std::uint8_t>>& masks)
{
    Image<Rgb> result(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            for (int c = 0; c < 3; ++c) {
                double sum = 0.0;
                double weights = 0.0;
                for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
                    if (!masks.empty() && masks[k](x, y) != 0) continue;
                    const glm::u16vec3 codes = bracket.frames[k].image.codes(x, y);
                    const double code = codes[c];
                    const double hat = std::max(1e-6, 1.0 - std::abs(code - 127.5) / 127.5);
                    const double weight = std::max({codes.r, codes.g, codes.b}) > 248
                                              ? 1e-9
                                              : hat * bracket.frames[k].relative_exposure;
                    sum += weight * response.decode(c, code) / bracket.frames[k].relative_exposure;
                    weights += weight;
                }
                result(x, y)[c] = static_cast<float>(sum / weights);
            }
        }
    }
    return result;
}

/// Root mean square of the relative error of green where something was in any frame.
double leak(const Image<Rgb>& merged, const Image<Rgb>& truth, int count, const Silhouette& moving)
{
    double squares = 0.0;
    int pixels = 0;
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            bool touched = false;
            for (int k = 0; k < count; ++k)
                touched = touched || moving(k, x + 0.5, y + 0.5);
            if (!touched) continue;
            const double error =
                std::min(std::abs(merged(x, y).g / static_cast<double>(truth(x, y).g) - 1.0), 10.0);
            squares += error * error;
            ++pixels;
        }
    }
    return std::sqrt(squares / pixels);
}

TEST(Deghost, NothingIsFoundWhereNothingMoved)
{
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        for (const double ev_step : {1.0, 2.0, 3.0}) {
            const Captured still = capture(5, ev_step, seed, nullptr, Rgb(0.0f));
            const MovedPixels moved = findMovedPixels(still.bracket, still.response);
            EXPECT_LT(share(moved.masks), kFalseAlarms) << seed << " " << ev_step;
        }
    }
}

TEST(Deghost, NothingIsFoundInAHandHeldBracketOnceAligned)
{
    const std::vector<glm::dmat3> places{rigidMotion(kWidth, kHeight, {5.3, -2.6}, 0.004),
                                         glm::dmat3(1.0),
                                         rigidMotion(kWidth, kHeight, {-3.7, 4.4}, -0.006)};
    const SyntheticCamera camera = contrastyCamera(4);
    const Bracket bracket = photographHandheld(
        RectangleScene(kWidth, kHeight, 4), kWidth, kHeight, places, exposures(3, 2.0), camera);
    const Bracket aligned = applyAlignment(bracket, alignBracket(bracket));
    const ResponseCurve response = tableOf(camera);
    // Resampled outlines are blurred differently: ten times what a tripod's bracket may show.
    EXPECT_LT(share(findMovedPixels(aligned, response).masks), 10.0 * kFalseAlarms);
    EXPECT_GT(share(findMovedPixels(bracket, response).masks), 0.1) << "this test sees nothing";
}

struct Passer {
    const char* name;
    Silhouette silhouette;
    Rgb color;
    int count;
    double ev_step;
    std::uint64_t seed;
    double most_added = 0.35;  ///< share of the leak that may stay
};

class SomethingMoves : public testing::TestWithParam<Passer> {};

TEST_P(SomethingMoves, DoesNotLeakIntoTheRadiance)
{
    const Passer& passer = GetParam();
    const Captured scene =
        capture(passer.count, passer.ev_step, passer.seed, passer.silhouette, passer.color);
    const MovedPixels moved = findMovedPixels(scene.bracket, scene.response);
    const Captured still = capture(passer.count, passer.ev_step, passer.seed, nullptr, Rgb(0.0f));
    const auto leakOf = [&](const Bracket& bracket, const std::vector<Image<std::uint8_t>>& masks) {
        return leak(mergePlainly(bracket, scene.response, masks),
                    scene.truth,
                    passer.count,
                    passer.silhouette);
    };
    const double best = leakOf(still.bracket, {});
    const double with = leakOf(scene.bracket, moved.masks);
    const double without = leakOf(scene.bracket, {});
    SCOPED_TRACE(fmt::format(
        "leak {:.3f} without masks, {:.3f} with, {:.3f} when nothing moves", without, with, best));
    // What moved adds to the noise that is there anyway, in squares.
    const auto added = [&](double error) {
        return std::sqrt(std::max(error * error - best * best, 0.0));
    };
    EXPECT_LT(added(with), passer.most_added * added(without));
    EXPECT_LT(with, best + 0.05);
    EXPECT_TRUE(hasFinding(moved.findings, "bracket-ghosts-removed"));
    EXPECT_NEAR(moved.moved_fraction, share(moved.masks), tolerance::kDouble);
}

INSTANTIATE_TEST_SUITE_P(
    Deghost,
    SomethingMoves,
    testing::Values(Passer{"disc", crossingDisc, Rgb(0.3f, 0.25f, 0.2f), 5, 2.0, 5},
                    // Half of its places are before a wall nearly as dark: within noise.
                    Passer{"dark disc", crossingDisc, Rgb(0.001f), 5, 1.5, 6, 0.6},
                    Passer{"person", walkingPerson, Rgb(0.12f, 0.05f, 0.03f), 5, 1.5, 7},
                    Passer{"dark person", walkingPerson, Rgb(0.002f), 3, 2.0, 8}),
    [](const auto& passer) {
        std::string name = passer.param.name;
        std::ranges::replace(name, ' ', '_');
        return name;
    });

TEST(Deghost, TheMasksHoldWhatMoved)
{
    const Captured scene = capture(5, 1.5, 7, walkingPerson, Rgb(0.12f, 0.05f, 0.03f));
    const Captured still = capture(5, 1.5, 7, nullptr, Rgb(0.0f));
    const MovedPixels moved = findMovedPixels(scene.bracket, scene.response);
    // Who stands before a wall that looks the same in this frame cannot be seen, and does no harm.
    const auto differs = [&](std::size_t k, int x, int y) {
        const glm::ivec3 a(scene.bracket.frames[k].image.codes(x, y));
        const glm::ivec3 b(still.bracket.frames[k].image.codes(x, y));
        return std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)}) > 30;
    };
    for (int k = 0; k < 5; ++k) {
        int inside = 0;
        int visible = 0;
        int found = 0;
        int outside = 0;
        for (int y = 0; y < kHeight; ++y) {
            for (int x = 0; x < kWidth; ++x) {
                const bool masked = moved.masks[static_cast<std::size_t>(k)](x, y) != 0;
                const bool person = walkingPerson(k, x + 0.5, y + 0.5);
                inside += person ? 1 : 0;
                const bool seen = person && differs(static_cast<std::size_t>(k), x, y);
                visible += seen ? 1 : 0;
                found += seen && masked ? 1 : 0;
                outside += !person && masked ? 1 : 0;
            }
        }
        // The longest exposure, nearly white here, is held against the believed one's noise, eight
        // times amplified: only part of the person stands out.
        EXPECT_GT(found, (k == 0 ? 0.05 : 0.9) * visible) << "frame " << k;
        EXPECT_LT(outside, 0.8 * inside) << "frame " << k;
    }
}

TEST(Deghost, WhatHidesALampInTheShortestFrameIsFound)
{
    // A lamp that clips the best exposed frame; in the shortest one something stands before it.
    const Silhouette hand = [](int k, double x, double y) {
        return k == 4 && std::abs(x - 150.0) < 15.0 && std::abs(y - 100.0) < 15.0;
    };
    Captured scene = capture(5, 1.5, 9, nullptr, Rgb(0.0f));
    Image<Rgb> lit = scene.truth;
    for (int y = 75; y < 125; ++y)
        for (int x = 120; x < 180; ++x)
            lit(x, y) = Rgb(1.4f);
    SyntheticCamera camera = contrastyCamera(9);
    std::vector<BracketFrame> frames;
    for (int k = 0; k < 5; ++k) {
        Image<Rgb> view = lit;
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x)
                if (hand(k, x + 0.5, y + 0.5)) view(x, y) = Rgb(0.05f);
        camera.seed += 1000;
        frames.push_back(photograph(view, {exposures(5, 1.5)[static_cast<std::size_t>(k)]}, camera)
                             .frames.front());
    }
    const MovedPixels moved = findMovedPixels(makeBracket(std::move(frames)), scene.response);
    EXPECT_EQ(moved.masks[4](150, 100), 1);
    EXPECT_EQ(moved.masks[3](150, 100), 0);
}

TEST(Deghost, ExcludedPixelsAreNotCompared)
{
    Captured scene = capture(3, 2.0, 10, nullptr, Rgb(0.0f));
    BracketFrame& frame = scene.bracket.frames[2];
    frame.excluded = Image<std::uint8_t>(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < 60; ++x) {
            frame.excluded(x, y) = 1;
            frame.image.codes(x, y) = glm::u16vec3(255);
        }
    }
    EXPECT_LT(share(findMovedPixels(scene.bracket, scene.response).masks), kFalseAlarms);
}

TEST(Deghost, OneFrameHasNothingToCompare)
{
    const Captured scene = capture(1, 2.0, 10, nullptr, Rgb(0.0f));
    const MovedPixels moved = findMovedPixels(scene.bracket, scene.response);
    ASSERT_EQ(moved.masks.size(), 1u);
    EXPECT_EQ(share(moved.masks), 0.0);
    EXPECT_TRUE(moved.findings.empty());
}

TEST(Deghost, OneThreadGivesTheSameAsMany)
{
    const Captured scene = capture(5, 1.5, 7, walkingPerson, Rgb(0.12f, 0.05f, 0.03f));
    setThreadCount(1);
    const MovedPixels one = findMovedPixels(scene.bracket, scene.response);
    setThreadCount(4);
    const MovedPixels many = findMovedPixels(scene.bracket, scene.response);
    setThreadCount(0);
    EXPECT_EQ(one.masks, many.masks);
}

TEST(Deghost, OptionsThatMakeNoSenseAreRefused)
{
    const Captured scene = capture(2, 2.0, 11, nullptr, Rgb(0.0f));
    const auto expectRefused = [&](const DeghostOptions& options) {
        EXPECT_TRUE(hasFinding(options.validate(), "deghost-options"));
        EXPECT_THROW((void)findMovedPixels(scene.bracket, scene.response, options), InputError);
    };
    DeghostOptions options;
    options.sigmas = 0.0;
    expectRefused(options);
    options = {};
    options.tolerance = 1.0;
    expectRefused(options);
    options = {};
    options.tolerance = std::nan("");
    expectRefused(options);
    options = {};
    options.min_region_px = 0;
    expectRefused(options);
    options = {};
    options.grow_px = -1;
    expectRefused(options);
}

}  // namespace
}  // namespace insitu
