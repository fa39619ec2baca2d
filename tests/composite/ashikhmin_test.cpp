#include "composite/tonemap/ashikhmin.h"

#include "composite/tonemap/neighbourhood_kernel.h"
#include "composite/tonemap/patch_reader.h"
#include "tests/support/ashikhmin_direct.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"
#include "tests/support/tone_scenes.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace insitu {
namespace {

Image<Rgb> mapped(const Image<Rgb>& scene, const AshikhminOptions& options = {})
{
    Progress silent;
    return makeAshikhmin(options)->map(scene, silent);
}

/// RMS of the display luminance's difference from direct evaluation, as a share of the white.
double rmsFromDirect(const Image<Rgb>& scene, const AshikhminOptions& options = {})
{
    const Image<Rgb> display = mapped(scene, options);
    const Image<double> expected = direct::displayLuminance(scene, options);
    double sum = 0.0;
    std::size_t counted = 0;
    for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
        const Rgb& pixel = display.pixels()[i];
        if (std::max({pixel.r, pixel.g, pixel.b}) >= 1.0f) continue;  // a channel was cut off
        const double difference = static_cast<double>(luminance(pixel)) - expected.pixels()[i];
        sum += difference * difference;
        ++counted;
    }
    EXPECT_GT(counted, scene.pixelCount() / 2);
    return std::sqrt(sum / static_cast<double>(counted));
}

// The project's bound on the fast evaluation: 0.01 % of the display's white.
constexpr double kFastRms = 1e-4;

TEST(Ashikhmin, EqualsADirectEvaluationInARoom)
{
    EXPECT_LT(rmsFromDirect(tone_scenes::room(601, 403)), kFastRms);
}

TEST(Ashikhmin, EqualsADirectEvaluationOfNoise)
{
    EXPECT_LT(rmsFromDirect(tone_scenes::noise(301, 203, 1.0f)), kFastRms);
    EXPECT_LT(rmsFromDirect(tone_scenes::noise(150, 130, 4.0f)), kFastRms);
}

// A threshold of 0.2 is crossed at coarser scales.
TEST(Ashikhmin, EqualsADirectEvaluationWithAnotherThreshold)
{
    AshikhminOptions options;
    options.contrast_threshold = 0.2;
    options.viewing.scene_white_cd_m2 = 5.0;
    options.viewing.display_white_cd_m2 = 250.0;
    EXPECT_LT(rmsFromDirect(tone_scenes::room(301, 203), options), kFastRms);
}

// Continuity: what is chosen between scales may not jump, so a scene that is moved by a pixel gives
// the picture moved by a pixel wherever the border and the range do not change.
TEST(Ashikhmin, TilesLeaveNoTrace)
{
    constexpr int kShift = 4;  // coarse levels lie at multiples of 4
    const Image<Rgb> scene = tone_scenes::room(1200, 560);
    Image<Rgb> moved(scene.width() + kShift, scene.height() + kShift, scene(0, 0));
    for (int y = 0; y < scene.height(); ++y)
        for (int x = 0; x < scene.width(); ++x)
            moved(x + kShift, y + kShift) = scene(x, y);
    Progress silent;
    const SceneStatistics statistics = measureScene(scene);
    const auto tone_map = makeAshikhmin();
    const Image<Rgb> here = tone_map->map(scene, statistics, silent);
    const Image<Rgb> there = tone_map->map(moved, statistics, silent);
    // The added border reaches as far as the halo.
    for (int y = 100; y < scene.height(); ++y)
        for (int x = 100; x < scene.width(); ++x)
            ASSERT_EQ(here(x, y), there(x + kShift, y + kShift)) << x << ", " << y;
}

TEST(Ashikhmin, AllInstructionSetsGiveTheSameBits)
{
    const Image<Rgb> scene = tone_scenes::room(157, 131);
    const LuminancePatch patch =
        tonemap::readPatch(SceneStrip(scene), 0, 0, 512, 256, tonemap::kNeighbourhoodHalo, 30.0f);
    const WantedBlocks blocks{3, std::vector<std::uint8_t>(27, 1)};
    const auto adapted = [&](InstructionSet set) {
        std::vector<float> result(static_cast<std::size_t>(patch.width * patch.height));
        tonemap::adaptToNeighbourhood(set, patch, blocks, 0.5f, result.data());
        return result;
    };
    const std::vector<float> base = adapted(InstructionSet::Base);
    for (int set = 1; set <= static_cast<int>(bestInstructionSet()); ++set)
        EXPECT_EQ(adapted(static_cast<InstructionSet>(set)), base) << set;
}

TEST(Ashikhmin, SameBitsForAnyNumberOfThreads)
{
    const Image<Rgb> scene = tone_scenes::room(700, 600);
    setThreadCount(1);
    const Image<Rgb> one = mapped(scene);
    setThreadCount(0);
    EXPECT_EQ(mapped(scene), one);
}

// The curve alone: extremes of the scene become the display's black and white, and a wide plain
// field adapts to itself.
TEST(Ashikhmin, ExtremesBecomeBlackAndWhite)
{
    AshikhminOptions options;
    options.viewing.scene_white_cd_m2 = 1.0;
    Image<Rgb> scene(400, 200, Rgb(0.01f));
    for (int y = 0; y < 200; ++y)
        for (int x = 200; x < 400; ++x)
            scene(x, y) = Rgb(1000.0f);
    const Image<Rgb> display = mapped(scene, options);
    EXPECT_NEAR(display(20, 100).g, 0.0, tolerance::kFloat);
    EXPECT_NEAR(display(380, 100).g, 1.0, tolerance::kFloat);
    // Next to the edge no halo: neighbourhoods end before they reach over it.
    EXPECT_LT(display(198, 100).g, 0.02f);
}

// Far from any edge, TM(L) of the printed constants: C(20) = 32.0693 + ln(20 / 7.2444) / 0.0556.
TEST(Ashikhmin, PlainFieldFollowsTheCapacityCurve)
{
    AshikhminOptions options;
    options.viewing.scene_white_cd_m2 = 1.0;
    Image<Rgb> scene(600, 200, Rgb(20.0f));
    for (int y = 0; y < 200; ++y)
        for (int x = 0; x < 200; ++x) {
            scene(x, y) = Rgb(0.0f);
            scene(x + 400, y) = Rgb(2000.0f);
        }
    const double expected = (32.0693 + std::log(20.0 / 7.2444) / 0.0556) /
                            (32.0693 + std::log(2000.0 / 7.2444) / 0.0556);
    EXPECT_NEAR(mapped(scene, options)(300, 100).g, expected, tolerance::kFloat);
}

TEST(Ashikhmin, CapacityIsTheIntegralOfTheThreshold)
{
    EXPECT_NEAR(visibleThreshold(100.0), 5.56, tolerance::kDouble);
    EXPECT_NEAR(visibleThreshold(0.001), 0.0014, tolerance::kDouble);
    // The constants are printed with four digits and a step at 0.0034; a check by differences.
    for (const double l : {0.001, 0.02, 0.5, 3.0, 50.0, 3000.0}) {
        const double h = 1e-4 * l;
        const double slope = (perceptualCapacity(l + h) - perceptualCapacity(l - h)) / (2.0 * h);
        EXPECT_NEAR(slope * visibleThreshold(l), 1.0, 1e-7) << l;  // second order in h
    }
    for (const double corner : {1.0, 7.2444})
        EXPECT_NEAR(perceptualCapacity(corner * (1.0 - 1e-12)), perceptualCapacity(corner), 1e-3);
}

TEST(Ashikhmin, HardScenes)
{
    EXPECT_TRUE(mapped({}).empty());
    EXPECT_EQ(mapped(Image<Rgb>(9, 7, Rgb(0.0f))), Image<Rgb>(9, 7, Rgb(0.0f)));
    const Image<Rgb> plain = mapped(Image<Rgb>(1, 1, Rgb(37.0f)));
    EXPECT_NEAR(plain(0, 0).g, 0.18, tolerance::kFloat);
    EXPECT_NEAR(mapped(Image<Rgb>(40, 30, Rgb(37.0f)))(39, 29).g, 0.18, tolerance::kFloat);

    // 1e8 : 1 in neighbouring pixels, lines of one pixel's width, black beside light.
    for (const auto& [width, height] : {std::pair{1, 10000}, {10000, 1}, {3, 5}}) {
        Image<Rgb> scene(width, height);
        for (std::size_t i = 0; i < scene.pixelCount(); ++i)
            scene.pixels()[i] = Rgb(std::pow(10.0f, static_cast<float>((i * 7) % 9) - 4.0f));
        scene.pixels()[1] = Rgb(0.0f);
        const Image<Rgb> display = mapped(scene);
        ASSERT_EQ(display.pixelCount(), scene.pixelCount());
        for (const Rgb& pixel : display.pixels())
            for (int c = 0; c < 3; ++c) {
                ASSERT_GE(pixel[c], 0.0f);
                ASSERT_LE(pixel[c], 1.0f);
            }
        EXPECT_EQ(display.pixels()[1], Rgb(0.0f));
    }
}

TEST(Ashikhmin, RefusesWhatIsNoRadiance)
{
    Image<Rgb> scene(70, 40, Rgb(1.0f));
    scene(66, 39).b = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THAT(inputErrorOf([&] { (void)mapped(scene); }), testing::HasSubstr("pixel (66, 39)"));
    scene(66, 39).b = -1.0f;
    EXPECT_THAT(inputErrorOf([&] { (void)mapped(scene); }), testing::HasSubstr("pixel (66, 39)"));
    scene(66, 39).b = std::numeric_limits<float>::infinity();
    EXPECT_THAT(inputErrorOf([&] { (void)mapped(scene); }), testing::HasSubstr("pixel (66, 39)"));
}

TEST(Ashikhmin, OptionsReportEveryProblemAtOnce)
{
    AshikhminOptions options;
    EXPECT_TRUE(options.validate().empty());
    options.contrast_threshold = 1.0;
    options.viewing.scene_white_cd_m2 = 0.0;
    options.viewing.display_white_cd_m2 = -1.0;
    const Findings findings = options.validate();
    EXPECT_TRUE(hasFinding(findings, "tonemap-contrast-threshold"));
    EXPECT_TRUE(hasFinding(findings, "tonemap-scene-white"));
    EXPECT_TRUE(hasFinding(findings, "tonemap-display-white"));
    EXPECT_THROW((void)makeAshikhmin(options), InputError);
}

}  // namespace
}  // namespace insitu
