#include "capture/hdr_merge.h"

#include "capture/clipped_source.h"
#include "core/parallel.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <limits>

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

std::vector<std::string> codesOf(const Findings& findings)
{
    std::vector<std::string> codes;
    for (const Finding& finding : findings)
        codes.push_back(finding.code);
    return codes;
}

TEST(MergeBracket, ReturnsTheSceneWhenNothingIsLost)
{
    const Image<Rgb> scene = tiles(64, 48, 8, 0.02, 50.0);
    const SyntheticCamera camera = plainCamera(65535);
    const Bracket bracket = photograph(scene, {1.0, 0.25, 1.0 / 16, 1.0 / 64}, camera);
    const MergeResult merged = mergeBracket(bracket, tableOf(camera), {});
    EXPECT_EQ(merged.clipped_fraction, 0.0);
    EXPECT_THAT(codesOf(merged.findings), testing::ElementsAre("noise-model-assumed"));
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
    EXPECT_TRUE(merged.validity(0, 0) & kMergeClipped);
    EXPECT_FALSE(merged.validity(3, 0) & kMergeClipped);
    EXPECT_EQ(merged.validity(0, 0), kMergeClipped);
    EXPECT_FLOAT_EQ(merged.variance(0, 0).g, std::pow(252.0f * 252.0f / 65536.0f, 2.0f));
    // Beside it, no frame is clear: believed, and said so. Two pixels away one is.
    EXPECT_EQ(merged.validity(1, 0), kMergeUnconfirmed);
    EXPECT_EQ(merged.validity(2, 0), 0);
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 252.0f * 252.0f / 65536.0f);
    EXPECT_DOUBLE_EQ(merged.clipped_fraction, 0.25);
    EXPECT_TRUE(hasFinding(merged.findings, "merge-clipped"));
}

TEST(MergeBracket, BlackEverywhereIsTheLongest)
{
    const Bracket bracket = makeBracket({frameOf({3, 128}, 4.0), frameOf({2, 64}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 9.0f / 65536.0f / 4.0f);
    EXPECT_EQ(merged.validity(0, 0), kMergeBlack | kMergeSingleFrame);
    EXPECT_EQ(merged.validity(1, 0), 0);
    EXPECT_THAT(codesOf(merged.findings), testing::ElementsAre("noise-model-assumed"));
}

// A gap in the bracket: too bright for the long frame, black in the short one. Black is an upper
// bound that is nearer than a clipped lower one.
TEST(MergeBracket, PrefersBlackToClipped)
{
    const Bracket bracket = makeBracket({frameOf({255, 128}, 1000.0), frameOf({2, 64}, 1.0)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_FLOAT_EQ(merged.radiance.pixels(0, 0).g, 4.0f / 65536.0f);
    EXPECT_FALSE(merged.validity(0, 0) & kMergeClipped);
}

TEST(MergeBracket, AllClippedAndAllBlackAreFindings)
{
    const auto codes = [](std::initializer_list<int> z) { return makeBracket({frameOf(z, 1.0)}); };
    EXPECT_TRUE(
        hasFinding(mergeBracket(codes({255, 255}), squares(), {}).findings, "merge-all-clipped"));
    EXPECT_TRUE(hasFinding(mergeBracket(codes({0, 1}), squares(), {}).findings, "merge-all-black"));
}

// A JPEG shares colour between neighbours: beside a clipped red, a green of 220 in the shortest
// frame may be clipped too, a blue of 100 is not.
TEST(MergeBracket, ABrightCodeBesideAClippedChannelIsALowerBound)
{
    Bracket bracket = makeBracket({frameOf({255}, 4.0), frameOf({255}, 1.0)});
    bracket.frames[1].image.codes(0, 0) = glm::u16vec3(255, 220, 100);
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    const auto squared = [](float v) { return v * v; };
    const Rgb radiance = merged.radiance.pixels(0, 0);
    EXPECT_FLOAT_EQ(merged.variance(0, 0).g, squared(radiance.g));
    EXPECT_LT(merged.variance(0, 0).b, 0.01f * squared(radiance.b));
    bracket.frames[1].image.codes(0, 0).y = 190;
    EXPECT_LT(mergeBracket(bracket, squares(), {}).variance(0, 0).g, 0.01f * squared(radiance.g));
}

// A lamp with hardly any blue: red is clipped, blue is measured and must not be scaled with it.
TEST(ClippedPart, HoldsTheChannelsThatAreLowerBounds)
{
    Bracket bracket = makeBracket({frameOf({255, 128}, 4.0), frameOf({255, 64}, 1.0)});
    for (BracketFrame& frame : bracket.frames)
        frame.image.codes(0, 0) = glm::u16vec3(255, 255, 40);
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    const Image<Rgb> clipped = clippedPart(merged);
    const Rgb radiance = merged.radiance.pixels(0, 0);
    EXPECT_EQ(clipped(0, 0), Rgb(radiance.r, radiance.g, 0.0f));
    EXPECT_EQ(clipped(1, 0), Rgb(0.0f));
    EXPECT_TRUE(
        clippedPart(mergeBracket(makeBracket({frameOf({128}, 1.0)}), squares(), {})).empty());
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

// Both frames are good but disagree by some percent, as with a response that is not quite right:
// the long one's share falls to nothing towards its limit, code 249, so that no step shows there.
TEST(MergeBracket, AFrameFadesOutBeforeItClips)
{
    const auto shareOfTheLong = [](int long_code) {
        const Bracket bracket = makeBracket({frameOf({long_code}, 4.0), frameOf({120}, 1.0)});
        const auto radiance = [](int code, double exposure) {
            return static_cast<double>(code * code) / 65536.0 / exposure;
        };
        const MergeResult merged = mergeBracket(bracket, squares(), {});
        const double of_short = radiance(120, 1.0);
        return (static_cast<double>(merged.radiance.pixels(0, 0).g) - of_short) /
               (radiance(long_code, 4.0) - of_short);
    };
    EXPECT_GT(shareOfTheLong(244), 0.7);
    EXPECT_LT(shareOfTheLong(248), 0.9 * shareOfTheLong(244));
    EXPECT_LT(shareOfTheLong(249), 0.5 * shareOfTheLong(244));
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
    Bracket bracket = photograph(tiles(64, 48, 8, 0.02, 50.0), {1.0, 0.25, 1.0 / 16}, camera);
    bracket.frames[1].excluded = Image<std::uint8_t>(64, 48);
    for (int y = 10; y < 40; ++y)
        bracket.frames[1].excluded(y, y) = 1;
    setThreadCount(1);
    const MergeResult one = mergeBracket(bracket, tableOf(camera), {});
    setThreadCount(4);
    const MergeResult four = mergeBracket(bracket, tableOf(camera), {});
    setThreadCount(0);
    EXPECT_EQ(one.radiance.pixels, four.radiance.pixels);
    EXPECT_EQ(one.variance, four.variance);
    EXPECT_EQ(one.validity, four.validity);
}

/// Pixels within float rounding of each other.
void expectSame(const MergeResult& a, const MergeResult& b)
{
    ASSERT_TRUE(a.radiance.pixels.sameSize(b.radiance.pixels));
    for (std::size_t i = 0; i < a.radiance.pixels.pixelCount(); ++i) {
        for (int c = 0; c < 3; ++c) {
            const float radiance = a.radiance.pixels.pixels()[i][c];
            const float variance = a.variance.pixels()[i][c];
            EXPECT_NEAR(b.radiance.pixels.pixels()[i][c], radiance, tolerance::kFloat * radiance);
            EXPECT_NEAR(b.variance.pixels()[i][c], variance, tolerance::kFloat * variance) << i;
        }
    }
}

/// Four frames of tiles from black to clipped, and the same bracket without frame `without`.
struct Exclusion {
    Bracket all;
    Bracket rest;
    ResponseCurve response;
    MergeOptions options;

    explicit Exclusion(std::size_t without)
    {
        SyntheticCamera camera = plainCamera(255);
        camera.shot_variance = 2.5e-4;
        response = tableOf(camera);
        options.noise = assumedNoise(response, 800.0, 255);
        all = photograph(tiles(64, 48, 8, 0.02, 50.0), {1.0, 0.25, 1.0 / 16, 1.0 / 64}, camera);
        rest = all;
        rest.frames.erase(rest.frames.begin() + static_cast<std::ptrdiff_t>(without));
    }
};

TEST(MergeBracket, ExcludedPixelsAreAsIfTheFrameWereNotThere)
{
    for (const std::size_t without : {0u, 1u, 3u}) {
        Exclusion given(without);
        given.all.frames[without].excluded = Image<std::uint8_t>(64, 48, 1);
        const MergeResult merged = mergeBracket(given.all, given.response, given.options);
        expectSame(merged, mergeBracket(given.rest, given.response, given.options));
        for (const std::uint8_t flags : merged.validity.pixels())
            EXPECT_TRUE(flags & kMergeExcluded);
    }
}

TEST(MergeBracket, ExcludesOnlyWhereTheMaskSaysSo)
{
    Exclusion given(1);
    const MergeResult plain = mergeBracket(given.all, given.response, given.options);
    given.all.frames[1].excluded = Image<std::uint8_t>(64, 48);
    given.all.frames[1].excluded(20, 30) = 1;
    MergeResult merged = mergeBracket(given.all, given.response, given.options);
    EXPECT_EQ(merged.validity(20, 30), plain.validity(20, 30) | kMergeExcluded);
    const float change = merged.radiance.pixels(20, 30).g - plain.radiance.pixels(20, 30).g;
    EXPECT_GT(std::abs(change), 1e-4f * plain.radiance.pixels(20, 30).g);  // noise, not rounding
    merged.radiance.pixels(20, 30) = plain.radiance.pixels(20, 30);
    EXPECT_EQ(merged.radiance.pixels, plain.radiance.pixels);
}

TEST(MergeBracket, MasksOfEveryFrameAreNotFollowed)
{
    Exclusion given(1);
    const MergeResult plain = mergeBracket(given.all, given.response, given.options);
    for (BracketFrame& frame : given.all.frames)
        frame.excluded = Image<std::uint8_t>(64, 48, 1);
    expectSame(mergeBracket(given.all, given.response, given.options), plain);
}

TEST(MergeBracket, MasksMustFit)
{
    Exclusion given(1);
    given.all.frames[2].excluded = Image<std::uint8_t>(9, 9);
    EXPECT_THROW((void)mergeBracket(given.all, given.response, given.options), LogicError);
}

TEST(MergeBracket, WhiteAndBlackFramesAddNothingAndAreNamed)
{
    const Exclusion given(0);
    Bracket bracket = given.all;
    const auto frameLike = [&](int code, double exposure, const char* name) {
        BracketFrame frame = bracket.frames.front();
        frame.name = name;
        frame.relative_exposure = exposure;
        frame.image.codes =
            Image<glm::u16vec3>(64, 48, glm::u16vec3(static_cast<std::uint16_t>(code)));
        return frame;
    };
    bracket.frames.insert(bracket.frames.begin(), frameLike(255, 1000.0, "white"));
    bracket.frames.push_back(frameLike(0, 1e-6, "black"));
    const MergeResult merged = mergeBracket(bracket, given.response, given.options);
    ASSERT_TRUE(hasFinding(merged.findings, "merge-useless-exposure"));
    EXPECT_THAT(merged.findings.back().message, testing::HasSubstr("everywhere: white; black: "));
    expectSame(merged, mergeBracket(given.all, given.response, given.options));
    EXPECT_FALSE(hasFinding(mergeBracket(given.all, given.response, given.options).findings,
                            "merge-useless-exposure"));
}

TEST(MergeBracket, AChannelWithoutLightIsZero)
{
    Image<Rgb> scene = tiles(64, 48, 8, 0.02, 5.0);
    for (Rgb& pixel : scene.pixels())
        pixel.b = 0.0f;
    const SyntheticCamera camera = plainCamera(255);
    const MergeResult merged =
        mergeBracket(photograph(scene, {1.0, 0.25, 1.0 / 16}, camera), tableOf(camera), {});
    for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
        EXPECT_NEAR(merged.radiance.pixels.pixels()[i].b, 0.0f, 1e-6f);
        EXPECT_GT(merged.variance.pixels()[i].b, 0.0f);
        EXPECT_FALSE(merged.validity.pixels()[i] & kMergeBlack);  // the others are not
    }
}

TEST(MergeBracket, TakesALinearResponse)
{
    SyntheticCamera camera = plainCamera(65535);
    camera.curve = [](int, double e) { return e; };
    const Image<Rgb> scene = tiles(64, 48, 8, 0.1, 50.0);
    const MergeResult merged = mergeBracket(
        photograph(scene, {1.0, 0.25, 1.0 / 16, 1.0 / 64}, camera), tableOf(camera), {});
    for (std::size_t i = 0; i < scene.pixelCount(); ++i)
        EXPECT_NEAR(merged.radiance.pixels.pixels()[i].g,
                    scene.pixels()[i].g,
                    1e-4f * scene.pixels()[i].g);  // half a 16-bit code at codes above 5000
}

TEST(MergeBracket, MixesEightAndSixteenBits)
{
    const Bracket bracket =
        makeBracket({frameOf({64}, 0.5, 255), frameOf({32 * 257}, 0.125, 65535)});
    const MergeResult merged = mergeBracket(bracket, squares(), {});
    EXPECT_NEAR(merged.radiance.pixels(0, 0).g, 64.0 * 64.0 / 65536.0 / 0.5, 1e-7);
}

TEST(MergeBracket, UsesTheNoiseItIsGiven)
{
    const Bracket bracket = makeBracket({frameOf({64}, 0.5)});
    MergeOptions options;
    options.noise = NoiseModel{};
    options.noise->channels[1] = {0.0, 1e-3, 1e-9, 0.0};
    const MergeResult merged = mergeBracket(bracket, squares(), options);
    EXPECT_NEAR(merged.variance(0, 0).g, 1e-3 * 4096.0 / 65536.0 / 0.25, 1e-9);
    EXPECT_EQ(merged.noise.channels[1].gain, 1e-3);
    EXPECT_FALSE(hasFinding(merged.findings, "noise-model-assumed"));
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

TEST(MergeBracket, RefusesAResponseThatIsNone)
{
    const Bracket bracket = makeBracket({frameOf({9}, 1.0)});
    ResponseCurve flat = squares();
    flat.exposure[1][100] = flat.exposure[1][99];
    EXPECT_THROW((void)mergeBracket(bracket, flat, {}), InputError);
    ResponseCurve endless = squares();
    endless.exposure[2][255] = std::numeric_limits<double>::infinity();
    EXPECT_THROW((void)mergeBracket(bracket, endless, {}), InputError);
    MergeOptions options;
    options.noise = NoiseModel{};
    options.noise->channels[0].code_variance = 0.0;
    EXPECT_THROW((void)mergeBracket(bracket, squares(), options), InputError);
}

}  // namespace
}  // namespace insitu
