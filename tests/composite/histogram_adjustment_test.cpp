#include "composite/tonemap/histogram_adjustment.h"

#include "composite/tonemap/acuity_pyramid.h"
#include "composite/tonemap/eye_model.h"
#include "composite/tonemap/foveal_image.h"
#include "composite/tonemap/histogram_curve.h"
#include "core/color.h"
#include "core/parallel.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"
#include "tests/support/tone_scenes.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {
namespace {

/// One unit of the scenes is one cd/m².
HistogramAdjustmentOptions absolute()
{
    HistogramAdjustmentOptions options;
    options.viewing.scene_white_cd_m2 = 1.0;
    return options;
}

Image<Rgb> mapped(const Image<Rgb>& scene, const HistogramAdjustmentOptions& options = absolute())
{
    Progress silent;
    return makeHistogramAdjustment(options)->map(scene, silent);
}

// Values of the published pieces at their corners and in their straight parts.
TEST(EyeModel, ThresholdsAndAcuityAreThePublishedOnes)
{
    EXPECT_NEAR(justNoticeableDifference(1e-5), std::pow(10.0, -2.86), tolerance::kDouble);
    EXPECT_NEAR(justNoticeableDifference(0.1), std::pow(10.0, -1.395), tolerance::kDouble);
    EXPECT_NEAR(justNoticeableDifference(1000.0), std::pow(10.0, 1.745), 1e-9);
    // The fit's pieces, printed with three digits, meet within 3 %.
    for (const double log : {-3.94, -1.44, -0.0184, 1.9}) {
        const double below = justNoticeableDifference(std::pow(10.0, log - 1e-9));
        EXPECT_NEAR(justNoticeableDifference(std::pow(10.0, log + 1e-9)) / below, 1.0, 0.03);
    }
    EXPECT_NEAR(acuity(1.0), 17.25 * std::atan(0.35) + 25.72, tolerance::kDouble);
    EXPECT_GT(acuity(1000.0), 48.0);  // Shaler: about 50 cycles per degree by day
    EXPECT_LT(acuity(0.001), 4.0);    // and 2 to 3 by starlight
}

TEST(EyeModel, RodsAndCones)
{
    EXPECT_EQ(coneShare(0.005), 0.0);
    EXPECT_EQ(coneShare(6.0), 1.0);
    EXPECT_NEAR(coneShare(0.5 * (0.0056 + 5.6)), 0.5, tolerance::kDouble);
    // D65 white: X, Y, Z = 0.9505, 1, 1.089.
    EXPECT_NEAR(scotopicLuminance(Rgb(1.0f)), 1.33 * (1.0 + 2.089 / 0.9505) - 1.68, 2e-3);
    // Rods see blue as bright and red as dark, of equal luminance.
    const auto ofLuminanceOne = [](const Rgb& c) { return c / luminance(c); };
    EXPECT_GT(scotopicLuminance(ofLuminanceOne(Rgb(0.0f, 0.0f, 1.0f))),
              3.0 * scotopicLuminance(ofLuminanceOne(Rgb(1.0f, 0.0f, 0.0f))));
}

Image<Rgb> fovealOf(const Image<Rgb>& scene, double field)
{
    tonemap::FovealImage foveal(scene.width(), scene.height(), field);
    foveal.add(SceneStrip(scene));
    return foveal.image();
}

TEST(FovealImage, HasAPixelADegreeAndKeepsTheMean)
{
    const Image<Rgb> scene = tone_scenes::noise(640, 480, 3.0f);
    const double field = 60.0 * std::numbers::pi / 180.0;
    const Image<Rgb> foveal = fovealOf(scene, field);
    EXPECT_EQ(foveal.width(), 66);  // 2 tan(30°) / 0.01745 = 66.2
    EXPECT_EQ(foveal.height(), 50);
    const auto meanOf = [](const Image<Rgb>& image) {
        glm::dvec3 sum(0.0);
        for (const Rgb& pixel : image.pixels())
            sum += glm::dvec3(pixel);
        return sum / static_cast<double>(image.pixelCount());
    };
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(meanOf(foveal)[c] / meanOf(scene)[c], 1.0, tolerance::kFloat);
    EXPECT_EQ(fovealOf(Image<Rgb>(3, 2, Rgb(1.0f)), field).width(), 3);
}

// Against the sum itself, weights cos(angle) / angle² over all other places.
TEST(VeilingLuminance, EqualsTheDirectSum)
{
    const Image<Rgb> foveal = tone_scenes::noise(50, 31, 4.0f);
    const tonemap::VeilKernel kernel(50, 31);
    const Image<Rgb> veil = kernel.veil(foveal);
    for (const auto& [x, y] : {std::pair{0, 0}, {49, 30}, {25, 15}, {3, 28}}) {
        glm::dvec3 sum(0.0);
        double weights = 0.0;
        for (int v = 0; v < foveal.height(); ++v)
            for (int u = 0; u < foveal.width(); ++u) {
                const double degrees = std::hypot(u - x, v - y);
                if (degrees == 0.0 || degrees >= 90.0) continue;
                const double weight = std::cos(degrees * 0.01745) / (degrees * degrees);
                sum += weight * glm::dvec3(foveal(u, v));
                weights += weight;
            }
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(veil(x, y)[c] / (sum[c] / weights), 1.0, tolerance::kQuadrature);
    }
    EXPECT_EQ(tonemap::VeilKernel(1, 1).veil(Image<Rgb>(1, 1, Rgb(2.0f)))(0, 0), Rgb(2.0f));
    EXPECT_FALSE(kernel.isFor(Image<Rgb>(31, 50)));
    EXPECT_THROW((void)kernel.veil(Image<Rgb>(31, 50)), LogicError);
}

// Light from 89 degrees away scatters a little, from 91 none.
TEST(VeilingLuminance, EndsAtARightAngle)
{
    Image<Rgb> foveal(130, 3, Rgb(0.0f));
    foveal(0, 1) = Rgb(1e6f);
    const Image<Rgb> veil = tonemap::VeilKernel(130, 3).veil(foveal);
    double weights = 0.0;
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 130; ++x) {
            const double degrees = std::hypot(x - 89, y - 1);
            if (degrees > 0.0 && degrees < 90.0)
                weights += std::cos(degrees * 0.01745) / (degrees * degrees);
        }
    const double expected = 1e6 * std::cos(89.0 * 0.01745) / (89.0 * 89.0) / weights;
    EXPECT_NEAR(veil(89, 1).g, expected, 0.05 * expected);
    EXPECT_LT(veil(91, 1).g, 0.05 * expected);
}

TEST(AcuityPyramid, LevelsAreMeansAndBlendBetween)
{
    Image<Rgb> scene(8, 8);
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 8; ++x)
            scene(x, y) = Rgb((x + y) % 2 == 0 ? 1.0f : 0.0f);
    const tonemap::AcuityPyramid pyramid(SceneStrip(scene), 3);
    EXPECT_EQ(pyramid.sample(2, 2, 0.0f), Rgb(1.0f));
    EXPECT_NEAR(pyramid.sample(2, 2, 1.0f).g, 0.5, tolerance::kFloat);
    EXPECT_NEAR(pyramid.sample(2, 2, 0.5f).g, 0.75, tolerance::kFloat);
    EXPECT_NEAR(pyramid.sample(2, 2, 9.0f).g, 0.5, tolerance::kFloat);
}

// Equation 5.6: nowhere is the curve steeper than the ratio of the thresholds.
TEST(HistogramCurve, ShowsNoContrastThatTheSceneDoesNot)
{
    std::vector<float> adaptation;
    for (int i = 0; i < 6000; ++i)  // two crowds of luminances, five decades apart, and between
        adaptation.push_back(std::pow(10.0f,
                                      (i % 3 == 0   ? 3.0f
                                       : i % 3 == 1 ? -2.0f
                                                    : -1.0f + 0.0005f * static_cast<float>(i)) +
                                          0.0001f * static_cast<float>(i % 1000)));
    const tonemap::HistogramCurve curve = tonemap::histogramCurve(adaptation, 1.0, 100.0);
    double steepest = 0.0;
    for (std::size_t i = 0; i + 1 < curve.display.size(); ++i) {
        const double low = std::exp(curve.log_first + static_cast<double>(i) * curve.log_step);
        const double high = low * std::exp(curve.log_step);
        // Display values are from black to white; in cd/m².
        const double shown_low = 1.0 + 99.0 * static_cast<double>(curve.display[i]);
        const double shown_high = 1.0 + 99.0 * static_cast<double>(curve.display[i + 1]);
        const double slope = (shown_high - shown_low) / (high - low);
        const double allowed = justNoticeableDifference(0.5 * (shown_low + shown_high)) /
                               justNoticeableDifference(std::sqrt(low * high));
        steepest = std::max(steepest, slope / allowed);
        EXPECT_GE(curve.display[i + 1], curve.display[i]);
    }
    // Counts are cut until 2.5 % of all are left above the ceiling, and bins are 12 % wide.
    EXPECT_LT(steepest, 1.25);
    EXPECT_GT(steepest, 0.8);
    EXPECT_EQ(curve.display.front(), 0.0f);
    EXPECT_LE(curve.display.back(), 1.0f);
}

// A scene within the display's range is shown as it is: a straight line.
TEST(HistogramCurve, LeavesWhatTheDisplayCanShowAlone)
{
    std::vector<float> adaptation;
    for (int i = 0; i < 1000; ++i)
        adaptation.push_back(20.0f + 0.03f * static_cast<float>(i));
    const tonemap::HistogramCurve curve = tonemap::histogramCurve(adaptation, 1.0, 100.0);
    const double exposure = justNoticeableDifference(50.0);
    const auto at = [&](double luminance) {
        const auto i = static_cast<std::size_t>(
            std::lround((std::log(luminance) - curve.log_first) / curve.log_step));
        return static_cast<double>(curve.display[i]) /
               std::exp(curve.log_first + static_cast<double>(i) * curve.log_step);
    };
    EXPECT_NEAR(at(30.0) / at(45.0), 1.0, tolerance::kFloat);
    EXPECT_GT(at(30.0), 0.0);
    EXPECT_GT(exposure, 0.0);
}

// Dark scenes are shown dark: the exposure of the thresholds.
TEST(HistogramAdjustment, NightIsDarkerThanDay)
{
    Image<Rgb> day = tone_scenes::room(160, 120);
    Image<Rgb> night = day;
    for (Rgb& pixel : day.pixels())
        pixel *= 100.0f;
    for (Rgb& pixel : night.pixels())
        pixel *= 1e-5f;
    const auto largest = [](const Image<Rgb>& display) {
        float most = 0.0f;
        for (const Rgb& pixel : display.pixels())
            most = std::max(most, luminance(pixel));
        return most;
    };
    EXPECT_GT(largest(mapped(day)), 0.5f);
    EXPECT_LT(largest(mapped(night)), 0.5f * largest(mapped(day)));
}

TEST(HistogramAdjustment, EachPartCanBeSwitchedOffAndDoesItsWork)
{
    HistogramAdjustmentOptions none = absolute();
    none.veil = none.acuity = none.color = false;
    // By moonlight, coloured checks of 2 pixels at 40 pixels a degree.
    Image<Rgb> scene(200, 150);
    for (int y = 0; y < 150; ++y)
        for (int x = 0; x < 200; ++x)
            scene(x, y) = (x / 2 + y / 2) % 2 == 0 ? Rgb(0.004f, 0.001f, 0.001f)
                                                   : Rgb(0.0005f, 0.0004f, 0.0002f);
    none.field_of_view_deg = 5.0;
    const auto contrast = [](const Image<Rgb>& display) {
        return luminance(display(100, 76)) / luminance(display(102, 76));
    };
    HistogramAdjustmentOptions blurred = none;
    blurred.acuity = true;
    EXPECT_GT(std::abs(std::log(contrast(mapped(scene, none)))), 0.5);
    EXPECT_LT(std::abs(std::log(contrast(mapped(scene, blurred)))), 0.25);

    HistogramAdjustmentOptions grey = none;
    grey.color = true;
    const Rgb colored = mapped(scene, none)(100, 76);
    const Rgb colorless = mapped(scene, grey)(100, 76);
    EXPECT_GT(colored.r, 2.0f * colored.g);
    EXPECT_LT(colorless.r, 1.3f * colorless.g);

    // A lamp veils what is dark beside it.
    HistogramAdjustmentOptions veiled = none;
    veiled.veil = true;
    Image<Rgb> lamp(200, 150, Rgb(0.5f));
    for (int y = 0; y < 150; ++y)
        for (int x = 0; x < 200; ++x) {
            if (x % 40 < 20) lamp(x, y) = Rgb(0.3f);
            if (std::hypot(x - 100, y - 75) < 10.0) lamp(x, y) = Rgb(1e4f);
        }
    const auto ratioBeside = [&](const HistogramAdjustmentOptions& options) {
        const Image<Rgb> display = mapped(lamp, options);
        return display(118, 75).g / display(82, 75).g;  // as far from the lamp on either side
    };
    EXPECT_LT(std::abs(std::log(ratioBeside(veiled))),
              0.5f * std::abs(std::log(ratioBeside(none))));
}

// In between, cones and rods share what is seen: at 3 cd/m², 0.53 of the colour is left.
TEST(HistogramAdjustment, ColourFadesBetweenDayAndNight)
{
    HistogramAdjustmentOptions options;
    options.veil = options.acuity = false;
    options.viewing.scene_white_cd_m2 = 1.0;
    const Rgb color = Rgb(1.0f, 0.5f, 0.5f) * (3.0f / luminance(Rgb(1.0f, 0.5f, 0.5f)));
    const Rgb shown = mapped(Image<Rgb>(32, 32, color), options)(16, 16);
    const double cones = coneShare(3.0);
    const double rods = (1.0 - cones) * scotopicLuminance(color);
    const double expected = (cones * static_cast<double>(color.r) + rods) /
                            (cones * static_cast<double>(color.g) + rods);
    EXPECT_NEAR(
        static_cast<double>(shown.r) / static_cast<double>(shown.g), expected, 1e-4 * expected);
    EXPECT_NEAR(cones, 0.535, 0.001);
}

TEST(HistogramAdjustment, HardScenes)
{
    EXPECT_TRUE(mapped({}).empty());
    EXPECT_EQ(mapped(Image<Rgb>(9, 7, Rgb(0.0f))), Image<Rgb>(9, 7, Rgb(0.0f)));
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 10000}, {10000, 1}, {7, 5}})
        for (const double field : {1.0, 60.0, 150.0}) {
            HistogramAdjustmentOptions options;
            options.field_of_view_deg = field;
            Image<Rgb> scene(width, height);
            for (std::size_t i = 0; i < scene.pixelCount(); ++i)
                scene.pixels()[i] = Rgb(std::pow(10.0f, static_cast<float>((i * 7) % 9) - 4.0f));
            const Image<Rgb> display = mapped(scene, options);
            for (const Rgb& pixel : display.pixels())
                for (int c = 0; c < 3; ++c) {
                    ASSERT_GE(pixel[c], 0.0f);
                    ASSERT_LE(pixel[c], 1.0f);
                }
        }
    Image<Rgb> bad(8, 8, Rgb(1.0f));
    bad(5, 6).g = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THAT(inputErrorOf([&] { (void)mapped(bad); }), testing::HasSubstr("pixel (5, 6)"));
}

TEST(HistogramAdjustment, SameBitsForAnyNumberOfThreads)
{
    const Image<Rgb> scene = tone_scenes::room(300, 200);
    setThreadCount(1);
    const Image<Rgb> one = mapped(scene);
    setThreadCount(0);
    EXPECT_EQ(mapped(scene), one);
}

TEST(HistogramAdjustment, OptionsReportEveryProblemAtOnce)
{
    HistogramAdjustmentOptions options;
    EXPECT_TRUE(options.validate().empty());
    options.display_black_cd_m2 = 100.0;
    options.field_of_view_deg = 180.0;
    EXPECT_TRUE(hasFinding(options.validate(), "tonemap-display-black"));
    EXPECT_TRUE(hasFinding(options.validate(), "tonemap-field-of-view"));
    EXPECT_THROW((void)makeHistogramAdjustment(options), InputError);
}

}  // namespace
}  // namespace insitu
