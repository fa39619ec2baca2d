#include "capture/probe_views.h"

#include "core/check.h"
#include "tests/capture/synthetic_ball.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;

constexpr glm::dvec3 kCenter(0.1, 0.9, -0.2);
constexpr double kRadiusPx = 110.0;
constexpr int kSide = 250;

/// A photographer: what a camera's ball shows within `radius` of the direction towards it.
Surroundings withPhotographer(glm::dvec3 camera, double radius)
{
    return [=](glm::dvec3 origin, glm::dvec3 direction) {
        const glm::dvec3 to_camera = glm::normalize(camera - kCenter);
        if (glm::dot(direction, to_camera) > std::cos(radius)) return Rgb(0.0f);
        return roomRadiance(origin, direction);
    };
}

ProbeView viewFrom(glm::dvec3 position, const Surroundings& surroundings)
{
    ProbeView view;
    view.ball.center_m = kCenter;
    view.ball.radius_m = 0.06;
    view.ball.radius_px = kRadiusPx;
    view.ball.center_px = glm::dvec2(0.5 * kSide);
    view.camera = ballCamera(view.ball, position, kSide, kSide);
    view.radiance = renderBall(view.ball, view.camera, surroundings);
    return view;
}

const glm::dvec3 kFront(-0.2, 1.1, 1.0);
const glm::dvec3 kSideways(-1.3, 1.1, -0.5);

/// A disc of the ball's picture.
ProbeMask discMask(double share)
{
    ProbeMask mask(kSide, kSide);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            if (std::hypot(x + 0.5 - 0.5 * kSide, y + 0.5 - 0.5 * kSide) < share * kRadiusPx)
                mask(x, y) = 1;
    return mask;
}

MergeViewsOptions inTheRoom()
{
    MergeViewsOptions options;
    options.width = 256;
    options.distance_to_room = distanceToWalls;
    return options;
}

/// Share of the sphere that is off by more than a tenth, lamps' and tiles' edges not counted: there
/// the truth itself varies within three texels.
double shareOff(const EnvironmentMap& map, const EnvironmentMap& truth)
{
    double off = 0.0;
    const int w = map.pixels.width();
    const int h = map.pixels.height();
    for (int y = 3; y + 3 < h; ++y) {
        for (int x = 3; x + 3 < w; ++x) {
            const float value = truth.pixels(x, y).g;
            bool plain = true;
            for (int j = -3; j <= 3; ++j)
                for (int i = -3; i <= 3; ++i)
                    plain = plain && std::abs(truth.pixels(x + i, y + j).g / value - 1.0f) < 0.1f;
            if (plain && std::abs(map.pixels(x, y).g / value - 1.0f) > 0.1f)
                off += environmentTexelSolidAngle(w, h, y) / (4.0 * pi);
        }
    }
    return off;
}

TEST(MergeProbeViews, OneViewIsItsUnwrapping)
{
    const ProbeView view = viewFrom(kFront, roomRadiance);
    const MergedProbe merged = mergeProbeViews({view}, inTheRoom());
    UnwrapOptions options;
    options.width = 256;
    options.distance_to_room = distanceToWalls;
    const LightProbe plain = unwrapMirrorBall(view.radiance, view.ball, view.camera, options);
    EXPECT_EQ(merged.probe.center_m, kCenter);
    EXPECT_TRUE(hasFinding(merged.probe.findings, "probe-blind-spot"));
    EXPECT_FALSE(hasFinding(merged.probe.findings, "probe-inpainted"));
    for (const glm::dvec3 normal : {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)})
        EXPECT_LT(glm::length(irradiance(merged.probe.environment, normal) /
                                  irradiance(plain.environment, normal) -
                              1.0),
                  0.005);  // weights differ within texels at lamps' edges
    EXPECT_LT(shareOff(merged.probe.environment, plain.environment), 0.002);
}

// The second view is twice as bright by mistake: what is clipped in it is scaled with it.
TEST(MergeProbeViews, ClippedLightIsAPartOfAllLight)
{
    std::vector<ProbeView> views = {viewFrom(kFront, roomRadiance),
                                    viewFrom(kSideways, roomRadiance)};
    for (Rgb& pixel : views[1].radiance.pixels())
        pixel *= 2.0f;
    for (ProbeView& view : views) {
        view.ball.reflectance = 0.8;
        view.clipped = view.radiance;
    }
    MergeViewsOptions options = inTheRoom();
    options.match_exposure = true;
    const EnvironmentMap map = mergeProbeViews(views, options).probe.environment;
    for (std::size_t i = 0; i < map.pixels.pixelCount(); ++i)
        ASSERT_NEAR(map.clipped.pixels()[i].g,
                    map.pixels.pixels()[i].g,
                    tolerance::kFloat * map.pixels.pixels()[i].g);
}

TEST(MergeProbeViews, PhotographerAndBlindSpotVanish)
{
    constexpr double kPerson = 0.25;  // radians
    ProbeView front = viewFrom(kFront, withPhotographer(kFront, kPerson));
    ProbeView side = viewFrom(kSideways, withPhotographer(kSideways, kPerson));
    const EnvironmentMap truth = panorama(roomRadiance, kCenter, 256);
    const double unmasked =
        shareOff(mergeProbeViews({front}, inTheRoom()).probe.environment, truth);
    EXPECT_GT(unmasked, 0.008);  // the person alone is 1.5 % of the sphere

    // Seen from afar, directions within a of the camera lie within sin(a / 2) of the radius.
    front.mask = discMask(std::sin(0.5 * kPerson) + 0.03);
    side.mask = front.mask;
    const MergedProbe merged = mergeProbeViews({front, side}, inTheRoom());
    EXPECT_LT(shareOff(merged.probe.environment, truth), 0.003);
    EXPECT_FALSE(hasFinding(merged.probe.findings, "probe-views-disagree"));
    EXPECT_FALSE(hasFinding(merged.probe.findings, "probe-inpainted"));
    EXPECT_FALSE(hasFinding(merged.probe.findings, "probe-outline-mismatch"));
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            glm::dvec3 normal(0.0);
            normal[axis] = sign;
            const glm::dvec3 ratio =
                irradiance(merged.probe.environment, normal) / irradiance(truth, normal);
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(ratio[c], 1.0, 0.01);  // the aim of the stage: 1 %
        }
    }
    for (const Finding& finding : merged.probe.findings) {
        if (finding.code == "probe-blind-spot") {
            EXPECT_EQ(finding.message.substr(0, 6), "0.00 %");
        }
    }
}

TEST(MergeProbeViews, OneMaskedViewIsPaintedIn)
{
    ProbeView front = viewFrom(kFront, withPhotographer(kFront, 0.25));
    front.mask = discMask(0.17);
    const MergedProbe merged = mergeProbeViews({front}, inTheRoom());
    EXPECT_TRUE(hasFinding(merged.probe.findings, "probe-inpainted"));
    const Rgb there = lookUp(merged.probe.environment, glm::normalize(kFront - kCenter));
    EXPECT_GT(there.r, 0.2f);  // the wall's, not the black of the photographer
}

TEST(MergeProbeViews, ReportsAndMatchesExposure)
{
    const ProbeView front = viewFrom(kFront, roomRadiance);
    ProbeView side = viewFrom(kSideways, roomRadiance);
    for (Rgb& pixel : side.radiance.pixels())
        pixel *= Rgb(1.5f, 1.3f, 1.0f);
    MergeViewsOptions options = inTheRoom();
    const MergedProbe merged = mergeProbeViews({front, side}, options);
    EXPECT_TRUE(hasFinding(merged.probe.findings, "probe-views-disagree"));
    ASSERT_EQ(merged.exposure_ratios.size(), 2u);
    EXPECT_EQ(merged.exposure_ratios[0], glm::dvec3(1.0));
    const glm::dvec3 truth(1.5, 1.3, 1.0);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(merged.exposure_ratios[1][c], truth[c], 0.01);  // texels mix tiles differently
    options.match_exposure = true;
    const EnvironmentMap matched = mergeProbeViews({front, side}, options).probe.environment;
    EXPECT_LT(shareOff(matched, panorama(roomRadiance, kCenter, 256)), 0.003);
}

TEST(MergeProbeViews, SaysWhenTheViewsShowDifferentThings)
{
    const ProbeView front = viewFrom(kFront, roomRadiance);
    // A third each is darker, equal and brighter by more than half: the median ratio stays 1.
    const ProbeView side = viewFrom(kSideways, [](glm::dvec3 origin, glm::dvec3 d) {
        const int band = static_cast<int>(std::floor(15.0 * (std::atan2(d.x, d.z) / pi + 1.0))) % 3;
        return roomRadiance(origin, d) * static_cast<float>(std::pow(1.6, band - 1));
    });
    const MergedProbe merged = mergeProbeViews({front, side}, inTheRoom());
    EXPECT_TRUE(hasFinding(merged.probe.findings, "probe-views-disagree"));
    EXPECT_NEAR(merged.exposure_ratios[1].g, 1.0, 0.08);  // below what is reported by itself
}

TEST(MergeProbeViews, DoesNotDependOnTheNumberOfThreads)
{
    ProbeView front = viewFrom(kFront, roomRadiance);
    front.mask = discMask(0.3);
    const ProbeView side = viewFrom(kSideways, roomRadiance);
    setThreadCount(1);
    const MergedProbe one = mergeProbeViews({front, side}, inTheRoom());
    setThreadCount(4);
    const MergedProbe four = mergeProbeViews({front, side}, inTheRoom());
    setThreadCount(0);
    EXPECT_EQ(one.probe.environment.pixels, four.probe.environment.pixels);
    EXPECT_EQ(one.exposure_ratios, four.exposure_ratios);
}

TEST(MergeProbeViews, RefusesWhatHasNoMeaning)
{
    const ProbeView good = viewFrom(kFront, roomRadiance);
    EXPECT_THROW((void)mergeProbeViews({}), InputError);
    const auto refuses = [&](auto change) {
        ProbeView bad = good;
        change(bad);
        EXPECT_THROW((void)mergeProbeViews({good, bad}, inTheRoom()), InputError);
    };
    refuses([](ProbeView& view) { view.mask = ProbeMask(3, 4); });
    refuses([](ProbeView& view) { view.ball.center_m.x += 0.5; });
    refuses([](ProbeView& view) { view.ball.radius_px = 0.0; });
    refuses(
        [](ProbeView& view) { view.radiance(7, 8).b = std::numeric_limits<float>::quiet_NaN(); });
    ProbeView covered = good;
    covered.mask = ProbeMask(kSide, kSide, 1);
    EXPECT_THROW((void)mergeProbeViews({covered}, inTheRoom()), NoAnswerError);
    MergeViewsOptions odd;
    odd.width = 77;
    EXPECT_THROW((void)mergeProbeViews({good}, odd), InputError);
}

// --- masks and painting in

LightProbe constantProbe(int width, Rgb colour)
{
    LightProbe probe;
    probe.environment.pixels = Image<Rgb>(width, width / 2, colour);
    return probe;
}

TEST(InpaintProbe, ConstantStaysConstant)
{
    LightProbe probe = constantProbe(64, Rgb(1.0f, 2.0f, 3.0f));
    const ProbeMask mask = maskFromCaps(64, {{{0.0, 1.0, 0.0}, 0.6}, {{0.3, -0.2, 1.0}, 0.5}});
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 64; ++x)
            if (mask(x, y) != 0) probe.environment.pixels(x, y) = Rgb(99.0f);
    inpaintProbe(probe, mask);
    for (const Rgb& texel : probe.environment.pixels.pixels())
        for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(texel[c], c + 1.0, tolerance::kFloat * (c + 1.0));
    ASSERT_TRUE(hasFinding(probe.findings, "probe-inpainted"));
    // Caps of 0.6 and 0.5 radians: (1 - cos) / 2 each; texels in and out by their middles.
    const double share = 50.0 * (2.0 - std::cos(0.6) - std::cos(0.5));
    EXPECT_NEAR(std::stod(probe.findings[0].message), share, 0.3);
}

// On the sphere tan(theta / 2)^m cos(m phi) is harmonic: what a cap about the pole must take from
// its rim. Second-order differences of texels 0.7 degrees wide; steepest at the rim.
TEST(InpaintProbe, SolvesLaplacesEquationOverThePole)
{
    constexpr int kWidth = 256;
    constexpr double kCap = 0.9;
    for (const int m : {1, 2, 3}) {
        const auto harmonic = [&](int x, int y) {
            const double theta = pi * (y + 0.5) / (kWidth / 2);
            const double phi = 2.0 * pi * (x + 0.5) / kWidth;
            return 2.0 +
                   std::pow(std::tan(0.5 * theta) / std::tan(0.5 * kCap), m) * std::cos(m * phi);
        };
        LightProbe probe = constantProbe(kWidth, Rgb(0.0f));
        const ProbeMask mask = maskFromCaps(kWidth, {{{0.0, 2.0, 0.0}, kCap}});
        for (int y = 0; y < kWidth / 4; ++y)
            for (int x = 0; x < kWidth; ++x)
                if (mask(x, y) == 0)
                    probe.environment.pixels(x, y) = Rgb(static_cast<float>(harmonic(x, y)));
        inpaintProbe(probe, mask);
        for (int y = 0; y < kWidth / 4; ++y)
            for (int x = 0; x < kWidth; ++x)
                if (mask(x, y) != 0) {
                    ASSERT_NEAR(probe.environment.pixels(x, y).g, harmonic(x, y), 0.002) << m;
                }
    }
}

TEST(InpaintProbe, GoesOnAcrossTheSeam)
{
    constexpr int kWidth = 128;
    LightProbe middle = constantProbe(kWidth, Rgb(0.0f));
    LightProbe seam = middle;
    for (int y = 0; y < kWidth / 2; ++y) {
        for (int x = 0; x < kWidth; ++x) {
            const Rgb value(static_cast<float>((x * 7 + y * 13) % 31));
            middle.environment.pixels(x, y) = value;
            seam.environment.pixels((x + kWidth / 2) % kWidth, y) = value;
        }
    }
    inpaintProbe(middle, maskFromCaps(kWidth, {{{0.0, 0.2, -1.0}, 0.4}}));
    inpaintProbe(seam, maskFromCaps(kWidth, {{{0.0, 0.2, 1.0}, 0.4}}));
    for (int y = 0; y < kWidth / 2; ++y)
        for (int x = 0; x < kWidth; ++x)
            ASSERT_NEAR(middle.environment.pixels(x, y).g,
                        seam.environment.pixels((x + kWidth / 2) % kWidth, y).g,
                        31.0 * tolerance::kFloat);
}

TEST(InpaintProbe, RefusesWhatHasNoMeaning)
{
    LightProbe probe = constantProbe(32, Rgb(1.0f));
    EXPECT_THROW(inpaintProbe(probe, ProbeMask(16, 8)), InputError);
    EXPECT_THROW(inpaintProbe(probe, ProbeMask(32, 16, 1)), NoAnswerError);
    inpaintProbe(probe, ProbeMask(32, 16));
    EXPECT_TRUE(probe.findings.empty());
    EXPECT_THROW((void)maskFromCaps(32, {{{0.0, 0.0, 0.0}, 0.4}}), InputError);
    EXPECT_THROW((void)maskFromCaps(32, {{{0.0, 0.0, 1.0}, 4.0}}), InputError);
    EXPECT_THROW((void)maskFromCaps(33, {}), InputError);
}

TEST(MaskFromPolygons, CoversThePixelsInside)
{
    const ProbeMask mask = maskFromPolygons(10,
                                            8,
                                            {{{2.0, 1.0}, {6.0, 1.0}, {6.0, 4.0}, {2.0, 4.0}},
                                             {{8.0, -5.0}, {30.0, -5.0}, {30.0, 2.0}, {8.0, 2.0}}});
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 10; ++x)
            EXPECT_EQ(mask(x, y) != 0, (x >= 2 && x < 6 && y >= 1 && y < 4) || (x >= 8 && y < 2))
                << x << " " << y;
    EXPECT_THROW((void)maskFromPolygons(10, 8, {{{2.0, 1.0}, {6.0, 1.0}}}), InputError);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW((void)maskFromPolygons(10, 8, {{{2.0, 1.0}, {6.0, 1.0}, {nan, 3.0}}}), InputError);
}

}  // namespace
}  // namespace insitu
