#include "composite/tonemap/selective.h"

#include "composite/tonemap/ashikhmin.h"
#include "composite/tonemap/reinhard.h"
#include "core/color.h"
#include "core/parallel.h"
#include "tests/support/ashikhmin_direct.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"
#include "tests/support/tone_scenes.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

Image<Rgb> selectiveOf(const Image<Rgb>& scene, const SelectiveOptions& options = {})
{
    Progress silent;
    return makeSelective(makeAshikhmin(), options)->map(scene, silent);
}

Image<Rgb> localOf(const Image<Rgb>& scene)
{
    Progress silent;
    return makeAshikhmin()->map(scene, silent);
}

/// Plain but for a soft gradient, with one small lamp.
Image<Rgb> lampScene(int width, int height)
{
    Image<Rgb> scene(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float level = 1.0f + 0.2f * static_cast<float>(x) / static_cast<float>(width);
            scene(x, y) = Rgb(std::hypot(x - 200, y - 120) < 12 ? 300.0f : level);
        }
    return scene;
}

TEST(Selective, EqualsTheLocalOperatorAroundEdgesAndTheGlobalOneElsewhere)
{
    const Image<Rgb> scene = lampScene(640, 400);
    const Image<Rgb> display = selectiveOf(scene);
    const Image<Rgb> local = localOf(scene);
    const Image<double> global = direct::displayLuminance(scene, {}, false);
    for (int y = 100; y < 140; ++y)
        for (int x = 180; x < 220; ++x)
            ASSERT_EQ(display(x, y), local(x, y)) << x << ", " << y;
    for (int y = 200; y < 400; ++y)
        for (int x = 300; x < 640; ++x)
            ASSERT_NEAR(display(x, y).g, global(x, y), tolerance::kFloat) << x << ", " << y;
    EXPECT_LT(selectedShare(*makeAshikhmin(), {}, scene), 0.1);
    EXPECT_GT(selectedShare(*makeAshikhmin(), {}, scene), 0.0);
}

// Stripes along an axis, which the two operators show differently, and a marked part: across its
// border the picture goes from one to the other in small steps.
TEST(Selective, LeavesNoSeam)
{
    for (const bool along_x : {false, true}) {
        Image<Rgb> scene(400, 400);
        SelectiveOptions options;
        options.importance = Image<float>(400, 400, 0.0f);
        options.always = Image<float>(400, 400, 0.0f);
        const auto at = [&](int stripe, int across) {
            return along_x ? std::pair(across, stripe) : std::pair(stripe, across);
        };
        for (int i = 0; i < 400; ++i)
            for (int k = 0; k < 400; ++k) {
                const auto [x, y] = at(i, k);
                scene(x, y) = Rgb(1.0f + 0.3f * std::sin(0.8f * static_cast<float>(i)) +
                                  (i < 40 ? 300.0f : 0.0f));
                options.always(x, y) = k >= 100 && k < 203 ? 1.0f : 0.0f;
            }
        const Image<Rgb> display = selectiveOf(scene, options);
        const Image<Rgb> local = localOf(scene);
        const Image<double> global = direct::displayLuminance(scene, {}, false);
        double largest_gap = 0.0;
        double largest_step = 0.0;
        for (int i = 150; i < 350; ++i)
            for (int k = 20; k < 380; ++k) {
                const auto [x, y] = at(i, k);
                const auto [next_x, next_y] = at(i, k + 1);
                largest_gap = std::max(largest_gap,
                                       std::abs(static_cast<double>(local(x, y).g) - global(x, y)));
                largest_step = std::max(
                    largest_step,
                    std::abs(static_cast<double>(display(next_x, next_y).g - display(x, y).g)));
            }
        ASSERT_GT(largest_gap, 0.02);  // else the test says nothing
        // The weight falls by a third of its range over 4 pixels; the curve is not linear in it.
        EXPECT_LT(largest_step, 0.15 * largest_gap);
        EXPECT_EQ(display(at(200, 150).first, at(200, 150).second),
                  local(at(200, 150).first, at(200, 150).second));
    }
}

TEST(Selective, AlwaysCountsWhatIsMarked)
{
    const Image<Rgb> scene = tone_scenes::room(320, 200);
    SelectiveOptions options;
    options.importance = Image<float>(320, 200, 0.0f);
    options.always = Image<float>(320, 200, 1.0f);
    EXPECT_EQ(selectiveOf(scene, options), localOf(scene));
    EXPECT_EQ(selectedShare(*makeAshikhmin(), options, scene), 1.0);
}

TEST(Selective, TakesAMapInPlaceOfTheGradient)
{
    const Image<Rgb> scene = tone_scenes::room(640, 400);
    SelectiveOptions options;
    options.importance = Image<float>(640, 400, 0.05f);
    options.importance(320, 200) = 0.5f;
    const double share = selectedShare(*makeAshikhmin(), options, scene);
    EXPECT_GT(share, 0.0);
    EXPECT_LT(share, 0.05);
    EXPECT_EQ(selectiveOf(scene, options)(320, 200), localOf(scene)(320, 200));
}

TEST(Selective, OfAGlobalOperatorIsThatOperator)
{
    const Image<Rgb> scene = tone_scenes::room(130, 90);
    Progress silent;
    EXPECT_EQ(makeSelective(makeReinhard({}))->map(scene, silent),
              makeReinhard({})->map(scene, silent));
}

TEST(Selective, SameBitsForAnyNumberOfThreads)
{
    const Image<Rgb> scene = tone_scenes::room(1100, 300);
    setThreadCount(1);
    const Image<Rgb> one = selectiveOf(scene);
    setThreadCount(0);
    EXPECT_EQ(selectiveOf(scene), one);
}

TEST(Selective, RefusesMapsThatDoNotFit)
{
    const Image<Rgb> scene(20, 10, Rgb(1.0f));
    SelectiveOptions options;
    options.always = Image<float>(10, 20, 0.0f);
    EXPECT_THAT(inputErrorOf([&] { (void)selectiveOf(scene, options); }),
                testing::HasSubstr("is 10x20, the picture 20x10"));
    options.always = Image<float>(20, 10, 1.5f);
    options.importance_threshold = 0.0;
    const Findings findings = options.validate();
    EXPECT_TRUE(hasFinding(findings, "tonemap-importance-map"));
    EXPECT_TRUE(hasFinding(findings, "tonemap-importance-threshold"));
    EXPECT_THROW((void)makeSelective(makeAshikhmin(), options), InputError);
}

}  // namespace
}  // namespace insitu
