#include "capture/held_out.h"
#include "capture/response_recovery.h"
#include "core/color.h"
#include "core/io/json.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

const std::vector<double> kOneEv = {1.0, 0.5, 0.25, 0.125, 1.0 / 16, 1.0 / 32, 1.0 / 64, 1.0 / 128};

double contrast(int channel, double e)
{
    const double y = std::pow(e, 0.42 + 0.03 * channel);
    return y + 0.5 * y * (1.0 - y) * (2.0 * y - 1.0);
}

double toeAndShoulder(int channel, double e)
{
    const double t = 2.0 + 0.5 * channel;
    const double y = (1.0 - std::exp(-t * std::pow(e, 0.6))) / (1.0 - std::exp(-t));
    return 0.35 * y * y * (3.0 - 2.0 * y) + 0.65 * y;
}

double linear(int, double e)
{
    return e;
}

double power(int, double e)
{
    return std::pow(e, 0.45);
}

/// Radiance without steps, so that every code occurs: seven stops.
Image<Rgb> ramp(int width = 320, int height = 240, double darkest = 0.01, double stops = 13.0)
{
    Image<Rgb> image(width, height);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const double place = (x + static_cast<double>(y) / height) / width;
            const double value = darkest * std::pow(2.0, stops * place);
            image(x, y) = Rgb(glm::dvec3(value, 0.9 * value, 0.8 * value));
        }
    }
    return image;
}

SyntheticCamera cameraWith(double (*curve)(int, double))
{
    SyntheticCamera camera;
    camera.curve = curve;
    camera.read_variance = 2.5e-9;
    camera.shot_variance = 1.0 / 60'000.0;
    return camera;
}

ResponseOptions with(ResponseMethod method)
{
    ResponseOptions options;
    options.method = method;
    return options;
}

/// What callers rely on, whatever the input.
void expectSane(const ResponseRecovery& recovery, std::size_t frames)
{
    EXPECT_EQ(recovery.exposure_scale.size(), frames);
    EXPECT_NE(recovery.method, ResponseMethod::Auto);
    if (!hasFinding(recovery.findings, "response-not-recoverable")) {
        for (const auto& table : recovery.curve.exposure)
            EXPECT_EQ(table[128], 1.0);
    }
    for (const auto& table : recovery.curve.exposure) {
        EXPECT_GE(table[0], 0.0);
        for (std::size_t z = 1; z < 256; ++z) {
            ASSERT_TRUE(std::isfinite(table[z])) << z;
            ASSERT_GT(table[z], table[z - 1]) << z;
        }
    }
}

struct MethodCase {
    ResponseMethod method;
    double (*curve)(int, double);
    double tolerance_ev;  ///< over codes 8 to 245
};
void PrintTo(const MethodCase& c, std::ostream* os)
{
    *os << responseMethodName(c.method);
}

class Methods : public testing::TestWithParam<MethodCase> {};

// What separates the methods is their model: a table of 12 000 pixels is noisier than a spline of
// all, and a polynomial bends where the curve does not. The limits were set by hand, not from what
// is measured.
TEST_P(Methods, RecoverAKnownCurve)
{
    const SyntheticCamera camera = cameraWith(GetParam().curve);
    const Bracket bracket = photograph(ramp(), kOneEv, camera);
    const ResponseRecovery recovery = recoverResponse(bracket, with(GetParam().method));
    expectSane(recovery, bracket.frames.size());
    if (GetParam().method != ResponseMethod::Auto) {
        EXPECT_EQ(recovery.method, GetParam().method);
    }
    EXPECT_EQ(recovery.curve.source, responseMethodName(recovery.method));
    const ResponseCurve truth = tableOf(camera);
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_LT(curveErrorEv(recovery.curve, truth, c, 8, 245), GetParam().tolerance_ev) << c;
}

INSTANTIATE_TEST_SUITE_P(
    Curves,
    Methods,
    testing::Values(MethodCase{ResponseMethod::Debevec, contrast, 0.003},
                    MethodCase{ResponseMethod::Basis, contrast, 0.003},
                    MethodCase{ResponseMethod::Mitsunaga, contrast, 0.08},
                    MethodCase{ResponseMethod::Robertson, contrast, 0.06},
                    MethodCase{ResponseMethod::Auto, contrast, 0.003},
                    MethodCase{ResponseMethod::Debevec, toeAndShoulder, 0.003},
                    MethodCase{ResponseMethod::Basis, toeAndShoulder, 0.006},
                    MethodCase{ResponseMethod::Mitsunaga, toeAndShoulder, 0.08},
                    MethodCase{ResponseMethod::Robertson, toeAndShoulder, 0.08},
                    MethodCase{ResponseMethod::Auto, toeAndShoulder, 0.003}));

TEST(AutoMethod, SaysWhatItChoseAndWhy)
{
    const Bracket bracket = photograph(ramp(), kOneEv, cameraWith(contrast));
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    ASSERT_TRUE(hasFinding(recovery.findings, "response-method-chosen"));
    EXPECT_GT(recovery.held_out_error_codes, 0.0);
    for (const Finding& finding : recovery.findings) {
        if (finding.code != "response-method-chosen") continue;
        EXPECT_EQ(finding.severity, Severity::Info);
        for (const char* name : {"debevec", "basis", "mitsunaga", "robertson"})
            EXPECT_THAT(finding.message, testing::HasSubstr(name));
    }
    EXPECT_FALSE(hasFinding(recoverResponse(bracket, with(ResponseMethod::Basis)).findings,
                            "response-method-chosen"));
}

// A curve fits a file and comes back as it was.
TEST(RecoveredCurve, SurvivesJson)
{
    const ResponseRecovery recovery =
        recoverResponse(photograph(ramp(), kOneEv, cameraWith(contrast)), {});
    const Json json = toJson(recovery.curve);
    const ResponseCurve read = responseFromJson(JsonNode(json, "response.json"));
    EXPECT_EQ(read.exposure, recovery.curve.exposure);
    EXPECT_EQ(read.source, recovery.curve.source);
}

TEST(RefinedExposures, FindTheTrueShutterTimes)
{
    const std::vector<double> true_seconds = {
        1.0 / 2, 1.0 / 4, 1.0 / 8, 1.0 / 16, 1.0 / 32, 1.0 / 64, 1.0 / 128, 1.0 / 256};
    const std::vector<double> nominal = {
        1.0 / 2, 1.0 / 4, 1.0 / 8, 1.0 / 15, 1.0 / 30, 1.0 / 60, 1.0 / 125, 1.0 / 250};
    Bracket bracket = photograph(ramp(320, 240, 0.02), true_seconds, cameraWith(contrast));
    for (std::size_t k = 0; k < nominal.size(); ++k)
        bracket.frames[k].relative_exposure = nominal[k];
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    EXPECT_TRUE(hasFinding(recovery.findings, "response-exposures-refined"));
    EXPECT_FALSE(hasFinding(recovery.findings, "bracket-exposure-mismatch"));
    // The gauge: what is left after the best line through ln(true / refined) over ln(nominal).
    double mean_x = 0.0;
    double mean_y = 0.0;
    std::vector<double> x;
    std::vector<double> y;
    for (std::size_t k = 0; k < nominal.size(); ++k) {
        x.push_back(std::log(nominal[k]));
        y.push_back(std::log(true_seconds[k] / (nominal[k] * recovery.exposure_scale[k])));
        mean_x += x.back() / static_cast<double>(nominal.size());
        mean_y += y.back() / static_cast<double>(nominal.size());
    }
    double xy = 0.0;
    double xx = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
        xy += (x[k] - mean_x) * (y[k] - mean_y);
        xx += (x[k] - mean_x) * (x[k] - mean_x);
    }
    // Given times are 6 % off; the curve of the given ones absorbs their trend, no more.
    for (std::size_t k = 0; k < x.size(); ++k)
        EXPECT_NEAR(y[k] - mean_y, xy / xx * (x[k] - mean_x), 0.006) << k;

    ResponseOptions fixed;
    fixed.refine_exposures = false;
    const ResponseRecovery as_given = recoverResponse(bracket, fixed);
    EXPECT_THAT(as_given.exposure_scale, testing::Each(1.0));
    EXPECT_FALSE(hasFinding(as_given.findings, "response-exposures-refined"));
    HeldOutOptions refined;
    refined.exposure_scale = recovery.exposure_scale;
    EXPECT_LT(predictHeldOut(bracket, recovery.curve, refined).mean_codes,
              predictHeldOut(bracket, as_given.curve).mean_codes);
}

TEST(RefinedExposures, LeaveRightOnesAlone)
{
    const Bracket bracket = photograph(ramp(), kOneEv, cameraWith(contrast));
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    EXPECT_THAT(recovery.exposure_scale, testing::Each(1.0));
    EXPECT_FALSE(hasFinding(recovery.findings, "response-exposures-refined"));
}

TEST(WrongExposure, IsNamedWithItsMeasuredValueAndDoesNotSpoilTheCurve)
{
    const SyntheticCamera camera = cameraWith(contrast);
    Bracket bracket = photograph(ramp(), kOneEv, camera);
    bracket.frames[3].relative_exposure *= 1.6;  // 0.68 EV too much
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    expectSane(recovery, bracket.frames.size());
    std::vector<std::string> messages;
    for (const Finding& finding : recovery.findings)
        if (finding.code == "bracket-exposure-mismatch") messages.push_back(finding.message);
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_THAT(messages[0], testing::StartsWith("frame_3: given 0.2, measured 0.125"));
    EXPECT_NEAR(recovery.exposure_scale[3], 1.0 / 1.6, 0.01);
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_LT(curveErrorEv(recovery.curve, tableOf(camera), c, 16, 240), 0.02) << c;
}

TEST(SamePictureTwice, IsNamed)
{
    Bracket bracket = photograph(ramp(), kOneEv, cameraWith(contrast));
    bracket.frames[4].image = bracket.frames[3].image;
    EXPECT_TRUE(hasFinding(recoverResponse(bracket, {}).findings, "bracket-exposure-mismatch"));
    for (BracketFrame& frame : bracket.frames)
        frame.image = bracket.frames[3].image;
    const ResponseRecovery all_same = recoverResponse(bracket, {});
    EXPECT_TRUE(hasFinding(all_same.findings, "response-not-recoverable"));
    EXPECT_TRUE(hasFinding(all_same.findings, "bracket-exposure-mismatch"));
}

TEST(MovedPlace, IsDropped)
{
    const SyntheticCamera camera = cameraWith(contrast);
    const Image<Rgb> scene = ramp();
    Bracket bracket = photograph(scene, kOneEv, camera);
    EXPECT_FALSE(hasFinding(recoverResponse(bracket, {}).findings, "response-moved-places"));
    // Somebody twice as bright walks in, in one frame.
    Image<Rgb> visited = scene;
    for (int y = 40; y < 140; ++y)
        for (int x = 130; x < 190; ++x)
            visited(x, y) *= 2.0f;
    bracket.frames[4].image = photograph(visited, kOneEv, camera).frames[4].image;
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    EXPECT_TRUE(hasFinding(recovery.findings, "response-moved-places"));
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_LT(curveErrorEv(recovery.curve, tableOf(camera), c, 16, 240), 0.005) << c;
}

struct HardCase {
    const char* name;
    double (*curve)(int, double);
    std::vector<double> seconds;
    double read_variance;
    double shot_variance;
    double blue;          ///< of the scene's blue
    double tolerance_ev;  ///< red and green, codes 32 to 224
};
void PrintTo(const HardCase& c, std::ostream* os)
{
    *os << c.name;
}

class HardBrackets : public testing::TestWithParam<HardCase> {};

TEST_P(HardBrackets, GiveASaneCurve)
{
    SyntheticCamera camera;
    camera.curve = GetParam().curve;
    camera.read_variance = GetParam().read_variance;
    camera.shot_variance = GetParam().shot_variance;
    Image<Rgb> scene = ramp();
    for (Rgb& pixel : scene.pixels())
        pixel.b *= static_cast<float>(GetParam().blue);
    const Bracket bracket = photograph(scene, GetParam().seconds, camera);
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    expectSane(recovery, bracket.frames.size());
    EXPECT_FALSE(hasFinding(recovery.findings, "response-not-recoverable"));
    EXPECT_FALSE(hasFinding(recovery.findings, "bracket-exposure-mismatch"));
    for (std::size_t c = 0; c < 2; ++c)
        EXPECT_LT(curveErrorEv(recovery.curve, tableOf(camera), c, 32, 224),
                  GetParam().tolerance_ev)
            << c;
}

// Limits set by hand, not from what is measured. Exposures 5 EV apart share the curve's ends only:
// between them smoothness alone tells. ISO 6400: 1200 electrons at full scale, 4 electrons of read
// noise.
INSTANTIATE_TEST_SUITE_P(
    Cases,
    HardBrackets,
    testing::Values(
        HardCase{"TwoFrames", contrast, {1.0, 0.25}, 2.5e-9, 1.7e-5, 1.0, 0.08},
        HardCase{"FiveEvSteps", contrast, {1.0, 1.0 / 32, 1.0 / 1024}, 2.5e-9, 1.7e-5, 1.0, 0.25},
        HardCase{"BlackAndWhite",
                 contrast,
                 {1e4, 1.0, 0.5, 0.25, 0.125, 1e-7},
                 2.5e-9,
                 1.7e-5,
                 1.0,
                 0.01},
        HardCase{"Iso6400", contrast, kOneEv, 1.1e-5, 8.3e-4, 1.0, 0.03},
        HardCase{"Linear", linear, kOneEv, 2.5e-9, 1.7e-5, 1.0, 0.01},
        HardCase{"ToeAndShoulder", toeAndShoulder, kOneEv, 2.5e-9, 1.7e-5, 1.0, 0.005},
        HardCase{"Tungsten", contrast, kOneEv, 2.5e-9, 1.7e-5, 0.02, 0.005}));

TEST(ChannelWithoutLight, TakesTheShapeOfTheOthers)
{
    Image<Rgb> scene = ramp();
    for (Rgb& pixel : scene.pixels())
        pixel.b = 0.0f;
    const SyntheticCamera camera = cameraWith(power);
    const Bracket bracket = photograph(scene, kOneEv, camera);
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    expectSane(recovery, bracket.frames.size());
    EXPECT_TRUE(hasFinding(recovery.findings, "response-channel-borrowed"));
    EXPECT_LT(curveErrorEv(recovery.curve, tableOf(camera), 2, 16, 240), 0.01);
}

TEST(FewCodesInCommon, IsSaneOrSaid)
{
    // A scene of less than a stop, frames 4 EV apart.
    const Image<Rgb> scene = ramp(320, 240, 0.5, 0.8);
    const Bracket bracket = photograph(scene, {1.0, 1.0 / 16, 1.0 / 256}, cameraWith(contrast));
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    expectSane(recovery, bracket.frames.size());
    EXPECT_TRUE(hasFinding(recovery.findings, "response-not-recoverable") ||
                hasFinding(recovery.findings, "response-partly-extrapolated"));
}

TEST(TwoFrames, SayThatOtherMethodsNeedMore)
{
    const Bracket bracket = photograph(ramp(), {1.0, 0.25}, cameraWith(contrast));
    const ResponseRecovery recovery = recoverResponse(bracket, with(ResponseMethod::Robertson));
    EXPECT_TRUE(hasFinding(recovery.findings, "response-method-failed"));
    EXPECT_EQ(recovery.method, ResponseMethod::Debevec);
    EXPECT_LT(recovery.held_out_error_codes, 0.0);
}

// Black that lies at code 22, as in a scan of film.
TEST(RaisedBlack, PredictsBlackPixels)
{
    const auto scanned = +[](int channel, double e) {
        return (22.0 + 233.0 * contrast(channel, std::max(e - 0.01, 0.0) / 0.99)) / 255.0;
    };
    std::vector<double> seconds = kOneEv;
    for (int k = 0; k < 4; ++k)
        seconds.push_back(seconds.back() / 2.0);
    const Bracket bracket = photograph(ramp(320, 240, 0.01, 9.0), seconds, cameraWith(scanned));
    const ResponseRecovery recovery = recoverResponse(bracket, {});
    expectSane(recovery, bracket.frames.size());
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(recovery.curve.encode(c, 1e-4), 22.0, 1.5) << c;
}

// ---- predictHeldOut ----

TEST(PredictHeldOut, IsOnlyRoundingForTheTrueCurve)
{
    SyntheticCamera camera = cameraWith(power);
    camera.read_variance = 0.0;
    camera.shot_variance = 0.0;
    const Bracket bracket = photograph(ramp(), kOneEv, camera);
    const HeldOutError truth = predictHeldOut(bracket, tableOf(camera));
    // 0.25 for the rounding of the code itself; the rest is that of the frames it is predicted
    // from.
    EXPECT_GT(truth.mean_codes, 0.25);
    EXPECT_LT(truth.mean_codes, 0.35);
    EXPECT_GT(truth.count, 100'000u);
    EXPECT_EQ(truth.by_frame.front(), 0.0);
    EXPECT_EQ(truth.by_frame.back(), 0.0);
    EXPECT_GT(predictHeldOut(bracket, ResponseCurve::srgb()).mean_codes, 2.0 * truth.mean_codes);
}

TEST(PredictHeldOut, LooksOnlyWhereItIsTold)
{
    const SyntheticCamera camera = cameraWith(power);
    Bracket bracket = photograph(ramp(), kOneEv, camera);
    HeldOutOptions options;
    options.mask = Image<std::uint8_t>(320, 240, 0);
    EXPECT_EQ(predictHeldOut(bracket, tableOf(camera), options).count, 0u);
    for (int x = 0; x < 320; ++x)
        options.mask(x, 7) = 1;
    const HeldOutError row = predictHeldOut(bracket, tableOf(camera), options);
    EXPECT_GT(row.count, 0u);
    for (int y = 0; y < 240; ++y)
        if (y != 7) bracket.frames[2].image.codes(11, y) = glm::u16vec3(3);
    EXPECT_EQ(predictHeldOut(bracket, tableOf(camera), options).mean_codes, row.mean_codes);

    options.mask = {};
    options.most_pixels = 1000;
    EXPECT_LT(predictHeldOut(bracket, tableOf(camera), options).count, 1100u * 3u * 6u);
    bracket.frames.resize(2);
    EXPECT_EQ(predictHeldOut(bracket, tableOf(camera)).count, 0u);
}

TEST(PredictHeldOut, RefusesOptionsThatDoNotFit)
{
    const SyntheticCamera camera = cameraWith(power);
    const Bracket bracket = photograph(ramp(32, 24), kOneEv, camera);
    HeldOutOptions options;
    options.mask = Image<std::uint8_t>(5, 5, 1);
    EXPECT_THROW((void)predictHeldOut(bracket, tableOf(camera), options), InputError);
    options.mask = {};
    options.exposure_scale = {1.0};
    EXPECT_THROW((void)predictHeldOut(bracket, tableOf(camera), options), InputError);
    options.exposure_scale.assign(kOneEv.size(), std::numeric_limits<double>::quiet_NaN());
    EXPECT_THROW((void)predictHeldOut(bracket, tableOf(camera), options), InputError);
}

}  // namespace
}  // namespace insitu
