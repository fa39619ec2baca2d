// The merge against what noise allows: the minimum-variance bound, and whether the stated standard
// deviation covers the truth.

#include "capture/hdr_merge.h"
#include "core/parallel.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <array>

namespace insitu {
namespace {

constexpr double kBoundError = 0.05;  ///< asked of the RMS error, relative to the bound
constexpr double kCover1 = 0.03;      ///< asked of the coverage of one deviation
constexpr double kCover2 = 0.02;      ///< and of 1.96

SyntheticCamera cameraOf(double shot, double read, int max_code = 255)
{
    return shoulderCamera(0.75, shot, read, max_code);
}

NoiseModel noiseOf(const SyntheticCamera& camera)
{
    NoiseModel noise;
    for (ChannelNoise& channel : noise.channels) {
        channel.gain = camera.shot_variance;
        channel.read_variance = camera.read_variance;
        const double step = 255.0 / camera.max_code;
        channel.code_variance = step * step / 12.0;
    }
    return noise;
}

std::vector<double> stops(int count, double ev)
{
    std::vector<double> seconds;
    for (int k = 0; k < count; ++k)
        seconds.push_back(std::exp2(-ev * k));
    return seconds;
}

/// Relative squared error of every well-exposed value and the bound of it, by the true radiance.
struct Efficiency {
    double error = 0.0;
    double bound = 0.0;
    double values = 0.0;
    double within_1 = 0.0;
    double within_2 = 0.0;

    [[nodiscard]] double overBound() const { return std::sqrt(error / bound); }
};

Efficiency efficiencyOf(const MergeResult& merged,
                        const Image<Rgb>& scene,
                        const std::vector<double>& seconds,
                        const SyntheticCamera& camera,
                        const ResponseCurve& response)
{
    const NoiseModel noise = noiseOf(camera);
    const MergeOptions limits;
    Efficiency sum;
    for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
        for (int c = 0; c < 3; ++c) {
            const double truth = static_cast<double>(scene.pixels()[i][c]);
            double information = 0.0;
            for (const double t : seconds) {
                const double code = 255.0 * camera.curve(c, std::min(truth * t, 1.0));
                if (code < 255.0 * limits.black_fraction || code > 255.0 * limits.clip_fraction)
                    continue;
                information += t * t / noise.variance(response, c, code);
            }
            const double brightest =
                255.0 * camera.curve(c, std::min(truth * seconds.front(), 1.0));
            if (information <= 0.0 || brightest < 510.0 * limits.black_fraction) continue;
            const double error = static_cast<double>(merged.radiance.pixels.pixels()[i][c]) - truth;
            const double deviation =
                std::abs(error) / std::sqrt(static_cast<double>(merged.variance.pixels()[i][c]));
            sum.error += error * error / (truth * truth);
            sum.bound += 1.0 / (information * truth * truth);
            sum.within_1 += deviation <= 1.0 ? 1.0 : 0.0;
            sum.within_2 += deviation <= 1.96 ? 1.0 : 0.0;
            sum.values += 1.0;
        }
    }
    return sum;
}

struct Case {
    const char* name;
    double shot;
    double read;
    int frames;
    double ev;
    int max_code;
};

class MergeNoise : public testing::TestWithParam<Case> {
protected:
    [[nodiscard]] static Efficiency measure(bool estimated)
    {
        const Case& given = GetParam();
        const SyntheticCamera camera = cameraOf(given.shot, given.read, given.max_code);
        const ResponseCurve response = tableOf(camera);
        const std::vector<double> seconds = stops(given.frames, given.ev);
        // A thousand patches from black in the longest frame to clipping in the shortest; larger
        // ones where the estimate of the noise needs places.
        const int side = estimated ? 10 : 6;
        const Image<Rgb> scene = tiles(
            40 * side, 25 * side, side, 0.004, 0.9 * std::exp2(given.ev * (given.frames - 1)));
        const Bracket bracket = photograph(scene, seconds, camera);
        MergeOptions options;
        if (!estimated) options.noise = noiseOf(camera);
        return efficiencyOf(
            mergeBracket(bracket, response, options), scene, seconds, camera, response);
    }
};

TEST_P(MergeNoise, ReachesTheBound)
{
    const Efficiency reached = measure(false);
    EXPECT_GT(reached.values, 50'000.0);
    EXPECT_LT(reached.overBound(), 1.0 + kBoundError);
    EXPECT_GT(reached.overBound(), 1.0 - kBoundError);  // else the bound is not one
}

TEST_P(MergeNoise, StatesADeviationThatCoversTheTruth)
{
    const Efficiency reached = measure(false);
    EXPECT_NEAR(reached.within_1 / reached.values, 0.6827, kCover1);
    EXPECT_NEAR(reached.within_2 / reached.values, 0.95, kCover2);
}

TEST_P(MergeNoise, DoesSoWithTheNoiseItFindsItself)
{
    const Efficiency reached = measure(true);
    // Frames 5 EV apart show a place together only where the shorter one is dark: what the noise of
    // bright codes is has to be extrapolated.
    const double looser = GetParam().ev > 4.0 ? 2.0 : 1.0;
    EXPECT_LT(reached.overBound(), 1.0 + kBoundError);
    EXPECT_NEAR(reached.within_1 / reached.values, 0.6827, looser * kCover1);
    EXPECT_NEAR(reached.within_2 / reached.values, 0.95, looser * kCover2);
}

INSTANTIATE_TEST_SUITE_P(Cameras,
                         MergeNoise,
                         testing::Values(Case{"Common", 1e-4, 2.5e-7, 11, 1.0, 255},
                                         Case{"Iso6400", 2e-3, 4e-4 * 4e-4 * 25, 8, 1.0, 255},
                                         Case{"RoundingInBrightPixels", 2e-5, 1e-8, 11, 1.0, 255},
                                         Case{"TwoFrames", 1e-4, 2.5e-7, 2, 2.0, 255},
                                         Case{"FiveStopsApart", 1e-4, 2.5e-7, 4, 5.0, 255},
                                         Case{"ThirdStops", 1e-4, 2.5e-7, 12, 1.0 / 3.0, 255},
                                         Case{"SixteenBit", 2e-5, 1e-8, 7, 2.0, 65535}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace insitu
