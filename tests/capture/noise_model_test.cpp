#include "capture/noise_model.h"

#include "core/parallel.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

constexpr double kNoiseError = 0.1;  ///< asked of variances; the sample itself leaves 2 to 5 %

SyntheticCamera cameraOf(double shot, double read, int max_code = 255)
{
    return shoulderCamera(0.7, shot, read, max_code);
}

/// Six octaves of brightness; `contrast` is the amplitude of texture on every pixel.
Image<Rgb> ramp(float contrast)
{
    Image<Rgb> scene(384, 192);
    for (int y = 0; y < scene.height(); ++y) {
        RandomStream random(7, static_cast<std::uint64_t>(y), 0);
        for (int x = 0; x < scene.width(); ++x)
            scene(x, y) = Rgb(0.03f, 0.025f, 0.02f) *
                          std::exp2(6.0f * static_cast<float>(x) / 384.0f) *
                          (1.0f + contrast * (random.uniform() - 0.5f));
    }
    return scene;
}

const std::vector<double> kSeconds = {1.0, 0.5, 0.25, 0.125};

/// Ratio of estimated to true variance over the levels that matter, channel by channel.
void expectRecovered(const NoiseEstimate& estimate,
                     const SyntheticCamera& camera,
                     const ResponseCurve& response,
                     double error)
{
    EXPECT_FALSE(hasFinding(estimate.findings, "noise-model-assumed"));
    NoiseModel truth;
    for (ChannelNoise& channel : truth.channels) {
        channel.read_variance = camera.read_variance;
        channel.gain = camera.shot_variance;
        const double step = 255.0 / camera.max_code;
        channel.code_variance = step * step / 12.0;
    }
    for (int c = 0; c < 3; ++c)
        for (const double code : {16.0, 40.0, 100.0, 180.0, 240.0})
            EXPECT_NEAR(
                estimate.model.variance(response, c, code) / truth.variance(response, c, code),
                1.0,
                error)
                << "channel " << c << " code " << code;
}

TEST(EstimateNoise, RecoversTheCameras)
{
    for (const auto& [shot, read] : {std::pair{2.5e-4, 1.5e-6}, {1e-3, 6e-6}, {1e-4, 2.5e-7}}) {
        const SyntheticCamera camera = cameraOf(shot, read);
        const ResponseCurve response = tableOf(camera);
        const NoiseEstimate estimate =
            estimateNoise(photograph(ramp(0.0f), kSeconds, camera), response);
        expectRecovered(estimate, camera, response, kNoiseError);
        EXPECT_NEAR(estimate.model.channels[1].gain / shot, 1.0, kNoiseError);
    }
}

// The texture's own variance is a hundred times the noise's.
TEST(EstimateNoise, IsNotFooledByTexture)
{
    const SyntheticCamera camera = cameraOf(2.5e-4, 1.5e-6);
    const ResponseCurve response = tableOf(camera);
    const NoiseEstimate estimate =
        estimateNoise(photograph(ramp(0.8f), kSeconds, camera), response);
    expectRecovered(estimate, camera, response, kNoiseError);
}

// One frame is two pixels beside the others; six tenths of the picture are textured.
TEST(EstimateNoise, FindsFlatPlacesInAMovedBracket)
{
    const SyntheticCamera camera = cameraOf(2.5e-4, 1.5e-6);
    const ResponseCurve response = tableOf(camera);
    Image<Rgb> scene = ramp(0.0f);
    const Image<Rgb> textured = ramp(0.8f);
    for (int y = 0; y < scene.height() * 6 / 10; ++y)
        std::ranges::copy(textured.row(y), scene.row(y).begin());
    Bracket bracket = photograph(scene, kSeconds, camera);
    auto& moved = bracket.frames[1].image.codes;
    for (int y = 0; y + 2 < moved.height(); ++y)
        std::ranges::copy(moved.row(y + 2), moved.row(y).begin());
    expectRecovered(estimateNoise(bracket, response), camera, response, kNoiseError);
}

TEST(EstimateNoise, ReadsSixteenBits)
{
    const SyntheticCamera camera = cameraOf(1e-4, 2.5e-7, 65535);
    const ResponseCurve response = tableOf(camera);
    expectRecovered(estimateNoise(photograph(ramp(0.0f), kSeconds, camera), response),
                    camera,
                    response,
                    kNoiseError);
}

// Noise far below a code: the variance is that of rounding (more or less: rounding is the same all
// along the ramp's columns), not of an assumed camera, which would be 20 times more.
TEST(EstimateNoise, KnowsWhenRoundingHidesTheNoise)
{
    const SyntheticCamera camera = cameraOf(1e-7, 1e-10);
    const ResponseCurve response = tableOf(camera);
    const NoiseEstimate estimate =
        estimateNoise(photograph(ramp(0.0f), kSeconds, camera), response);
    EXPECT_TRUE(estimate.findings.empty());
    const NoiseModel rounding;
    const NoiseModel assumed = assumedNoise(response, std::nullopt, 255);
    for (const double code : {40.0, 100.0, 180.0}) {
        const double variance = estimate.model.variance(response, 1, code);
        EXPECT_GE(variance, rounding.variance(response, 1, code));
        EXPECT_LT(variance, 1.5 * rounding.variance(response, 1, code));
        EXPECT_GT(assumed.variance(response, 1, code), 10.0 * variance);
    }
}

// Codes averaged with their neighbours by 1/4, 1/2, 1/4, as demosaicing and JPEG do: correlation
// (2 * 1/4 * 1/2) / (1/16 + 1/4 + 1/16).
TEST(EstimateNoise, SaysHowNeighboursAreCorrelated)
{
    const SyntheticCamera camera = cameraOf(1e-3, 6e-6, 65535);
    const ResponseCurve response = tableOf(camera);
    Bracket bracket = photograph(ramp(0.0f), kSeconds, camera);
    const double white = estimateNoise(bracket, response).model.channels[1].neighbour_correlation;
    EXPECT_NEAR(white, 0.0, 0.03);  // blocks of 256 pixels less their plane
    for (BracketFrame& frame : bracket.frames) {
        const auto sharp = frame.image.codes;
        for (int y = 0; y < sharp.height(); ++y)
            for (int x = 1; x + 1 < sharp.width(); ++x)
                for (int c = 0; c < 3; ++c)
                    frame.image.codes(x, y)[c] = static_cast<std::uint16_t>(
                        (sharp(x - 1, y)[c] + 2 * sharp(x, y)[c] + sharp(x + 1, y)[c]) / 4);
    }
    const double smooth = estimateNoise(bracket, response).model.channels[1].neighbour_correlation;
    EXPECT_NEAR(smooth, 2.0 / 3.0, 0.05);
}

TEST(EstimateNoise, AssumesWhatTheBracketDoesNotShow)
{
    const SyntheticCamera camera = cameraOf(2.5e-4, 1.5e-6);
    const ResponseCurve response = tableOf(camera);
    Bracket single = photograph(ramp(0.0f), {1.0}, camera);
    single.metadata.exposure.iso = 1600.0;
    const NoiseEstimate estimate = estimateNoise(single, response);
    EXPECT_TRUE(hasFinding(estimate.findings, "noise-model-assumed"));
    // exposure[255] is 1, by bisection.
    EXPECT_NEAR(estimate.model.channels[0].gain, 1.0 / 2000.0, tolerance::kDouble);
    EXPECT_NEAR(estimate.model.channels[0].read_variance, 25.0 / 4e6, tolerance::kDouble);

    // Too few pixels, and everything clipped.
    EXPECT_TRUE(hasFinding(
        estimateNoise(photograph(tiles(20, 20, 4, 0.1, 0.5), kSeconds, camera), response).findings,
        "noise-model-assumed"));
    EXPECT_TRUE(hasFinding(
        estimateNoise(photograph(Image<Rgb>(200, 200, Rgb(50.0f)), kSeconds, camera), response)
            .findings,
        "noise-model-assumed"));
}

TEST(EstimateNoise, SaysWhichChannelIsUnknown)
{
    const SyntheticCamera camera = cameraOf(2.5e-4, 1.5e-6);
    Image<Rgb> scene = ramp(0.0f);
    for (Rgb& pixel : scene.pixels())
        pixel.b = 0.0f;
    const NoiseEstimate estimate =
        estimateNoise(photograph(scene, kSeconds, camera), tableOf(camera));
    ASSERT_EQ(estimate.findings.size(), 1u);
    EXPECT_THAT(estimate.findings[0].message, testing::HasSubstr("channels B)"));
    EXPECT_NEAR(estimate.model.channels[0].gain / 2.5e-4, 1.0, kNoiseError);
}

TEST(EstimateNoise, DoesNotDependOnTheNumberOfThreads)
{
    const SyntheticCamera camera = cameraOf(2.5e-4, 1.5e-6);
    const Bracket bracket = photograph(ramp(0.3f), kSeconds, camera);
    setThreadCount(1);
    const NoiseModel one = estimateNoise(bracket, tableOf(camera)).model;
    setThreadCount(4);
    const NoiseModel four = estimateNoise(bracket, tableOf(camera)).model;
    setThreadCount(0);
    for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(one.channels[c].gain, four.channels[c].gain);
        EXPECT_EQ(one.channels[c].read_variance, four.channels[c].read_variance);
    }
}

TEST(NoiseModel, AddsItsThreeParts)
{
    ResponseCurve line;
    for (auto& table : line.exposure)
        for (std::size_t z = 0; z < 256; ++z)
            table[z] = static_cast<double>(z) / 255.0;
    NoiseModel model;
    model.channels[2] = {4e-6, 1e-4, 0.5, 0.0};
    EXPECT_NEAR(model.variance(line, 2, 51.0),
                4e-6 + 1e-4 * 0.2 + 0.5 / (255.0 * 255.0),
                tolerance::kDouble);
}

TEST(NoiseModel, RefusesWhatIsNoNoise)
{
    EXPECT_TRUE(NoiseModel{}.validate().empty());
    NoiseModel model;
    model.channels[0].gain = -1.0;
    model.channels[1].code_variance = 0.0;
    model.channels[2].read_variance = std::nan("");
    EXPECT_EQ(model.validate().size(), 3u);
    EXPECT_TRUE(hasFinding(model.validate(), "noise-model-invalid"));
}

TEST(AssumedNoise, FollowsIsoAndSurvivesOddOnes)
{
    const ResponseCurve response = ResponseCurve::srgb();
    EXPECT_DOUBLE_EQ(assumedNoise(response, 100.0, 255).channels[1].gain, 1.0 / 32000.0);
    EXPECT_DOUBLE_EQ(assumedNoise(response, std::nullopt, 255).channels[1].gain, 1.0 / 4000.0);
    EXPECT_DOUBLE_EQ(assumedNoise(response, -3.0, 255).channels[1].gain, 1.0 / 4000.0);
    EXPECT_TRUE(assumedNoise(response, 1e30, 65535).validate().empty());
}

}  // namespace
}  // namespace insitu
