#include "composite/tonemap/frame_mapper.h"

#include "composite/tonemap/ashikhmin.h"
#include "composite/tonemap/durand.h"
#include "composite/tonemap/reinhard.h"
#include "composite/tonemap/selective.h"
#include "tests/support/errors.h"
#include "tests/support/tone_scenes.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

constexpr double kFrame = 0.04;  // seconds

SceneStatistics lit(double level)
{
    return {100, 0.01 * level, 10.0 * level, 2.0 * level, level};
}

TEST(AdaptationSmoother, FollowsAStepExponentiallyAndArrives)
{
    AdaptationSmoother smoother({0.4});
    EXPECT_EQ(smoother.next(lit(1.0), 0.0).log_average, 1.0);
    // 63 % of the way, in logarithms, after one time constant, however it is cut into frames.
    for (int frame = 0; frame < 10; ++frame)
        (void)smoother.next(lit(100.0), kFrame);
    const SceneStatistics& now = smoother.next(lit(100.0), 0.0);
    EXPECT_NEAR(std::log10(now.log_average), 2.0 * (1.0 - std::exp(-1.0)), 1e-3);
    EXPECT_NEAR(std::log10(now.mean / 2.0), 2.0 * (1.0 - std::exp(-1.0)), 1e-3);
    for (int frame = 0; frame < 200; ++frame)
        (void)smoother.next(lit(100.0), kFrame);
    EXPECT_NEAR(smoother.next(lit(100.0), kFrame).log_average, 100.0, 0.2);
}

TEST(AdaptationSmoother, DoesNotFlickerAndCanStartAnew)
{
    AdaptationSmoother smoother;
    (void)smoother.next(lit(1.0), 0.0);
    for (const double level : {1.001, 0.999, 1.0015})
        EXPECT_EQ(smoother.next(lit(level), kFrame).log_average, 1.0);
    smoother.reset();
    EXPECT_EQ(smoother.next(lit(7.0), kFrame).log_average, 7.0);
    // Black has no logarithm to follow.
    EXPECT_EQ(smoother.next({100, 0.0, 0.0, 0.0, 0.0}, kFrame).log_average, 0.0);
    EXPECT_EQ(smoother.next(lit(7.0), kFrame).log_average, 7.0);
    AdaptationSmoother at_once({0.0});
    (void)at_once.next(lit(1.0), 0.0);
    EXPECT_EQ(at_once.next(lit(1.001), kFrame).log_average, 1.001);
    EXPECT_THAT(inputErrorOf([] { AdaptationSmoother({-1.0}); }), testing::HasSubstr("-1 s"));
}

/// A room with something bright of 40x30 pixels in it.
Image<Rgb> roomWithBox(int left, int top)
{
    Image<Rgb> scene = tone_scenes::room(700, 560);
    for (int y = top; y < top + 30; ++y)
        for (int x = left; x < left + 40; ++x)
            scene(x, y) = Rgb(3.0f, 2.0f + 0.02f * static_cast<float>(x - left), 1.0f);
    return scene;
}

TEST(FrameMapper, AMovedObjectCostsItsOwnPixelsAndGivesTheSameBits)
{
    SelectiveOptions selective;
    selective.importance_threshold = 2.0;
    const std::shared_ptr<const ToneMapOperator> operators[] = {
        makeAshikhmin(),
        makeReinhardLocal({}),
        makeReinhard({}),
        makeSelective(makeAshikhmin(), selective)};
    Progress silent;
    for (const auto& tone_map : operators) {
        FrameMapper mapper(tone_map, {1e6});  // the look stays
        const Image<Rgb> first = roomWithBox(100, 100);
        const SceneStatistics statistics = measureScene(first);
        EXPECT_EQ(mapper.map(first, kFrame, silent), tone_map->map(first, statistics, silent));
        EXPECT_EQ(mapper.mappedShare(), 1.0);
        for (const int left : {103, 140, 660}) {
            const Image<Rgb> moved = roomWithBox(left, 100);
            AdaptationSmoother same_look({1e6});
            (void)same_look.next(statistics, 0.0);
            const SceneStatistics used = same_look.next(measureScene(moved), kFrame);
            EXPECT_EQ(mapper.map(moved, kFrame, silent), tone_map->map(moved, used, silent));
        }
        const Image<Rgb> last = roomWithBox(660, 100);
        (void)mapper.map(last, kFrame, silent);
        EXPECT_EQ(mapper.mappedShare(), 0.0) << "nothing has changed";
    }
}

TEST(FrameMapper, MapsPartsOnlyWhereTheyCanBe)
{
    Progress silent;
    FrameMapper local(makeAshikhmin(), {1e6});
    FrameMapper whole(makeDurand({}), {1e6});
    for (FrameMapper* mapper : {&local, &whole}) {
        (void)mapper->map(roomWithBox(100, 100), kFrame, silent);
        (void)mapper->map(roomWithBox(104, 100), kFrame, silent);
    }
    EXPECT_GT(local.mappedShare(), 0.0);
    EXPECT_LT(local.mappedShare(), 0.5);
    EXPECT_EQ(whole.mappedShare(), 1.0);
    // Another size, another look: all anew.
    (void)local.map(tone_scenes::room(300, 200), kFrame, silent);
    EXPECT_EQ(local.mappedShare(), 1.0);
    EXPECT_TRUE(local.map(Image<Rgb>(), kFrame, silent).empty());
}

class Cancelled : public Progress {
public:
    [[nodiscard]] bool cancelled() const override { return true; }
};

TEST(FrameMapper, WhatACancelledFrameLeftIsNotBuiltUpon)
{
    const std::shared_ptr<const ToneMapOperator> tone_map = makeAshikhmin();
    FrameMapper mapper(tone_map, {0.0});
    const Image<Rgb> scene = roomWithBox(100, 100);
    Cancelled cancelled;
    Progress silent;
    (void)mapper.map(scene, kFrame, silent);
    Image<Rgb> brighter = scene;
    for (Rgb& value : brighter.pixels())
        value *= 2.0f;
    EXPECT_THROW((void)mapper.map(brighter, kFrame, cancelled), CancelledError);
    EXPECT_EQ(mapper.map(brighter, kFrame, silent), tone_map->map(brighter, silent));
    EXPECT_EQ(mapper.mappedShare(), 1.0);
}

}  // namespace
}  // namespace insitu
