#include "calib/vanishing_points.h"

#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

LineSegment through(glm::dvec2 a, glm::dvec2 b)
{
    return {RoomAxis::X, a, b};
}

TEST(VanishingPoint, IsWhereTwoLinesMeet)
{
    const std::vector<LineSegment> lines = {through({0, 0}, {100, 50}),
                                            through({0, 400}, {100, 350})};
    const auto vp = vanishingPoint(lines, {200, 100}, 800.0);
    ASSERT_TRUE(vp);
    const auto point = vp->inPicture({200, 100});
    ASSERT_TRUE(point);
    EXPECT_NEAR(point->x, 400.0, tolerance::kIterative);
    EXPECT_NEAR(point->y, 200.0, tolerance::kIterative);
}

TEST(VanishingPoint, ParallelLinesMeetAtInfinityInTheirDirection)
{
    const std::vector<LineSegment> lines = {through({0, 0}, {300, 400}),
                                            through({50, 0}, {350, 400})};
    const auto vp = vanishingPoint(lines, {200, 100}, 800.0);
    ASSERT_TRUE(vp);
    EXPECT_FALSE(vp->inPicture({200, 100}));
    const glm::dvec3 d = vp->direction(500.0);
    EXPECT_NEAR(std::abs(d.x), 0.6, tolerance::kIterative);
    EXPECT_NEAR(std::abs(d.y), 0.8, tolerance::kIterative);
    EXPECT_NEAR(d.z, 0.0, tolerance::kIterative);
}

// The direction turns smoothly while the lines pass through "parallel": no jump at infinity.
TEST(VanishingPoint, NothingHappensAtInfinity)
{
    glm::dvec3 last(0.0);
    for (int i = -10; i <= 10; ++i) {
        const std::vector<LineSegment> lines = {through({0, 0}, {400, 0}),
                                                through({0, 300}, {400, 300 + 0.01 * i})};
        const auto vp = vanishingPoint(lines, {200, 150}, 800.0);
        ASSERT_TRUE(vp);
        glm::dvec3 d = vp->direction(800.0);
        if (d.x < 0.0) d = -d;
        // One step moves the far end by 0.01 px in 400: the direction turns by that over 300 px.
        if (i > -10) {
            EXPECT_LT(glm::length(d - last), 1e-4) << i;
        }
        last = d;
    }
}

TEST(VanishingPoint, NeedsTwoDifferentLines)
{
    const LineSegment one = through({10, 20}, {110, 70});
    EXPECT_FALSE(vanishingPoint(std::vector{one}, {0, 0}, 800.0));
    EXPECT_FALSE(vanishingPoint(std::vector{one, through({210, 120}, {310, 170})}, {0, 0}, 800.0));
}

// Closed form: directions (1,0,1)/√2 and (1,0,−1)/√2 are orthogonal and vanish at x = ±f.
TEST(FocalFromPair, ClosedForm)
{
    const VanishingPoint a{{640.0, 0.0, 1.0}};
    const VanishingPoint b{{-640.0, 0.0, 1.0}};
    const auto focal = focalFromOrthogonalPair(a, b);
    ASSERT_TRUE(focal);
    EXPECT_NEAR(*focal, 640.0, 640.0 * tolerance::kDouble);
}

TEST(FocalFromPair, SameSideHasNoRealFocalLength)
{
    EXPECT_FALSE(focalFromOrthogonalPair({{640.0, 0.0, 1.0}}, {{300.0, 10.0, 1.0}}));
    EXPECT_FALSE(focalFromOrthogonalPair({{640.0, 0.0, 1.0}}, {{0.0, 1.0, 0.0}}));
}

}  // namespace
}  // namespace insitu
