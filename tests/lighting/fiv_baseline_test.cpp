#include "bench/fiv_baseline.h"

#include "core/random.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/support/tolerance.h"

#include <gtest/gtest.h>

#include <numbers>

namespace insitu::baseline {
namespace {

using std::numbers::pi;

EnvironmentMap constant(float radiance)
{
    return {Image<Rgb>(64, 32, Rgb(radiance, 2.0f * radiance, 0.0f))};
}

RayScene raysOf(const TriangleMesh& mesh)
{
    const TriangleMesh* const pointer = &mesh;
    return RayScene(std::span<const TriangleMesh* const>(&pointer, 1));
}

/// A ball of radius 1 around (0, 2, 0) in constant light.
class Ball : public testing::Test {
protected:
    TriangleMesh mesh_ = shapes::sphere({0, 2, 0}, 1.0f, 24);
    RayScene rays_ = raysOf(mesh_);
    LocalFrame local_ = localFrame(mesh_);
    TexelLight light_ = texelLight(constant(1.0f), 16);
    IrradianceCube cube_{light_, 16};
    Table table_{rays_, local_, light_, {24, 13, 12, 1.05, 8.0}};
    Occluder occluder_{&table_, {0, 2, 0}, 1.0};
};

TEST_F(Ball, ConstantLightIsPiWithoutAnOccluder)
{
    for (const glm::dvec3& n : {glm::dvec3(0, 1, 0), glm::normalize(glm::dvec3(1, 2, -3))}) {
        EXPECT_NEAR(cube_.at(n).r / pi, 1.0, 2e-3);
        EXPECT_NEAR(cube_.at(n).g / pi, 2.0, 4e-3);
        EXPECT_EQ(cube_.at(n).b, 0.0f);
    }
    EXPECT_NEAR(light_.total().channels[0].y, 0.0f, 1e-4);
}

TEST_F(Ball, ShadowIsTheFormFactor)
{
    const glm::dvec3 up(0, 1, 0);
    for (const double x : {0.0, 0.7, 1.5}) {
        const Rgb shaded = shadowed(cube_, {&occluder_, 1}, {x, 0, 0}, up);
        const double square = x * x + 4.0;
        // (r/d)² cos of the hidden hemisphere.
        const double seen = 1.0 - 2.0 / std::sqrt(square) / square;
        EXPECT_NEAR(shaded.r / pi, seen, 0.02) << x;
    }
}

TEST_F(Ball, CasesBAndC)
{
    // The receiver's plane halves the ball: half of N·FIV; behind it: nothing.
    const glm::dvec3 x(2.0, 2.0, 0.0);
    const Rgb free = cube_.at({0, 1, 0});
    EXPECT_EQ(shadowed(cube_, {&occluder_, 1}, x, glm::dvec3(1, 0, 0)), cube_.at({1, 0, 0}));
    const glm::dvec3 n = glm::normalize(glm::dvec3(-0.2, 1, 0));
    const double height = 2.0 * 0.2 / std::sqrt(1.04);
    const double whole = table_.at(glm::vec3(x - occluder_.center)).along(glm::vec3(n)).r;
    EXPECT_NEAR(shadowed(cube_, {&occluder_, 1}, x, n).r,
                cube_.at(n).r - whole * (height + 1.0) / 2.0,
                1e-4);
    EXPECT_NEAR(
        shadowed(cube_, {&occluder_, 1}, x, n, {.partial = false}).r, cube_.at(n).r - whole, 1e-4);
    EXPECT_GT(free.r, 0.0f);
}

TEST_F(Ball, TwoInTheSamePlaceHideAsOne)
{
    const Occluder both[] = {occluder_, occluder_};
    const glm::dvec3 up(0, 1, 0);
    const Rgb one = shadowed(cube_, {&occluder_, 1}, {0.3, 0, 0}, up);
    const Rgb two = shadowed(cube_, both, {0.3, 0, 0}, up);
    // Overlapped% of equal discs is a half.
    EXPECT_NEAR(two.r, one.r, 1e-4);
    EXPECT_LT(shadowed(cube_, both, {0.3, 0, 0}, up, {.multiple = false}).r, one.r - 0.1f);
}

TEST_F(Ball, BruteForceAgrees)
{
    const RayScene* const scenes[] = {&rays_};
    const glm::dvec3 up(0, 1, 0);
    for (const double x : {0.0, 0.5, 2.0}) {
        const Rgb truth = bruteForce(scenes, light_, {x, 0, 0}, up);
        EXPECT_NEAR(shadowed(cube_, {&occluder_, 1}, {x, 0, 0}, up).r, truth.r, 0.03 * pi) << x;
    }
}

TEST_F(Ball, ConvexObjectDoesNotShadowItself)
{
    const glm::dvec3 n = glm::normalize(glm::dvec3(1, 1, 0));
    const Occluder near = occluder_;
    const Rgb lit = selfShadowed(light_, near, near.center + 1.06 * n, n);
    EXPECT_NEAR(lit.r / pi, 1.0, 0.12) << "the first shell lies off the surface";
}

TEST(Baseline, DiscOverlap)
{
    EXPECT_EQ(discOverlap(1.0, 1.0, 2.5), 0.0);
    EXPECT_NEAR(discOverlap(1.0, 1.0, 0.0), pi, tolerance::kDouble);
    EXPECT_NEAR(discOverlap(2.0, 0.5, 1.0), 0.25 * pi, tolerance::kDouble);
    // Vesica piscis: 2π/3 − √3/2.
    EXPECT_NEAR(discOverlap(1.0, 1.0, 1.0), 2.0 * pi / 3.0 - std::sqrt(3.0) / 2.0, 1e-12);
    EXPECT_EQ(discOverlap(1.3, 0.8, 1.1), discOverlap(0.8, 1.3, 1.1));
}

TEST(Baseline, RaysAreCulledByTheCone)
{
    const TriangleMesh mesh = shapes::sphere({0, 0, 0}, 1.0f, 12);
    const RayScene rays = raysOf(mesh);
    const TexelLight light = texelLight(constant(1.0f), 16);
    const Table table(rays, localFrame(mesh), light, {8, 5, 2, 2.0, 4.0});
    // Shares of the sphere of directions within asin(1/2) and asin(1/4).
    const double expected = 40.0 * static_cast<double>(light.radiance.size()) * 0.5 *
                            (2.0 - std::sqrt(0.75) - std::sqrt(1.0 - 1.0 / 16.0));
    // Positions on the cube's own axes see its texels in regular order: no error of chance.
    EXPECT_NEAR(static_cast<double>(table.rays()) / expected, 1.0, 0.15);
}

}  // namespace
}  // namespace insitu::baseline
