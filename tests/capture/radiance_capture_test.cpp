#include "capture/radiance_capture.h"

#include "core/io/image_io.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/data.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {
namespace {

const std::vector<double> kOneEv = {1.0, 0.5, 0.25, 0.125, 1.0 / 16, 1.0 / 32, 1.0 / 64, 1.0 / 128};

/// Thirteen stops, so that every code occurs.
Image<Rgb> ramp()
{
    Image<Rgb> image(320, 240);
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 320; ++x)
            image(x, y) =
                Rgb(1.0f, 0.9f, 0.8f) *
                (0.01f *
                 std::exp2(13.0f * (static_cast<float>(x) + static_cast<float>(y) / 240.0f) / 320));
    return image;
}

SyntheticCamera camera()
{
    return shoulderCamera(/*power=*/0.6, /*shot=*/1.0 / 60'000.0, /*read=*/2.5e-9);
}

/// Median over the pixels that some frame shows well of |log(merged / truth)| after one scale.
double medianError(const CapturedRadiance& captured, const Image<Rgb>& truth)
{
    std::vector<double> logs;
    for (int y = 0; y < truth.height(); ++y)
        for (int x = 0; x < truth.width(); ++x)
            if (truth(x, y).g > 0.1f && truth(x, y).g < 40.0f)
                logs.push_back(std::log(captured.merged.radiance.pixels(x, y).g / truth(x, y).g));
    const auto median = [](std::vector<double>& values) {
        std::ranges::nth_element(values, values.begin() + values.size() / 2);
        return values[values.size() / 2];
    };
    const double scale = median(logs);
    for (double& value : logs)
        value = std::abs(value - scale);
    return median(logs);
}

TEST(CaptureRadiance, GoesAllTheWay)
{
    const CapturedRadiance captured = captureRadiance(photograph(ramp(), kOneEv, camera()), {}, {});
    EXPECT_TRUE(captured.response_known);
    EXPECT_GE(captured.held_out_error_codes, 0.0);
    ASSERT_EQ(captured.frames.size(), kOneEv.size());
    EXPECT_GT(captured.frames.front().clipped_fraction, 0.4);
    EXPECT_NEAR(captured.frames.back().black_fraction, 1.0 / 13.0, 0.02);  // a stop of thirteen
    EXPECT_EQ(captured.frames[2].used_exposure, captured.frames[2].nominal_exposure);
    EXPECT_LT(medianError(captured, ramp()), 0.01);
    EXPECT_TRUE(captured.merged.findings.empty());  // moved to the common list
}

// The third EXIF time is wrong by more than a stop: the frames stand in the wrong order until the
// pictures have told their exposures. The merge relies on the order.
TEST(CaptureRadiance, AFrameWithAWrongTimeTakesItsPlace)
{
    Bracket given = photograph(ramp(), kOneEv, camera());
    given.frames[3].relative_exposure *= 2.6;
    given = makeBracket(std::move(given.frames));
    ASSERT_EQ(given.frames[2].name, "frame_3");

    const CapturedRadiance captured = captureRadiance(given, {}, {});
    EXPECT_TRUE(hasFinding(captured.findings, "bracket-exposure-mismatch"));
    for (std::size_t k = 0; k < kOneEv.size(); ++k) {
        EXPECT_EQ(captured.frames[k].name, fmt::format("frame_{}", k));
        EXPECT_NEAR(captured.frames[k].used_exposure / kOneEv[k], 1.0, 0.03) << k;
    }
    EXPECT_LT(medianError(captured, ramp()), 0.02);
}

TEST(CaptureRadiance, AGivenResponseIsTakenAsItIs)
{
    const CapturedRadiance captured =
        captureRadiance(photograph(ramp(), kOneEv, camera()), tableOf(camera()), {});
    EXPECT_EQ(captured.response.exposure, tableOf(camera()).exposure);
    EXPECT_LT(captured.held_out_error_codes, 0.0);
    EXPECT_LT(medianError(captured, ramp()), 0.01);
}

TEST(CaptureRadiance, AGivenResponseShowsAWrongListWithItsNumbers)
{
    Bracket bracket = photograph(ramp(), kOneEv, camera());
    const CapturedRadiance right = captureRadiance(bracket, tableOf(camera()), {});
    EXPECT_FALSE(hasFinding(right.findings, "bracket-exposure-mismatch"));
    for (const CapturedFrame& frame : right.frames) {
        ASSERT_TRUE(frame.measured_exposure);
        EXPECT_NEAR(*frame.measured_exposure / frame.nominal_exposure, 1.0, 0.02);  // 8-bit codes
    }

    bracket.frames[3].relative_exposure *= 1.8;
    const CapturedRadiance wrong = captureRadiance(bracket, tableOf(camera()), {});
    std::vector<std::string> told;
    for (const Finding& finding : wrong.findings)
        if (finding.code == "bracket-exposure-mismatch") told.push_back(finding.message);
    ASSERT_EQ(told.size(), 1u);
    EXPECT_THAT(told[0], testing::StartsWith("frame_3: given 0.225, measured 0.1"));
    // The list is told, not changed: the response may be the one that is wrong.
    EXPECT_EQ(wrong.frames[3].used_exposure, bracket.frames[3].relative_exposure);
}

TEST(MeasureExposures, SaysNothingWhereFramesShareNothing)
{
    const Bracket apart = photograph(ramp(), {1.0, 0.5, 1e-6}, camera());
    const auto measured = measureExposures(apart, tableOf(camera()));
    ASSERT_EQ(measured.size(), 3u);
    EXPECT_NEAR(*measured[0] / *measured[1], 2.0, 0.02);  // 8-bit codes
    EXPECT_FALSE(measured[2]);
    EXPECT_TRUE(exposureMismatches(apart, measured).empty());
    const auto alone = measureExposures(photograph(ramp(), {1.0}, camera()), tableOf(camera()));
    EXPECT_THAT(alone, testing::ElementsAre(std::nullopt));
}

TEST(CaptureRadiance, ASingleExposureIsLinearised)
{
    CaptureOptions options;
    options.align = true;
    options.deghost = true;
    const CapturedRadiance captured =
        captureRadiance(photograph(ramp(), {0.125}, camera()), tableOf(camera()), options);
    EXPECT_EQ(captured.frames.size(), 1u);
    EXPECT_FALSE(hasFinding(captured.findings, "bracket-static"));
}

TEST(CaptureRadiance, WhatMovedIsLeftOut)
{
    Bracket bracket = photograph(ramp(), kOneEv, camera());
    // A bright square that only one frame shows.
    for (int y = 100; y < 140; ++y)
        for (int x = 100; x < 140; ++x)
            bracket.frames[4].image.codes(x, y) = glm::u16vec3(200);
    CaptureOptions options;
    options.deghost = true;
    const auto with = captureRadiance(bracket, tableOf(camera()), options);
    EXPECT_TRUE(hasFinding(with.findings, "bracket-ghosts-removed"));
    EXPECT_TRUE(with.merged.validity(120, 120) & kMergeExcluded);
    const float truth = ramp()(120, 120).g;
    EXPECT_NEAR(with.merged.radiance.pixels(120, 120).g / truth, 1.0f, 0.1f);
}

/// Hand-cut crops of a ball: unequal in size and not aligned; their middles show the same.
Bracket owlBall(const std::vector<double>& seconds)
{
    const auto folder = dataFolder() / "brackets" / "ball_spiceowlf_probeonly";
    constexpr int kSide = 400;
    std::vector<BracketFrame> frames;
    std::size_t k = 0;
    for (const char* name : {"0024.jpg", "0060.jpg", "0120.jpg", "0205.jpg", "0553.jpg"}) {
        const Photo photo = readPhoto(folder / name);
        const auto& codes = photo.image.codes;
        const int left = (codes.width() - kSide) / 2;
        const int top = (codes.height() - kSide) / 2;
        BracketFrame frame;
        frame.name = name;
        frame.image.codes = Image<glm::u16vec3>(kSide, kSide);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                frame.image.codes(x, y) = codes(left + x, top + y);
        frame.relative_exposure =
            seconds.empty() ? *photo.metadata.exposure.seconds : seconds.at(k);
        frames.push_back(std::move(frame));
        ++k;
    }
    return makeBracket(std::move(frames));
}

// The files are called 24, 60, 120, 205, 553; the camera wrote 1/25, 1/60, 1/125, 1/200, 1/500.
TEST(RealBrackets, ExifCountsNotTheNamesOfTheFiles)
{
    INSITU_NEEDS_DATA();
    const Bracket bracket = owlBall({});
    const std::array written = {25.0, 60.0, 125.0, 200.0, 500.0};
    for (std::size_t k = 0; k < written.size(); ++k)
        EXPECT_NEAR(bracket.frames[k].relative_exposure * written[k], 1.0, 1e-6) << k;
    const CapturedRadiance captured = captureRadiance(bracket, {}, {});
    EXPECT_FALSE(hasFinding(captured.findings, "bracket-exposure-mismatch"));

    // A list in the order of another bracket: the pictures contradict it, and by how much is told.
    const CapturedRadiance wrong =
        captureRadiance(owlBall({1.0 / 25, 1.0 / 125, 1.0 / 60, 1.0 / 200, 1.0 / 500}), {}, {});
    EXPECT_TRUE(hasFinding(wrong.findings, "bracket-exposure-mismatch"));
}

}  // namespace
}  // namespace insitu
