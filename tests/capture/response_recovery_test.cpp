#include "capture/response_recovery.h"

#include "core/color.h"
#include "core/parallel.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

const std::vector<double> kOneEv = {1.0, 0.5, 0.25, 0.125, 1.0 / 16, 1.0 / 32, 1.0 / 64, 1.0 / 128};
const std::vector<double> kTwoEv = {1.0, 0.25, 1.0 / 16, 1.0 / 64, 1.0 / 256};

/// Seven stops of scene light: the longest frame shows the dark tiles, the shortest the bright.
Image<Rgb> scene()
{
    return tiles(320, 240, 8, 0.01, 120.0);
}

double power(int channel, double e)
{
    return std::pow(e, channel == 0 ? 0.45 : 0.5);
}
double shoulder(int channel, double e)
{
    const double gamma = 0.42 + 0.05 * channel;
    return std::pow(e, gamma) * (1.0 + 0.25 * (1.0 - e)) * 0.2 +
           0.8 * (1.0 - std::exp(-2.5 * std::pow(e, gamma))) / (1.0 - std::exp(-2.5));
}
double srgb(int, double e)
{
    return srgbFromLinear(e);
}

/// The method that these tests measure; all of them: response_methods_test.cpp.
ResponseOptions smoothCurve()
{
    ResponseOptions options;
    options.method = ResponseMethod::Debevec;
    return options;
}

struct CurveCase {
    const char* name;
    double (*curve)(int, double);
    bool two_ev;
};
void PrintTo(const CurveCase& c, std::ostream* os)
{
    *os << c.name << (c.two_ev ? "2Ev" : "1Ev");
}

class KnownCurve : public testing::TestWithParam<CurveCase> {};

// What is left is the rounding to codes; it is largest, in EV, where codes are few.
TEST_P(KnownCurve, IsRecoveredWithoutNoise)
{
    SyntheticCamera camera;
    camera.curve = GetParam().curve;
    const Bracket bracket = photograph(scene(), GetParam().two_ev ? kTwoEv : kOneEv, camera);
    const ResponseRecovery recovery = recoverResponse(bracket, smoothCurve());
    EXPECT_FALSE(hasFinding(recovery.findings, "response-not-recoverable"));
    const ResponseCurve truth = tableOf(camera);
    for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_LT(curveErrorEv(recovery.curve, truth, c, 16, 248), 0.01) << c;
        EXPECT_LT(curveErrorEv(recovery.curve, truth, c, 8, 248), 0.03) << c;
        EXPECT_LT(recovery.residual[c], 0.03) << c;  // rounding, at codes near 10
    }
}

// 5 electrons of read noise and 4000 electrons at full scale: a small sensor. Below a hundredth of
// full scale the noise of a pixel is above a fifth of its signal.
TEST_P(KnownCurve, IsRecoveredFromNoisyPictures)
{
    SyntheticCamera camera;
    camera.curve = GetParam().curve;
    camera.read_variance = 1.5e-6;
    camera.shot_variance = 2.5e-4;
    const Bracket bracket = photograph(scene(), GetParam().two_ev ? kTwoEv : kOneEv, camera);
    const ResponseRecovery recovery = recoverResponse(bracket, smoothCurve());
    const ResponseCurve truth = tableOf(camera);
    for (std::size_t c = 0; c < 3; ++c) {
        const auto darkest = static_cast<std::size_t>(truth.encode(static_cast<int>(c), 0.01));
        EXPECT_LT(curveErrorEv(recovery.curve, truth, c, darkest, 240), 0.02) << c;
    }
}

INSTANTIATE_TEST_SUITE_P(Curves,
                         KnownCurve,
                         testing::Values(CurveCase{"Power", power, false},
                                         CurveCase{"Power", power, true},
                                         CurveCase{"Shoulder", shoulder, false},
                                         CurveCase{"Shoulder", shoulder, true},
                                         CurveCase{"Srgb", srgb, false},
                                         CurveCase{"Srgb", srgb, true}));

TEST(RecoverResponse, TableIsNormalisedPositiveAndStrictlyIncreasing)
{
    SyntheticCamera camera;
    camera.curve = shoulder;
    camera.read_variance = 1e-5;
    camera.shot_variance = 1e-3;
    const ResponseRecovery recovery = recoverResponse(photograph(scene(), kTwoEv, camera), {});
    EXPECT_EQ(recovery.curve.source, responseMethodName(recovery.method));
    for (const auto& table : recovery.curve.exposure) {
        EXPECT_EQ(table[128], 1.0);
        EXPECT_GE(table[0], 0.0);
        for (std::size_t z = 1; z < 256; ++z) {
            EXPECT_TRUE(std::isfinite(table[z]));
            EXPECT_GT(table[z], table[z - 1]) << z;
        }
    }
}

TEST(RecoverResponse, SixteenBitCodesGiveTheSameCurve)
{
    SyntheticCamera camera;
    camera.curve = power;
    camera.max_code = 65535;
    const ResponseRecovery recovery = recoverResponse(photograph(scene(), kOneEv, camera), {});
    for (std::size_t c = 0; c < 3; ++c)
        EXPECT_LT(curveErrorEv(recovery.curve, tableOf(camera), c, 8, 248), 0.01) << c;
}

TEST(RecoverResponse, DoesNotDependOnTheNumberOfThreads)
{
    SyntheticCamera camera;
    camera.curve = srgb;
    camera.shot_variance = 2.5e-4;
    const Bracket bracket = photograph(scene(), kTwoEv, camera);
    setThreadCount(1);
    const ResponseRecovery one = recoverResponse(bracket, {});
    setThreadCount(4);
    const ResponseRecovery four = recoverResponse(bracket, {});
    setThreadCount(0);
    EXPECT_EQ(one.curve.exposure, four.curve.exposure);
}

TEST(RecoverResponse, WithoutTwoExposuresIsSrgbWithAFinding)
{
    SyntheticCamera camera;
    camera.curve = power;
    for (const std::vector<double>& seconds : {std::vector{0.1}, std::vector{0.1, 0.1}}) {
        const ResponseRecovery recovery = recoverResponse(photograph(scene(), seconds, camera), {});
        EXPECT_TRUE(hasFinding(recovery.findings, "response-not-recoverable"));
        EXPECT_EQ(recovery.curve.exposure, ResponseCurve::srgb().exposure);
    }
}

TEST(RecoverResponse, WithoutOverlapIsSrgbWithAFinding)
{
    SyntheticCamera camera;
    camera.curve = power;
    const Image<Rgb> grey(64, 64, Rgb(0.2f));
    for (const std::vector<double>& seconds :
         {std::vector{1e6, 1e5}, std::vector{1e-6, 1e-7}, std::vector{1e6, 1e-6}}) {
        const ResponseRecovery recovery = recoverResponse(photograph(grey, seconds, camera), {});
        EXPECT_TRUE(hasFinding(recovery.findings, "response-not-recoverable"));
    }
}

TEST(RecoverResponse, SaysWhichCodesItNeverSaw)
{
    SyntheticCamera camera;
    camera.curve = power;
    const Image<Rgb> dark = tiles(320, 240, 8, 0.02, 0.2);
    const ResponseRecovery recovery =
        recoverResponse(photograph(dark, {1.0, 0.5, 0.25}, camera), {});
    EXPECT_TRUE(hasFinding(recovery.findings, "response-partly-extrapolated"));
}

TEST(RecoverResponse, RefusesBadOptions)
{
    ResponseOptions options;
    options.samples = 10;
    options.smoothness = 0.0;
    EXPECT_EQ(options.validate().size(), 2u);
    SyntheticCamera camera;
    camera.curve = power;
    EXPECT_THROW((void)recoverResponse(photograph(scene(), kOneEv, camera), options), InputError);
}

}  // namespace
}  // namespace insitu
