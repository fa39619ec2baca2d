#include "capture/light_probe.h"

#include "capture/ball_reflection.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/capture/synthetic_ball.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

namespace insitu {
namespace {

using std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

MirrorBall ballAt(double radius_px)
{
    MirrorBall ball;
    ball.center_px = {150.0, 140.0};
    ball.radius_px = radius_px;
    ball.radius_m = 0.06;
    ball.center_m = {0.1, 0.5, -0.2};
    return ball;
}
const glm::dvec3 kView(-0.5, 0.7, 1.0);

bool isBlind(const MirrorBall& ball, glm::dvec3 direction, glm::dvec3 view)
{
    return glm::dot(direction, glm::normalize(view - ball.center_m)) < std::cos(0.88 * pi);
}

/// Angles in degrees between where texels look and what their colour says, without the blind spot.
std::vector<double> directionErrors(const EnvironmentMap& map,
                                    const MirrorBall& ball,
                                    glm::dvec3 view)
{
    std::vector<double> errors;
    for (int y = 0; y < map.pixels.height(); ++y) {
        for (int x = 0; x < map.pixels.width(); ++x) {
            const glm::dvec3 d = environmentDirectionFromUv(
                {(x + 0.5) / map.pixels.width(), (y + 0.5) / map.pixels.height()});
            if (isBlind(ball, d, view)) continue;
            const double cosine = glm::dot(d, vectorOf(map.pixels(x, y)));
            errors.push_back(std::acos(std::min(cosine, 1.0)) * 180.0 / pi);
        }
    }
    std::ranges::sort(errors);
    return errors;
}

TEST(BallReflection, ObeysTheLawOfReflection)
{
    RandomStream random(7, 0, 0);
    const auto direction = [&] {
        const double z = 2.0 * random.uniformDouble() - 1.0;
        const double turn = 2.0 * pi * random.uniformDouble();
        const double s = std::sqrt(1.0 - z * z);
        return glm::dvec3(s * std::cos(turn), s * std::sin(turn), z);
    };
    int seen = 0;
    for (int i = 0; i < 2000; ++i) {
        const glm::dvec3 center(0.3, 0.5, -1.0);
        const double radius = 0.02 + 0.2 * random.uniformDouble();
        const glm::dvec3 camera =
            center + direction() * radius * (1.2 + 20.0 * random.uniformDouble());
        const glm::dvec3 target = direction();
        const double distance =
            i % 3 == 0 ? kInfinity : radius * (1.1 + 30.0 * random.uniformDouble());
        const detail::BallReflection reflection(center, radius, camera, 0.0);
        const auto point = reflection.pointFor(target, distance);
        const glm::dvec3 normal = (point.position - center) / radius;
        EXPECT_NEAR(glm::length(normal), 1.0, tolerance::kDouble);
        if (point.blind) continue;
        ++seen;
        const glm::dvec3 to_camera = glm::normalize(camera - point.position);
        const glm::dvec3 to_target =
            std::isfinite(distance) ? glm::normalize(center + distance * target - point.position)
                                    : target;
        const glm::dvec3 mirrored = 2.0 * glm::dot(normal, to_camera) * normal - to_camera;
        EXPECT_LT(glm::length(mirrored - to_target), 1e-9) << i;  // Newton stops at 1e-12 rad
        EXPECT_GT(glm::dot(normal, to_camera), 0.0);
    }
    EXPECT_GT(seen, 1200);
}

TEST(BallCamera, SeesTheOutlineWhereItWasMeasured)
{
    const MirrorBall ball = ballAt(120.0);
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const double distance = glm::length(kView - ball.center_m);
    // A tangent ray makes asin(r/D) with the axis.
    const glm::dvec3 edge = camera.rayDirection({150.0 + 120.0, 140.0});
    EXPECT_NEAR(std::acos(glm::dot(edge, camera.forward)), std::asin(0.06 / distance), 1e-12);
}

TEST(UnwrapMirrorBall, ConstantStaysConstantAndReflectanceIsDividedOut)
{
    MirrorBall ball = ballAt(100.0);
    ball.reflectance = 0.5;
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture = renderBall(
        ball,
        camera,
        [](glm::dvec3, glm::dvec3) { return Rgb(2.0f, 3.0f, 4.0f); },
        {},
        {},
        Rgb(1.0f, 1.5f, 2.0f));
    const LightProbe probe = unwrapMirrorBall(picture, ball, camera, {});
    EXPECT_EQ(probe.center_m, ball.center_m);
    for (const Rgb& texel : probe.environment.pixels.pixels()) {
        ASSERT_NEAR(texel.r, 2.0f, tolerance::kFloat * 2.0);
        ASSERT_NEAR(texel.g, 3.0f, tolerance::kFloat * 3.0);
        ASSERT_NEAR(texel.b, 4.0f, tolerance::kFloat * 4.0);
    }
}

// What is clipped goes where all light goes: both halves of the picture, unwrapped each by itself,
// sum to the whole, reflectance and partly covered texels included.
TEST(UnwrapMirrorBall, ClippedLightIsAPartOfAllLight)
{
    MirrorBall ball = ballAt(100.0);
    ball.reflectance = 0.5;
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture =
        renderBall(ball, camera, [](glm::dvec3, glm::dvec3 d) { return colourOf(d); });
    Image<Rgb> clipped = picture;
    Image<Rgb> rest = picture;
    for (std::size_t i = 0; i < picture.pixelCount(); ++i)
        (picture.pixels()[i].g > 0.35f ? rest : clipped).pixels()[i] = Rgb(0.0f);
    UnwrapOptions options;
    options.width = 256;
    const LightProbe other = unwrapMirrorBall(rest, ball, camera, options);
    options.clipped = &clipped;
    const LightProbe probe = unwrapMirrorBall(picture, ball, camera, options);
    int partial = 0;
    for (std::size_t i = 0; i < probe.environment.pixels.pixelCount(); ++i) {
        const Rgb part = probe.environment.clipped.pixels()[i];
        const Rgb measured = other.environment.pixels.pixels()[i];
        const Rgb all = probe.environment.pixels.pixels()[i];
        ASSERT_NEAR((part + measured).g, all.g, tolerance::kFloat * all.g);
        partial += part.g > 0.0f && measured.g > 0.0f;
    }
    EXPECT_GT(partial, 100);
}

TEST(UnwrapMirrorBall, PutsFarThingsInTheirDirections)
{
    const MirrorBall ball = ballAt(120.0);
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture =
        renderBall(ball, camera, [](glm::dvec3, glm::dvec3 d) { return colourOf(d); });
    UnwrapOptions options;
    options.width = 256;
    const LightProbe probe = unwrapMirrorBall(picture, ball, camera, options);
    const std::vector<double> errors = directionErrors(probe.environment, ball, kView);
    EXPECT_LT(errors[errors.size() / 2], 0.1);
    EXPECT_LT(errors[errors.size() * 99 / 100], 1.0);

    // Irradiance of the linear field (1 + d)/2 at normal n: pi/2 + n pi/3.
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            glm::dvec3 normal(0.0);
            normal[axis] = sign;
            const glm::dvec3 measured = irradiance(probe.environment, normal);
            for (int c = 0; c < 3; ++c) {
                const double truth = pi / 2.0 + normal[c] * pi / 3.0;
                EXPECT_NEAR(measured[c], truth, 0.01 * truth);  // the aim of the stage: 1 %
            }
        }
    }
}

TEST(UnwrapMirrorBall, PutsWallsWhereTheBallsCentreSeesThem)
{
    const MirrorBall ball = ballAt(120.0);
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture = renderBall(ball, camera, [&](glm::dvec3 origin, glm::dvec3 d) {
        const glm::dvec3 hit = origin + d * distanceToWalls(origin, d);
        return colourOf(glm::normalize(hit - ball.center_m));
    });
    UnwrapOptions options;
    options.width = 256;
    const LightProbe far = unwrapMirrorBall(picture, ball, camera, options);
    options.distance_to_room = distanceToWalls;
    const LightProbe near = unwrapMirrorBall(picture, ball, camera, options);
    const std::vector<double> near_errors = directionErrors(near.environment, ball, kView);
    const std::vector<double> far_errors = directionErrors(far.environment, ball, kView);
    EXPECT_LT(near_errors[near_errors.size() / 2], 0.1);
    EXPECT_LT(near_errors[near_errors.size() * 99 / 100], 1.0);
    EXPECT_GT(far_errors[far_errors.size() / 2], 1.0);  // 6 cm at 2 m: 1.4 degrees
}

// The photograph's own camera, the ball well away from the axis: an ellipse, and only a crop.
TEST(UnwrapMirrorBall, UsesThePhotographsCameraAndACrop)
{
    MirrorBall ball = ballAt(0.0);
    ball.radius_m = 0.2;
    const Camera camera = Camera::lookAt({-0.4, 1.2, 1.2}, {0.6, 0.4, -0.2}, 500.0, 800, 600);
    // The outline as a user would measure it: middle and size of the ball's silhouette.
    const Image<Rgb> silhouette = renderBall(
        ball, camera, [](glm::dvec3, glm::dvec3) { return Rgb(1.0f); }, {}, {}, Rgb(0.0f));
    double area = 0.0;
    for (int y = 0; y < 600; ++y) {
        for (int x = 0; x < 800; ++x) {
            const double share = silhouette(x, y).r;
            ball.center_px += share * glm::dvec2(x + 0.5, y + 0.5);
            area += share;
        }
    }
    ball.center_px = (ball.center_px - glm::dvec2(150.0, 140.0)) / area;
    ball.radius_px = std::sqrt(area / pi);
    const glm::ivec2 crop(ball.center_px - ball.radius_px - 7.0);
    const glm::ivec2 size(static_cast<int>(2.0 * ball.radius_px + 15.0));
    const Image<Rgb> picture = renderBall(
        ball, camera, [](glm::dvec3, glm::dvec3 d) { return colourOf(d); }, crop, size);
    UnwrapOptions options;
    options.width = 256;
    options.crop_origin_px = crop;
    const LightProbe probe = unwrapMirrorBall(picture, ball, camera, options);
    EXPECT_FALSE(hasFinding(probe.findings, "probe-outline-mismatch"));
    EXPECT_FALSE(hasFinding(probe.findings, "probe-outside-image"));
    const std::vector<double> errors = directionErrors(probe.environment, ball, camera.position_m);
    EXPECT_LT(errors[errors.size() / 2], 0.1);
}

TEST(UnwrapMirrorBall, MovesAndScalesOntoTheMeasuredOutline)
{
    const MirrorBall ball = ballAt(120.0);
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture =
        renderBall(ball, camera, [](glm::dvec3, glm::dvec3 d) { return colourOf(d); });
    Camera off = camera;
    off.principal_px += glm::dvec2(9.0, -5.0);
    off.focal_px *= 1.05;
    UnwrapOptions options;
    options.width = 256;
    const LightProbe probe = unwrapMirrorBall(picture, ball, off, options);
    EXPECT_TRUE(hasFinding(probe.findings, "probe-outline-mismatch"));
    const std::vector<double> errors = directionErrors(probe.environment, ball, kView);
    EXPECT_LT(errors[errors.size() / 2], 0.1);
}

// The background is black: hardly any of it may leak over the rim (see kRimPixels).
TEST(UnwrapMirrorBall, FillsTheBlindSpotFromTheRimWithoutBackground)
{
    const MirrorBall ball = ballAt(60.0);
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture =
        renderBall(ball, camera, [](glm::dvec3, glm::dvec3) { return Rgb(1.0f); });
    const LightProbe probe = unwrapMirrorBall(picture, ball, camera, {});
    EXPECT_TRUE(hasFinding(probe.findings, "probe-blind-spot"));
    for (const Rgb& texel : probe.environment.pixels.pixels())
        ASSERT_NEAR(texel.r, 1.0f, 0.02f);
}

TEST(UnwrapMirrorBall, SaysWhenThePictureCutsTheBall)
{
    MirrorBall ball = ballAt(120.0);
    ball.center_px = {100.0, 140.0};
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const LightProbe probe = unwrapMirrorBall(Image<Rgb>(300, 280, Rgb(1.0f)), ball, camera, {});
    EXPECT_TRUE(hasFinding(probe.findings, "probe-outside-image"));
}

TEST(UnwrapMirrorBall, ChoosesTheWidthFromTheBall)
{
    const auto widthFor = [](double radius_px) {
        MirrorBall ball = ballAt(radius_px);
        const Camera camera = ballCamera(ball, kView, 300, 280);
        return unwrapMirrorBall(Image<Rgb>(300, 280, Rgb(1.0f)), ball, camera, {})
            .environment.pixels.width();
    };
    EXPECT_EQ(widthFor(40.0), 256);    // pi * 40 = 126
    EXPECT_EQ(widthFor(130.0), 512);   // 408
    EXPECT_EQ(widthFor(260.0), 1024);  // 817
}

TEST(UnwrapMirrorBall, DoesNotDependOnTheNumberOfThreads)
{
    const MirrorBall ball = ballAt(60.0);
    const Camera camera = ballCamera(ball, kView, 300, 280);
    const Image<Rgb> picture =
        renderBall(ball, camera, [](glm::dvec3, glm::dvec3 d) { return colourOf(d); });
    setThreadCount(1);
    const LightProbe one = unwrapMirrorBall(picture, ball, camera, {});
    setThreadCount(4);
    const LightProbe four = unwrapMirrorBall(picture, ball, camera, {});
    setThreadCount(0);
    EXPECT_EQ(one.environment.pixels, four.environment.pixels);
}

TEST(UnwrapMirrorBall, RefusesWhatHasNoMeaning)
{
    const Image<Rgb> picture(300, 280, Rgb(1.0f));
    const MirrorBall good = ballAt(100.0);
    const Camera camera = ballCamera(good, kView, 300, 280);
    const auto refuses = [&](auto change) {
        MirrorBall ball = good;
        change(ball);
        EXPECT_THROW((void)unwrapMirrorBall(picture, ball, camera, {}), InputError);
    };
    refuses([](MirrorBall& ball) { ball.radius_px = 0.0; });
    refuses([](MirrorBall& ball) { ball.radius_m = -1.0; });
    refuses([](MirrorBall& ball) { ball.reflectance = 0.0; });
    refuses([](MirrorBall& ball) { ball.center_m = kView; });
    EXPECT_THROW((void)ballCamera(good, good.center_m + glm::dvec3(0.0, 1.0, 0.0), 9, 9),
                 InputError);
    Camera away = camera;
    away.forward = -camera.forward;
    away.right = -camera.right;
    EXPECT_THROW((void)unwrapMirrorBall(picture, good, away, {}), InputError);
    UnwrapOptions odd;
    odd.width = 333;
    EXPECT_THROW((void)unwrapMirrorBall(picture, good, camera, odd), InputError);
    Image<Rgb> broken = picture;
    broken(3, 4).g = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW((void)unwrapMirrorBall(broken, good, camera, {}), InputError);
    EXPECT_THROW((void)unwrapMirrorBall({}, good, camera, {}), InputError);
}

TEST(ProbeFromLatLong, PassesThroughAndResamplesByArea)
{
    Image<Rgb> source(64, 32);
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 64; ++x)
            source(x, y) = colourOf(environmentDirectionFromUv({(x + 0.5) / 64, (y + 0.5) / 32}));
    EXPECT_EQ(probeFromLatLong(source, 0).environment.pixels, source);
    const LightProbe half = probeFromLatLong(source, 32);
    EXPECT_EQ(half.environment.pixels.height(), 16);
    for (const glm::dvec3 normal : {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, -1)})
        EXPECT_LT(glm::length(irradiance(half.environment, normal) - irradiance({source}, normal)),
                  0.01);  // both are midpoint sums, 32 texels around: (pi/32)^2 / 3
    EXPECT_THROW((void)probeFromLatLong(Image<Rgb>(64, 64), 0), InputError);
}

// Drawn from the definition: the middle looks along -z, the rim along +z, the angle is linear.
TEST(ProbeFromAngularMap, PutsEveryDirectionInItsPlace)
{
    constexpr int kSide = 400;
    Image<Rgb> source(kSide, kSide);
    for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) {
            const double u = 2.0 * (x + 0.5) / kSide - 1.0;
            const double v = 1.0 - 2.0 * (y + 0.5) / kSide;
            const double r = std::max(std::hypot(u, v), 1e-9);
            const double angle = std::min(r, 1.0) * pi;
            source(x, y) =
                colourOf({std::sin(angle) * u / r, std::sin(angle) * v / r, -std::cos(angle)});
        }
    }
    const LightProbe probe = probeFromAngularMap(source, 128);
    for (int y = 0; y < 64; ++y) {
        for (int x = 0; x < 128; ++x) {
            const glm::dvec3 d = environmentDirectionFromUv({(x + 0.5) / 128, (y + 0.5) / 64});
            // The rim, +z, is half a pixel of pi/200 away from exact.
            ASSERT_LT(glm::length(vectorOf(probe.environment.pixels(x, y)) - d), 0.02);
        }
    }
    EXPECT_EQ(probeFromAngularMap(source, 0).environment.pixels.width(), 512);
    EXPECT_THROW((void)probeFromAngularMap(Image<Rgb>(64, 32), 0), InputError);
}

}  // namespace
}  // namespace insitu
