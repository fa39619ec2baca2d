#include "capture/light_probe.h"
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

EnvironmentMap directions(int width)
{
    return panorama([](glm::dvec3, glm::dvec3 d) { return colourOf(d); }, {}, width);
}

void expectDirection(const Image<Rgb>& cross, int x, int y, glm::dvec3 expected)
{
    // A face's middle lies between four pixels; pixels of 64 a side are up to 1.8 degrees wide.
    EXPECT_LT(glm::length(vectorOf(cross(x, y)) - glm::normalize(expected)), 0.03) << x << " " << y;
}

// The middles of the faces, and pixels beside edges that are joined in the unfolded cube.
TEST(CubeCross, LooksAlongTheAxesHorizontally)
{
    const Image<Rgb> cross = cubeCross(directions(512), CubeLayout::Horizontal, 64);
    ASSERT_EQ(cross.width(), 256);
    ASSERT_EQ(cross.height(), 192);
    expectDirection(cross, 96, 96, {0, 0, -1});
    expectDirection(cross, 160, 96, {1, 0, 0});
    expectDirection(cross, 224, 96, {0, 0, 1});
    expectDirection(cross, 32, 96, {-1, 0, 0});
    expectDirection(cross, 96, 32, {0, 1, 0});
    expectDirection(cross, 96, 160, {0, -1, 0});
    expectDirection(cross, 127, 96, {1, 0, -1});
    expectDirection(cross, 128, 96, {1, 0, -1});
    expectDirection(cross, 191, 96, {1, 0, 1});
    expectDirection(cross, 192, 96, {1, 0, 1});
    expectDirection(cross, 96, 63, {0, 1, -1});
    expectDirection(cross, 96, 128, {0, -1, -1});
    expectDirection(cross, 0, 96, {-1, 0, 1});
    EXPECT_EQ(cross(0, 0), Rgb(0.0f));
}

TEST(CubeCross, LooksAlongTheAxesVertically)
{
    const Image<Rgb> cross = cubeCross(directions(512), CubeLayout::Vertical, 64);
    ASSERT_EQ(cross.width(), 192);
    ASSERT_EQ(cross.height(), 256);
    expectDirection(cross, 96, 96, {0, 0, -1});
    expectDirection(cross, 160, 96, {1, 0, 0});
    expectDirection(cross, 32, 96, {-1, 0, 0});
    expectDirection(cross, 96, 32, {0, 1, 0});
    expectDirection(cross, 96, 160, {0, -1, 0});
    expectDirection(cross, 96, 224, {0, 0, 1});
    expectDirection(cross, 96, 191, {0, -1, 1});
    expectDirection(cross, 96, 192, {0, -1, 1});
    expectDirection(cross, 96, 255, {0, 1, 1});  // upside down: up is below
    expectDirection(cross, 127, 224, {1, 0, 1});
}

TEST(CubeCross, ComesBackWithTheSameLight)
{
    const EnvironmentMap room = panorama(roomRadiance, {0.1, 0.9, -0.2}, 512);
    for (const CubeLayout layout : {CubeLayout::Horizontal, CubeLayout::Vertical}) {
        const LightProbe back = probeFromCubeCross(cubeCross(room, layout, 128), 512);
        for (int axis = 0; axis < 3; ++axis) {
            for (const double sign : {1.0, -1.0}) {
                glm::dvec3 normal(0.0);
                normal[axis] = sign;
                const glm::dvec3 ratio =
                    irradiance(back.environment, normal) / irradiance(room, normal);
                for (int c = 0; c < 3; ++c)
                    EXPECT_NEAR(ratio[c], 1.0, 0.005);  // two resamplings of a lamp of 17 degrees
            }
        }
    }
    const LightProbe chosen =
        probeFromCubeCross(cubeCross(directions(64), CubeLayout::Horizontal, 32), 0);
    EXPECT_EQ(chosen.environment.pixels.width(), 256);  // 2 / 32 rad: 100 texels, at least 256
    for (int y = 0; y < 128; ++y)
        for (int x = 0; x < 256; ++x)
            ASSERT_LT(glm::length(vectorOf(chosen.environment.pixels(x, y)) -
                                  environmentDirectionFromUv({(x + 0.5) / 256, (y + 0.5) / 128})),
                      0.06);  // half a pixel of a face, at its clamped edge
}

TEST(AngularMap, ComesBack)
{
    const EnvironmentMap room = panorama(roomRadiance, {0.1, 0.9, -0.2}, 512);
    const LightProbe back = probeFromAngularMap(angularMap(room, 600), 512);
    for (const glm::dvec3 normal : {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, -1)})
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(irradiance(back.environment, normal)[c] / irradiance(room, normal)[c],
                        1.0,
                        0.005);  // two resamplings
    const Image<Rgb> map = angularMap(directions(256), 200);
    expectDirection(map, 100, 100, {0, 0, -1});
    expectDirection(map, 150, 100, {1, 0, 0});
    expectDirection(map, 100, 49, {0, 1, 0});
    EXPECT_EQ(map(0, 0), Rgb(0.0f));
}

TEST(ProbeFormats, RefuseWhatHasNoMeaning)
{
    EXPECT_THROW((void)probeFromCubeCross(Image<Rgb>(64, 64), 0), InputError);
    EXPECT_THROW((void)probeFromCubeCross(Image<Rgb>(66, 48), 0), InputError);
    EXPECT_THROW((void)probeFromCubeCross({}, 0), InputError);
    EXPECT_THROW((void)probeFromCubeCross(Image<Rgb>(64, 48), 33), InputError);
    Image<Rgb> broken(64, 48);
    broken(20, 20).r = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW((void)probeFromCubeCross(broken, 0), InputError);
    EXPECT_THROW((void)cubeCross(EnvironmentMap{}, CubeLayout::Vertical, 16), InputError);
    EXPECT_THROW((void)cubeCross(directions(16), CubeLayout::Vertical, 1), InputError);
    EXPECT_THROW((void)angularMap(directions(16), 9000), InputError);
}

// A camera rolled by 40 degrees, and one that looks straight down.
TEST(BallCameraUp, TurnsThePicture)
{
    MirrorBall ball;
    ball.center_px = {130.0, 130.0};
    ball.radius_px = 110.0;
    ball.radius_m = 0.06;
    ball.center_m = {0.1, 0.9, -0.2};
    struct Case {
        glm::dvec3 position;
        glm::dvec3 up;
    };
    for (const Case& c : {Case{{-0.4, 1.1, 0.8}, {std::sin(0.7), std::cos(0.7), 0.1}},
                          Case{{0.1, 2.0, -0.2}, {0.0, 0.0, -3.0}}}) {
        const Camera camera = ballCamera(ball, c.position, 260, 260, c.up);
        const std::optional<glm::dvec2> above =
            camera.project(ball.center_m + 0.05 * glm::normalize(c.up));
        ASSERT_TRUE(above);
        EXPECT_NEAR(above->x, 130.0, tolerance::kIterative);
        EXPECT_LT(above->y, 120.0);
        const Image<Rgb> picture =
            renderBall(ball, camera, [](glm::dvec3, glm::dvec3 d) { return colourOf(d); });
        UnwrapOptions options;
        options.width = 128;
        const LightProbe probe = unwrapMirrorBall(picture, ball, camera, options);
        EXPECT_LT(glm::length(vectorOf(lookUp(probe.environment, {1.0, 0.0, 0.0})) -
                              glm::dvec3(1.0, 0.0, 0.0)),
                  0.01);  // bilinear between texels of 2.8 degrees
    }
    EXPECT_THROW((void)ballCamera(ball, {0.1, 2.0, -0.2}, 9, 9), InputError);
    EXPECT_THROW((void)ballCamera(ball, {0.1, 2.0, -0.2}, 9, 9, glm::dvec3(0.0)), InputError);
}

}  // namespace
}  // namespace insitu
