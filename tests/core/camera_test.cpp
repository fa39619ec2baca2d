#include "core/camera.h"

#include "core/check.h"
#include "core/random.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <numbers>

namespace insitu {
namespace {

void expectNear(glm::dvec3 a, glm::dvec3 b, double tolerance)
{
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(a[i], b[i], tolerance) << "component " << i;
}

TEST(Camera, HandComputedProjection)
{
    Camera camera;  // at the origin, looking along -z
    camera.width = 200;
    camera.height = 100;
    camera.focal_px = {50.0, 40.0};
    camera.principal_px = {100.0, 50.0};
    // Two metres ahead, one to the right, half a metre up: u = 50·1/2 + 100, v = 50 - 40·0.5/2.
    const auto pixel = camera.project({1.0, 0.5, -2.0});
    ASSERT_TRUE(pixel);
    EXPECT_EQ(pixel->x, 125.0);
    EXPECT_EQ(pixel->y, 40.0);
    EXPECT_FALSE(camera.project({0.0, 0.0, 1.0}));
    EXPECT_FALSE(camera.project({0.0, 0.0, 0.0}));
    expectNear(camera.rayDirection({100.0, 50.0}), {0.0, 0.0, -1.0}, 0.0);
}

TEST(Camera, LookAtSeesItsTargetInTheCentre)
{
    const Camera camera = Camera::lookAt({-0.4, 0.6, 1.1}, {0.0, 0.45, 0.0}, 300.0, 64, 48);
    const auto centre = camera.project({0.0, 0.45, 0.0});
    ASSERT_TRUE(centre);
    EXPECT_NEAR(centre->x, 32.0, tolerance::kIterative);
    EXPECT_NEAR(centre->y, 24.0, tolerance::kIterative);
    // Up in the world is up in the picture, and the frame is right-handed as documented.
    EXPECT_LT(camera.project({0.0, 0.5, 0.0})->y, centre->y);
    EXPECT_NEAR(camera.right.y, 0.0, tolerance::kDouble);
    expectNear(glm::cross(camera.right, camera.up), -camera.forward, tolerance::kDouble);
    EXPECT_NEAR(glm::length(camera.up), 1.0, tolerance::kDouble);
    EXPECT_THROW((void)Camera::lookAt({0, 2, 0}, {0, 0, 0}, 300.0, 64, 48), LogicError);
}

TEST(Camera, ProjectionAndRaysAreInverse)
{
    RandomStream random(4, 0, 0);
    const auto between = [&](double low, double high) {
        return low + (high - low) * random.uniformDouble();
    };
    for (int i = 0; i < 500; ++i) {
        const glm::dvec3 position(between(-3, 3), between(0, 3), between(-3, 3));
        const glm::dvec3 target = position + glm::dvec3(between(-1, 1), between(-1, 1), 0.3);
        Camera camera = Camera::lookAt(position, target, between(200, 2000), 640, 480);
        camera.focal_px.y *= 1.1;
        camera.principal_px += glm::dvec2(between(-20, 20), between(-20, 20));
        camera.division = i % 2 == 0 ? 0.0 : between(-0.3, 0.3);
        const glm::dvec2 pixel(between(0, 640), between(0, 480));
        const glm::dvec3 direction = camera.rayDirection(pixel);
        EXPECT_NEAR(glm::length(direction), 1.0, tolerance::kDouble);
        const auto back = camera.project(position + direction * between(0.1, 50.0));
        ASSERT_TRUE(back);
        EXPECT_NEAR(back->x, pixel.x, tolerance::kIterative);
        EXPECT_NEAR(back->y, pixel.y, tolerance::kIterative);
    }
}

// λ = −0.1 at 0.8 half diagonals (40 px of 50): straight radius 0.8 / (1 − 0.1 · 0.64) · 50.
TEST(Camera, ABarrelLensShowsTheCornersNearer)
{
    Camera camera = Camera::lookAt({0, 1, 3}, {0, 1, 0}, 70.0, 80, 60);
    camera.division = -0.1;
    const glm::dvec2 straight = camera.straightened({40.0 + 40.0, 30.0});
    EXPECT_NEAR(straight.x, 40.0 + 42.735042735042735, 43.0 * tolerance::kDouble);
    EXPECT_EQ(straight.y, 30.0);
    EXPECT_NEAR(camera.distorted(straight)->x, 80.0, 80.0 * tolerance::kDouble);
    const glm::dvec3 ray = camera.rayDirection({80.0, 30.0});
    EXPECT_NEAR(ray.x / -ray.z, 42.735042735042735 / 70.0, tolerance::kDouble);
    EXPECT_NEAR(camera.project(camera.position_m + 2.0 * ray)->x, 80.0, 80.0 * tolerance::kDouble);
}

TEST(Camera, APincushionSeesNothingBeyondItsEdge)
{
    Camera camera = Camera::lookAt({0, 1, 3}, {0, 1, 0}, 70.0, 80, 60);
    camera.division = 0.4;
    // 4 λ s² = 1 at s = 0.79 half diagonals = 39.5 px.
    EXPECT_TRUE(camera.distorted({40.0 + 39.5, 30.0}));
    EXPECT_FALSE(camera.distorted({40.0 + 39.6, 30.0}));
    EXPECT_FALSE(camera.project(camera.position_m + glm::dvec3(0.8, 0.0, -1.0)));
}

TEST(Camera, WithoutDistortionNothingIsTouched)
{
    const Camera camera = Camera::lookAt({0, 1, 3}, {0, 1, 0}, 70.0, 80, 60);
    const glm::dvec2 pixel(79.1, 3.3);
    EXPECT_EQ(camera.straightened(pixel), pixel);
    EXPECT_EQ(*camera.distorted(pixel), pixel);
}

}  // namespace
}  // namespace insitu
