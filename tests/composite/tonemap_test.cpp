#include "composite/tonemap/operator.h"
#include "composite/tonemap/reinhard.h"
#include "core/color.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace insitu {
namespace {

Image<Rgb> mapWith(const ReinhardOptions& options, const Image<Rgb>& scene)
{
    Progress silent;
    return makeReinhard(options)->map(scene, silent);
}

/// Luminances over six decades, coloured.
Image<Rgb> wideScene(int width, int height)
{
    Image<Rgb> scene(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            RandomStream random(7, static_cast<std::uint64_t>(y * width + x), 0);
            const float level = std::pow(10.0f, 6.0f * random.uniform() - 3.0f);
            scene(x, y) = level * Rgb(random.uniform(), random.uniform(), random.uniform());
        }
    return scene;
}

// A grey card: the log average is the card itself, so L = key everywhere and equation 4 gives
// Ld = key (1 + key / white²) / (1 + key).
TEST(Reinhard, UniformSceneHasAClosedForm)
{
    ReinhardOptions options;
    options.key = 0.18;
    options.white = 2.0;
    const Image<Rgb> display = mapWith(options, Image<Rgb>(5, 4, Rgb(37.5f)));
    const double expected = 0.18 * (1.0 + 0.18 / 4.0) / 1.18;
    for (const Rgb& pixel : display.pixels())
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(pixel[c], expected, tolerance::kFloat);
}

// Luminances 1 and 100: log average 10, so L = key / 10 and 10 key. The white point is the brighter
// one by default, and Ld(white) = 1.
TEST(Reinhard, BrightestPixelBecomesWhiteAndNothingBurnsOut)
{
    Image<Rgb> scene(2, 1);
    scene(0, 0) = Rgb(1.0f);
    scene(1, 0) = Rgb(100.0f);
    ReinhardOptions options;
    options.key = 0.3;
    const Image<Rgb> display = mapWith(options, scene);
    const double dark = 0.03;
    EXPECT_NEAR(display(0, 0).g, dark * (1.0 + dark / 9.0) / (1.0 + dark), tolerance::kFloat);
    EXPECT_NEAR(display(1, 0).g, 1.0, tolerance::kFloat);
}

// The limit of a far white point is equation 3, L / (1 + L).
TEST(Reinhard, FarWhitePointIsTheSimpleCurve)
{
    ReinhardOptions options;
    options.key = 1.0;
    options.white = 1e9;
    const Image<Rgb> display = mapWith(options, Image<Rgb>(2, 2, Rgb(0.01f)));
    EXPECT_NEAR(display(1, 1).r, 0.5, tolerance::kFloat);
}

TEST(Reinhard, KeepsTheOrderOfLuminancesAndStaysInRange)
{
    Image<Rgb> ramp(200, 1);
    for (int x = 0; x < 200; ++x)
        ramp(x, 0) = Rgb(std::pow(10.0f, 0.03f * static_cast<float>(x)));
    const Image<Rgb> display = mapWith({}, ramp);
    for (int x = 0; x < 200; ++x) {
        EXPECT_GE(display(x, 0).r, 0.0f);
        EXPECT_LE(display(x, 0).r, 1.0f);
        if (x == 0) continue;
        EXPECT_GT(display(x, 0).r, display(x - 1, 0).r) << x;
    }
}

TEST(Reinhard, KeepsTheRatiosOfTheChannels)
{
    Image<Rgb> scene(2, 1, Rgb(1.0f));
    scene(0, 0) = Rgb(0.4f, 0.2f, 0.1f);
    const Rgb display = mapWith({}, scene)(0, 0);
    EXPECT_NEAR(display.r / display.g, 2.0, 2.0 * tolerance::kFloat);
    EXPECT_NEAR(display.g / display.b, 2.0, 2.0 * tolerance::kFloat);
}

// The unit of the scene does not matter, black pixels included.
TEST(Reinhard, DoesNotDependOnTheUnit)
{
    Image<Rgb> scene = wideScene(31, 17);
    scene(3, 3) = Rgb(0.0f);
    Image<Rgb> scaled = scene;
    for (Rgb& pixel : scaled.pixels())
        pixel *= 4096.0f;
    const Image<Rgb> display = mapWith({}, scene);
    const Image<Rgb> scaled_display = mapWith({}, scaled);
    for (std::size_t i = 0; i < display.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(scaled_display.pixels()[i][c], display.pixels()[i][c], tolerance::kFloat);
}

TEST(Reinhard, BlackAndEmptyScenesStayWhatTheyAre)
{
    const Image<Rgb> black(3, 2, Rgb(0.0f));
    EXPECT_EQ(mapWith({}, black), black);
    EXPECT_TRUE(mapWith({}, Image<Rgb>()).empty());
}

TEST(Reinhard, SameBitsForAnyNumberOfThreads)
{
    const Image<Rgb> scene = wideScene(64, 97);
    setThreadCount(1);
    const Image<Rgb> one = mapWith({}, scene);
    setThreadCount(0);
    EXPECT_EQ(mapWith({}, scene), one);
}

TEST(Reinhard, RefusesWhatIsNoRadiance)
{
    Image<Rgb> scene(2, 2, Rgb(1.0f));
    scene(1, 0).b = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW((void)mapWith({}, scene), InputError);
    scene(1, 0) = Rgb(1.0f, -0.5f, 1.0f);
    try {
        (void)mapWith({}, scene);
        FAIL() << "accepted a negative value";
    } catch (const InputError& error) {
        EXPECT_THAT(error.what(), testing::HasSubstr("pixel (1, 0)"));
    }
}

TEST(Reinhard, OptionsReportEveryProblemAtOnce)
{
    ReinhardOptions options;
    EXPECT_TRUE(options.validate().empty());
    options.key = 0.0;
    options.white = -1.0;
    const Findings findings = options.validate();
    EXPECT_TRUE(hasFinding(findings, "tonemap-key"));
    EXPECT_TRUE(hasFinding(findings, "tonemap-white"));
    EXPECT_THROW((void)makeReinhard(options), InputError);
}

// Code 118 is what IEC 61966-2-1 gives for 18.1 %; outside [0, 1] is clamped.
TEST(EncodeSrgb, FollowsTheStandardAndClamps)
{
    Image<Rgb> display(2, 1);
    display(0, 0) = Rgb(0.0f, static_cast<float>(linearFromSrgb(118.0 / 255.0)), 1.0f);
    display(1, 0) = Rgb(-0.5f, 2.0f, 0.5f);
    const EncodedImage codes = encodeSrgb(display);
    EXPECT_EQ(codes.codes(0, 0), glm::u16vec3(0, 118, 255));
    EXPECT_EQ(codes.codes(1, 0), glm::u16vec3(0, 255, 188));
    EXPECT_EQ(encodeSrgb(display, 65535).codes(1, 0), glm::u16vec3(0, 65535, 48192));
}

}  // namespace
}  // namespace insitu
