#include "capture/radiance_capture.h"

#include "tests/capture/synthetic_bracket.h"

#include <gmock/gmock.h>

#include <algorithm>
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
            image(x, y) = Rgb(1.0f, 0.9f, 0.8f) *
                          (0.01f * std::exp2(13.0f * (static_cast<float>(x) + y / 240.0f) / 320));
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
    EXPECT_GT(captured.frames.back().black_fraction, 0.3);
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

}  // namespace
}  // namespace insitu
