#include "capture/hdr_merge.h"

#include "core/parallel.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

double power(int, double e)
{
    return std::pow(e, 0.45);
}

SyntheticCamera plainCamera(int max_code)
{
    SyntheticCamera camera;
    camera.curve = power;
    camera.max_code = max_code;
    return camera;
}

/// Codes that decode exactly: a table of squares and exposures that are powers of two.
ResponseCurve squares()
{
    ResponseCurve curve;
    for (auto& table : curve.exposure)
        for (std::size_t z = 0; z < 256; ++z)
            table[z] = static_cast<double>(z * z) / 65536.0;
    return curve;
}

BracketFrame frameOf(std::initializer_list<int> codes, double exposure, int max_code = 255)
{
    BracketFrame frame;
    frame.name = "frame";
    frame.relative_exposure = exposure;
    frame.image.max_code = max_code;
    frame.image.codes = Image<glm::u16vec3>(static_cast<int>(codes.size()), 1);
    int x = 0;
    for (const int code : codes)
        frame.image.codes(x++, 0) = glm::u16vec3(static_cast<std::uint16_t>(code));
    return frame;
}

TEST(MergeBracket, ReturnsTheSceneWhenNothingIsLost)
{
    const Image<Rgb> scene = tiles(64, 48, 8, 0.02, 50.0);
    const SyntheticCamera camera = plainCamera(65535);
    const Bracket bracket = photograph(scene, {1.0, 0.25, 1.0 / 16, 1.0 / 64}, camera);
    const MergeResult merged = mergeBracket(bracket, tableOf(camera), {});
    EXPECT_EQ(merged.clipped_fraction, 0.0);
    EXPECT_TRUE(merged.findings.empty());
    for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
        for (int c = 0; c < 3; ++c) {
            const float truth = scene.pixels()[i][c];
            // Linear interpolation in a table of 256 entries: (dz/z)^2 / 8 near code 10.
            EXPECT_NEAR(merged.radiance.pixels.pixels()[i][c], truth, 2e-3 * truth) << i;
        }
    }
}

TEST(MergeBracket, DividesByTheRelativeExposure)
{
    const Bracket bracket = makeBracket({frameOf({64}, 0.5)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 64.0f * 64.0f / 65536.0f / 0.5f);
}

TEST(MergeBracket, ReadsSixteenBitCodesAsFractions)
{
    const Bracket bracket = makeBracket({frameOf({64 * 257 + 128}, 1.0, 65535)});
    const double z = (64 * 257 + 128) / 257.0;
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_NEAR(merged.radiance.pixels(0, 0).r, squares().decode(0, z), 1e-7);
}

TEST(MergeBracket, ClippedEverywhereIsTheShortestAndALowerBound)
{
    const Bracket bracket =
        makeBracket({frameOf({255, 128, 128, 128}, 4.0), frameOf({252, 64, 64, 64}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_EQ(merged.clipped(0, 0), 1);
    EXPECT_EQ(merged.clipped(3, 0), 0);
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 252.0f * 252.0f / 65536.0f);
    EXPECT_DOUBLE_EQ(merged.clipped_fraction, 0.25);
    EXPECT_TRUE(hasFinding(merged.findings, "merge-clipped"));
}

TEST(MergeBracket, BlackEverywhereIsTheLongest)
{
    const Bracket bracket = makeBracket({frameOf({3, 128}, 4.0), frameOf({2, 64}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 9.0f / 65536.0f / 4.0f);
    EXPECT_TRUE(merged.findings.empty());
}

// A gap in the bracket: too bright for the long frame, black in the short one. Black is an upper
// bound that is nearer than a clipped lower one.
TEST(MergeBracket, PrefersBlackToClipped)
{
    const Bracket bracket = makeBracket({frameOf({255, 128}, 1000.0), frameOf({2, 64}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 4.0f / 65536.0f);
    EXPECT_EQ(merged.clipped(0, 0), 0);
}

TEST(MergeBracket, AllClippedAndAllBlackAreFindings)
{
    const auto codes = [](std::initializer_list<int> z) { return makeBracket({frameOf(z, 1.0)}); };
    EXPECT_TRUE(
        hasFinding(mergeBracket(codes({255, 255}), squares(), {}).findings, "merge-all-clipped"));
    EXPECT_TRUE(hasFinding(mergeBracket(codes({0, 1}), squares(), {}).findings, "merge-all-black"));
}

// The long frame's pixel beside a clipped one has rung (code 180 for 160); the short frame is good.
TEST(MergeBracket, AvoidsPixelsBesideClippedOnes)
{
    const Bracket bracket =
        makeBracket({frameOf({160, 180, 255}, 4.0), frameOf({80, 80, 200}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    const float truth = 80.0f * 80.0f / 65536.0f;
    EXPECT_FLOAT_EQ(merged.radiance.pixels(1, 0).g, truth);
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, truth);
}

// But what the long frame alone shows is still better than nothing.
TEST(MergeBracket, UsesPixelsBesideClippedOnesWhenNothingElseIsGood)
{
    const Bracket bracket = makeBracket({frameOf({40, 255}, 1024.0), frameOf({1, 200}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 1600.0f / 65536.0f / 1024.0f);
}

// Dark, beside a lamp that clips the long frame: the short frame's code is noise and would mean a
// radiance a thousand times too high.
TEST(MergeBracket, DoesNotTakeNoiseInAShortFrameForLight)
{
    const Bracket bracket =
        makeBracket({frameOf({60, 255, 100}, 1024.0), frameOf({9, 200, 2}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 3600.0f / 65536.0f / 1024.0f);
}

// The rim of a lamp in a picture that was scaled down: the long frame mixes clipped and dark pixels
// to a middle code, the short one shows what is there.
TEST(MergeBracket, BelievesABrightShortFrameBesideALamp)
{
    const Bracket bracket =
        makeBracket({frameOf({100, 255, 255}, 1024.0), frameOf({120, 200, 200}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 14400.0f / 65536.0f);
}

// Weights t^2/var: the mean over many noisy pixels is unbiased and its spread is near that of the
// longest unclipped frame, not of the noisiest.
TEST(MergeBracket, IsUnbiasedAndAsQuietAsTheBestFrame)
{
    SyntheticCamera camera = plainCamera(65535);
    camera.read_variance = 1.5e-6;
    camera.shot_variance = 2.5e-4;
    const double truth = 0.5;
    const Image<Rgb> flat(200, 100, Rgb(static_cast<float>(truth)));
    const Bracket bracket = photograph(flat, {1.0, 0.25, 1.0 / 16}, camera);
    const MergeResult merged = mergeBracket(bracket, tableOf(camera), {});
    double sum = 0.0;
    double squares_sum = 0.0;
    for (const Rgb& pixel : merged.radiance.pixels.pixels()) {
        sum += pixel.g;
        squares_sum += static_cast<double>(pixel.g) * pixel.g;
    }
    const double n = static_cast<double>(flat.pixelCount());
    const double mean = sum / n;
    const double deviation = std::sqrt(squares_sum / n - mean * mean);
    const double best = std::sqrt(1.5e-6 + 2.5e-4 * truth);
    EXPECT_NEAR(mean, truth, 1e-3 * truth);  // fades at the ends of the codes leave 0.05 %
    EXPECT_LT(deviation, 1.02 * best);
}

TEST(MergeBracket, DoesNotDependOnTheNumberOfThreads)
{
    SyntheticCamera camera = plainCamera(255);
    camera.shot_variance = 2.5e-4;
    const Bracket bracket = photograph(tiles(64, 48, 8, 0.02, 50.0), {1.0, 0.25, 1.0 / 16}, camera);
    setThreadCount(1);
    const MergeResult one = mergeBracket(bracket, tableOf(camera), {});
    setThreadCount(4);
    const MergeResult four = mergeBracket(bracket, tableOf(camera), {});
    setThreadCount(0);
    EXPECT_EQ(one.radiance.pixels, four.radiance.pixels);
}

TEST(MergeBracket, RefusesBadOptions)
{
    MergeOptions options;
    options.clip_fraction = 0.4;
    options.black_fraction = 0.5;
    EXPECT_EQ(options.validate().size(), 2u);
    EXPECT_THROW((void)mergeBracket(makeBracket({frameOf({9}, 1.0)}), squares(), options),
                 InputError);
}

}  // namespace
}  // namespace insitu
