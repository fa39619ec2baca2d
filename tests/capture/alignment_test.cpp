#include "capture/alignment.h"

#include "core/check.h"
#include "core/io/image_io.h"
#include "core/parallel.h"
#include "tests/capture/handheld_scene.h"
#include "tests/support/data.h"
#include "tests/support/tolerance.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

namespace insitu {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr int kWidth = 384;
constexpr int kHeight = 256;

/// Asked of every synthetic bracket: what a bracket's frames may be apart, at the worst corner.
constexpr double kCornerPx = 0.1;
constexpr double kRotationDegrees = 0.01;

std::vector<double> exposures(int count, double ev_step, double middle = 4.0)
{
    std::vector<double> seconds;
    for (int k = 0; k < count; ++k)
        seconds.push_back(middle * std::exp2(-ev_step * (k - count / 2)));
    return seconds;
}

glm::dmat3 rigid(double x, double y, double degrees, int width = kWidth, int height = kHeight)
{
    return rigidMotion(width, height, {x, y}, degrees * kDegree);
}

double rotationDegrees(const glm::dmat3& m)
{
    return std::atan2(m[0].y, m[0].x) / kDegree;
}

Bracket handheld(const std::vector<glm::dmat3>& places,
                 double ev_step,
                 std::uint64_t seed,
                 int width = kWidth,
                 int height = kHeight)
{
    return photographHandheld(RectangleScene(width, height, seed),
                              width,
                              height,
                              places,
                              exposures(static_cast<int>(places.size()), ev_step),
                              contrastyCamera(seed));
}

AlignmentOptions onto(int reference)
{
    AlignmentOptions options;
    options.reference = reference;
    return options;
}

void expectPlaces(const Alignment& alignment,
                  const std::vector<glm::dmat3>& truth,
                  int width = kWidth,
                  int height = kHeight)
{
    ASSERT_EQ(alignment.frame_from_reference.size(), truth.size());
    for (std::size_t k = 0; k < truth.size(); ++k) {
        EXPECT_LT(cornerError(alignment.frame_from_reference[k], truth[k], width, height),
                  kCornerPx)
            << "frame " << k << ", sigma " << alignment.sigma_px[k];
    }
}

using Hand = std::tuple<double, int>;  ///< EV step, seed

class HandheldBracket : public testing::TestWithParam<Hand> {};

TEST_P(HandheldBracket, ShiftsAreFound)
{
    const auto [ev_step, seed] = GetParam();
    const std::vector<glm::dmat3> places{
        rigid(40, 3.3, 0), glm::dmat3(1.0), rigid(-31.6, -7.25, 0)};
    const Alignment alignment =
        alignBracket(handheld(places, ev_step, static_cast<std::uint64_t>(seed)), onto(1));
    expectPlaces(alignment, places);
    EXPECT_TRUE(hasFinding(alignment.findings, "bracket-aligned"));
}

TEST_P(HandheldBracket, RotationsAreFound)
{
    const auto [ev_step, seed] = GetParam();
    const std::vector<glm::dmat3> places{
        rigid(9.4, -6.1, 2), glm::dmat3(1.0), rigid(-12.2, 4.5, -1.3)};
    const Alignment alignment =
        alignBracket(handheld(places, ev_step, static_cast<std::uint64_t>(seed)), onto(1));
    expectPlaces(alignment, places);
    for (std::size_t k = 0; k < places.size(); ++k)
        EXPECT_NEAR(rotationDegrees(alignment.frame_from_reference[k]),
                    rotationDegrees(places[k]),
                    kRotationDegrees)
            << "frame " << k;
}

TEST_P(HandheldBracket, ATurnedCameraIsFound)
{
    const auto [ev_step, seed] = GetParam();
    const auto turned = [](double x, double y, double z) {
        return turnedCamera(kWidth, kHeight, 0.9 * kWidth, kDegree * glm::dvec3(x, y, z));
    };
    const std::vector<glm::dmat3> places{
        turned(1.5, 1.0, 0.8), glm::dmat3(1.0), turned(-1.2, 0.8, -0.5)};
    const Alignment alignment =
        alignBracket(handheld(places, ev_step, static_cast<std::uint64_t>(seed)), onto(1));
    expectPlaces(alignment, places);
}

INSTANTIATE_TEST_SUITE_P(Alignment,
                         HandheldBracket,
                         testing::Combine(testing::Values(1.0, 2.0, 3.0), testing::Values(1, 2)));

TEST(Alignment, StepsOfFiveEvAreFound)
{
    const std::vector<glm::dmat3> places{rigid(9.5, 6, 0.5), glm::dmat3(1.0), rigid(-7.3, 3, -0.5)};
    expectPlaces(alignBracket(handheld(places, 5.0, 3), onto(1)), places);
}

TEST(Alignment, ATripodsBracketComesBackAsItWas)
{
    for (const double ev_step : {1.0, 3.0}) {
        const std::vector<glm::dmat3> places(5, glm::dmat3(1.0));
        const Bracket bracket = handheld(places, ev_step, 4);
        const Alignment alignment = alignBracket(bracket);
        EXPECT_TRUE(alignment.isIdentity());
        EXPECT_TRUE(hasFinding(alignment.findings, "bracket-static"));
        const Bracket aligned = applyAlignment(bracket, alignment);
        for (std::size_t k = 0; k < places.size(); ++k) {
            EXPECT_LT(alignment.shift_px[k], kCornerPx) << "frame " << k;
            EXPECT_EQ(aligned.frames[k].image.codes, bracket.frames[k].image.codes);
            EXPECT_TRUE(aligned.frames[k].excluded.empty());
        }
    }
}

TEST(Alignment, OnlyWhatTheDataTellsIsEstimated)
{
    const std::vector<glm::dmat3> places{rigid(6.5, -3.25, 0), glm::dmat3(1.0), rigid(-4, 8.75, 0)};
    const Alignment alignment = alignBracket(handheld(places, 2.0, 5), onto(1));
    for (const glm::dmat3& place : alignment.frame_from_reference) {
        // A homography fits noise: its perspective part is exactly zero only where none was fitted.
        EXPECT_EQ(place[0].z, 0.0);
        EXPECT_EQ(place[1].z, 0.0);
    }
    AlignmentOptions options = onto(1);
    options.model = AlignmentModel::Translation;
    for (const glm::dmat3& place :
         alignBracket(handheld(places, 2.0, 5), options).frame_from_reference)
        EXPECT_NEAR(glm::length(place[0] - glm::dvec3(1.0, 0.0, 0.0)), 0.0, tolerance::kDouble);
}

TEST(Alignment, UncertaintyIsThatOfTheErrors)
{
    double squares = 0.0;
    int count = 0;
    for (std::uint64_t seed = 11; seed < 15; ++seed) {
        const std::vector<glm::dmat3> places{
            rigid(5.3, 2.1, 0), glm::dmat3(1.0), rigid(-3.7, 4.4, 0)};
        const Alignment alignment = alignBracket(handheld(places, 2.0, seed, 240, 160), onto(1));
        for (const std::size_t k : {0u, 2u}) {
            const double error =
                cornerError(alignment.frame_from_reference[k], places[k], 240, 160);
            squares += error * error / (alignment.sigma_px[k] * alignment.sigma_px[k]);
            ++count;
        }
    }
    // Root mean square of error / sigma: 1 but for few samples and what is no noise.
    EXPECT_GT(std::sqrt(squares / count), 0.3);
    EXPECT_LT(std::sqrt(squares / count), 2.5);
}

TEST(Alignment, PeopleWhoMoveDoNotPull)
{
    const std::vector<glm::dmat3> places{rigid(8, -5, 0), glm::dmat3(1.0), rigid(-6, 2, 0)};
    const RectangleScene room(kWidth, kHeight, 6);
    std::vector<BracketFrame> frames;
    for (int k = 0; k < 3; ++k) {
        // A checked shirt, a fifth of the picture, elsewhere in each frame.
        const ContinuousScene with_person = [&room, k](double x, double y) {
            const double u = x - 40.0 - 105.0 * k;
            if (u < 0.0 || u > 80.0 || y < 40.0) return room(x, y);
            const bool dark = (static_cast<int>(u / 9.0) + static_cast<int>(y / 12.0)) % 2 == 0;
            return glm::dvec3(dark ? 0.01 : 0.03);
        };
        const auto i = static_cast<std::size_t>(k);
        frames.push_back(photographHandheld(with_person,
                                            kWidth,
                                            kHeight,
                                            {places[i]},
                                            {exposures(3, 2.0)[i]},
                                            contrastyCamera(6 + i))
                             .frames.front());
    }
    const Bracket bracket = makeBracket(std::move(frames));
    expectPlaces(alignBracket(bracket, onto(1)), places);
}

TEST(Alignment, BlackAndWhiteFramesStayAndAreNamed)
{
    const std::vector<glm::dmat3> places{
        glm::dmat3(1.0), rigid(7, 3, 0), glm::dmat3(1.0), rigid(-5, 4, 0), glm::dmat3(1.0)};
    Bracket bracket = handheld(places, 1.5, 7);
    for (glm::u16vec3& code : bracket.frames[0].image.codes.pixels())
        code = glm::u16vec3(255);
    for (glm::u16vec3& code : bracket.frames[4].image.codes.pixels())
        code = glm::u16vec3(0);
    const Alignment alignment = alignBracket(bracket, onto(2));
    expectPlaces(alignment, places);
    ASSERT_TRUE(hasFinding(alignment.findings, "bracket-alignment-failed"));
    int failed = 0;
    for (const Finding& finding : alignment.findings) {
        if (finding.code != "bracket-alignment-failed") continue;
        EXPECT_EQ(finding.severity, Severity::Warning);
        EXPECT_TRUE(finding.message.find("frame_0") != std::string::npos ||
                    finding.message.find("frame_4") != std::string::npos);
        ++failed;
    }
    EXPECT_EQ(failed, 2);
}

TEST(Alignment, ABlackFrameOfATripodsBracketIsNoWarning)
{
    Bracket bracket = handheld(std::vector<glm::dmat3>(3, glm::dmat3(1.0)), 2.0, 7);
    for (glm::u16vec3& code : bracket.frames[2].image.codes.pixels())
        code = glm::u16vec3(0);
    const Alignment alignment = alignBracket(bracket);
    EXPECT_TRUE(alignment.isIdentity());
    for (const Finding& finding : alignment.findings)
        EXPECT_EQ(finding.severity, Severity::Info) << finding.code;
}

TEST(Alignment, AFrameBeyondABlackOneIsStillFound)
{
    const std::vector<glm::dmat3> places{
        glm::dmat3(1.0), rigid(4, -2, 0), glm::dmat3(1.0), rigid(-5, 4, 0)};
    Bracket bracket = handheld(places, 1.5, 8);
    for (glm::u16vec3& code : bracket.frames[2].image.codes.pixels())
        code = glm::u16vec3(0);
    expectPlaces(alignBracket(bracket, onto(0)), places);
}

TEST(Alignment, AnEmptyWallIsRefused)
{
    const ContinuousScene wall = [](double, double) { return glm::dvec3(0.04); };
    const Bracket bracket = photographHandheld(wall,
                                               240,
                                               160,
                                               std::vector<glm::dmat3>(3, glm::dmat3(1.0)),
                                               exposures(3, 2.0),
                                               contrastyCamera(9));
    const Alignment alignment = alignBracket(bracket);
    EXPECT_TRUE(hasFinding(alignment.findings, "bracket-not-alignable"));
    EXPECT_TRUE(alignment.isIdentity());
    EXPECT_FALSE(hasFinding(alignment.findings, "bracket-aligned"));
}

TEST(Alignment, OfARepeatedTextureTheSmallestShiftIsTaken)
{
    const ContinuousScene tilesOfAWall = [](double x, double y) {
        const double joint =
            std::min(std::abs(std::remainder(x, 24.0)), std::abs(std::remainder(y, 24.0)));
        return glm::dvec3(0.05) * (0.2 + 0.8 * std::clamp(joint - 1.0, 0.0, 1.0));
    };
    const std::vector<glm::dmat3> places{rigid(5.5, -3, 0), glm::dmat3(1.0), rigid(-4, 7.25, 0)};
    const Bracket bracket = photographHandheld(
        tilesOfAWall, kWidth, kHeight, places, exposures(3, 2.0), contrastyCamera(10));
    expectPlaces(alignBracket(bracket, onto(1)), places);
}

TEST(Alignment, SmallPicturesAreAligned)
{
    const std::vector<glm::dmat3> places{
        rigid(4.5, -2, 0, 64, 64), glm::dmat3(1.0), rigid(-3, 5.25, 0, 64, 64)};
    expectPlaces(alignBracket(handheld(places, 2.0, 11, 64, 64), onto(1)), places, 64, 64);
}

TEST(Alignment, PicturesTooSmallToTellAreRefused)
{
    Bracket bracket = handheld(std::vector<glm::dmat3>(3, glm::dmat3(1.0)), 2.0, 11, 3, 2);
    EXPECT_TRUE(hasFinding(alignBracket(bracket).findings, "bracket-not-alignable"));
}

TEST(Alignment, OneThreadGivesTheSameAsMany)
{
    const std::vector<glm::dmat3> places{rigid(9.4, -6.1, 1), glm::dmat3(1.0), rigid(-12.2, 4, -1)};
    const Bracket bracket = handheld(places, 2.0, 12, 240, 160);
    setThreadCount(1);
    const Alignment one = alignBracket(bracket);
    const Bracket from_one = applyAlignment(bracket, one);
    setThreadCount(4);
    const Alignment many = alignBracket(bracket);
    const Bracket from_many = applyAlignment(bracket, many);
    setThreadCount(0);
    EXPECT_EQ(one.frame_from_reference, many.frame_from_reference);
    for (std::size_t k = 0; k < places.size(); ++k) {
        EXPECT_EQ(from_one.frames[k].image.codes, from_many.frames[k].image.codes);
        EXPECT_EQ(from_one.frames[k].excluded, from_many.frames[k].excluded);
    }
}

TEST(Alignment, OptionsThatMakeNoSenseAreRefused)
{
    const Bracket bracket = handheld(std::vector<glm::dmat3>(2, glm::dmat3(1.0)), 2.0, 1, 32, 32);
    for (const double fraction : {0.0, -1.0, 0.6, std::nan("")}) {
        AlignmentOptions options;
        options.max_shift_fraction = fraction;
        EXPECT_TRUE(hasFinding(options.validate(), "alignment-options")) << fraction;
        EXPECT_THROW((void)alignBracket(bracket, options), InputError);
    }
    AlignmentOptions options;
    options.min_shift_px = std::nan("");
    EXPECT_THROW((void)alignBracket(bracket, options), InputError);
    EXPECT_THROW((void)alignBracket(bracket, onto(2)), InputError);
    EXPECT_THROW((void)alignBracket(bracket, onto(-1)), InputError);
}

TEST(ApplyAlignment, AWholePixelShiftMovesCodes)
{
    const Bracket bracket = handheld(std::vector<glm::dmat3>(2, glm::dmat3(1.0)), 1.0, 13, 60, 40);
    Alignment alignment;
    alignment.frame_from_reference = {glm::dmat3(1.0), rigid(7, -4, 0, 60, 40)};
    const Bracket aligned = applyAlignment(bracket, alignment);
    const BracketFrame& before = bracket.frames[1];
    const BracketFrame& after = aligned.frames[1];
    for (int y = 0; y < 40; ++y) {
        for (int x = 0; x < 60; ++x) {
            const bool outside = x + 7 >= 60 || y - 4 < 0;
            EXPECT_EQ(after.excluded(x, y), outside ? 1 : 0) << x << " " << y;
            const glm::u16vec3 expected =
                outside ? glm::u16vec3(255) : before.image.codes(x + 7, y - 4);
            // Codes at the clipping limit come out clipped.
            for (int c = 0; c < 3; ++c)
                EXPECT_EQ(after.image.codes(x, y)[c], expected[c] > 244 ? 255 : expected[c]);
        }
    }
}

/// The frame and the same codes under half its exposure: under one exposure they would count once.
Bracket pairOf(const BracketFrame& frame)
{
    BracketFrame shorter = frame;
    shorter.relative_exposure *= 0.5;
    return makeBracket({frame, shorter});
}

TEST(ApplyAlignment, ASmoothPictureIsResampledToOneCode)
{
    const auto wave = [](double x, double y) {
        return 120.0 + 60.0 * std::sin(0.5 * x + 0.2 * y) + 30.0 * std::cos(0.4 * y);
    };
    BracketFrame frame;
    frame.relative_exposure = 1.0;
    frame.image.codes = Image<glm::u16vec3>(80, 60);
    for (int y = 0; y < 60; ++y)
        for (int x = 0; x < 80; ++x)
            frame.image.codes(x, y) =
                glm::u16vec3(static_cast<std::uint16_t>(std::lround(wave(x + 0.5, y + 0.5))));
    const Bracket bracket = pairOf(frame);
    Alignment alignment;
    const glm::dmat3 motion = rigidMotion(80, 60, {0.5, -0.5}, 1.5 * kDegree);
    alignment.frame_from_reference = {glm::dmat3(1.0), motion};
    const Bracket aligned = applyAlignment(bracket, alignment);
    for (int y = 0; y < 60; ++y) {
        for (int x = 0; x < 80; ++x) {
            if (aligned.frames[1].excluded(x, y) != 0 || x < 3 || y < 3 || x > 76 || y > 56)
                continue;
            const glm::dvec3 at = motion * glm::dvec3(x + 0.5, y + 0.5, 1.0);
            // Rounding twice, and the cubic's third-order error for this wave.
            EXPECT_NEAR(aligned.frames[1].image.codes(x, y).g, wave(at.x, at.y), 1.6);
        }
    }
}

TEST(ApplyAlignment, ClippedAreasStayClippedAndNothingElseBecomesSo)
{
    BracketFrame frame;
    frame.relative_exposure = 1.0;
    frame.image.codes = Image<glm::u16vec3>(40, 30, glm::u16vec3(90, 100, 110));
    for (int y = 10; y < 20; ++y)
        for (int x = 15; x < 25; ++x)
            frame.image.codes(x, y) = glm::u16vec3(255, 255, 110);
    const Bracket bracket = pairOf(frame);
    Alignment alignment;
    alignment.frame_from_reference = {glm::dmat3(1.0), rigidMotion(40, 30, {0.4, 0.3}, 0.0)};
    const BracketFrame after = applyAlignment(bracket, alignment).frames[1];
    for (int y = 0; y < 29; ++y) {
        for (int x = 0; x < 39; ++x) {
            const bool touches = x + 1 >= 15 && x < 25 && y + 1 >= 10 && y < 20;
            const glm::u16vec3 expected =
                touches ? glm::u16vec3(255, 255, 110) : glm::u16vec3(90, 100, 110);
            EXPECT_EQ(after.image.codes(x, y), expected) << x << " " << y;
        }
    }
}

TEST(ApplyAlignment, ExcludedPixelsStayExcluded)
{
    BracketFrame frame;
    frame.relative_exposure = 1.0;
    frame.image.codes = Image<glm::u16vec3>(20, 20, glm::u16vec3(100));
    frame.excluded = Image<std::uint8_t>(20, 20);
    frame.excluded(10, 10) = 1;
    frame.image.codes(10, 10) = glm::u16vec3(200);
    const Bracket bracket = pairOf(frame);
    Alignment alignment;
    alignment.frame_from_reference = {glm::dmat3(1.0), rigidMotion(20, 20, {0.5, 0.0}, 0.0)};
    const BracketFrame after = applyAlignment(bracket, alignment).frames[1];
    for (int x = 0; x < 19; ++x) {
        EXPECT_EQ(after.excluded(x, 10), x == 9 || x == 10 ? 1 : 0) << x;
        if (after.excluded(x, 10) == 0) {
            EXPECT_EQ(after.image.codes(x, 10), glm::u16vec3(100)) << x;
        }
    }
}

/// The frames of a real bracket on a tripod, read without their response.
Alignment alignFiles(const std::string& folder, const std::vector<std::string>& names)
{
    std::vector<std::filesystem::path> files;
    for (const std::string& name : names)
        files.push_back(dataFolder() / "brackets" / folder / name);
    return alignBracket(readBracket(files));
}

TEST(AlignmentOfRealBrackets, TheTripodInTheLivingRoomRolledALittle)
{
    INSITU_NEEDS_DATA();
    const Alignment alignment =
        alignFiles("ball_olapietka_livingroom", {"raw1.jpg", "raw2.jpg", "raw3.jpg"});
    // The camera stands on a tripod but rolled by up to 0.13 degrees from frame to frame.
    for (const double shift : alignment.shift_px)
        EXPECT_LT(shift, 5.0);
    for (const glm::dmat3& place : alignment.frame_from_reference)
        EXPECT_LT(std::abs(rotationDegrees(place)), 0.2);
    EXPECT_FALSE(hasFinding(alignment.findings, "bracket-alignment-failed"));
}

TEST(AlignmentOfRealBrackets, TheHandHeldOneMovedAndAlignsOntoItself)
{
    INSITU_NEEDS_DATA();
    const std::filesystem::path folder = dataFolder() / "brackets" / "piccante_handheld_alignment";
    const Bracket bracket =
        readBracket({folder / "IMG_4209.jpg", folder / "IMG_4210.jpg", folder / "IMG_4211.jpg"});
    const Alignment alignment = alignBracket(bracket);
    ASSERT_TRUE(hasFinding(alignment.findings, "bracket-aligned"));
    AlignmentOptions again;
    again.reference = alignment.reference;
    for (const double shift : alignBracket(applyAlignment(bracket, alignment), again).shift_px)
        EXPECT_LT(shift, 1.0);
}

}  // namespace
}  // namespace insitu
