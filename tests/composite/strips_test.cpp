// Pictures in strips give the bytes of the whole.
#include "composite/tonemap/strips.h"

#include "composite/tonemap/ashikhmin.h"
#include "composite/tonemap/durand.h"
#include "composite/tonemap/histogram_adjustment.h"
#include "composite/tonemap/library_operators.h"
#include "composite/tonemap/reinhard.h"
#include "composite/tonemap/selective.h"
#include "tests/support/errors.h"
#include "tests/support/tone_scenes.h"

#include <gmock/gmock.h>

#include <functional>

namespace insitu {
namespace {

/// A picture that tells how many of its rows were asked for at once.
class WatchedRows : public ImageRows {
public:
    using ImageRows::ImageRows;
    void read(int first, Image<Rgb>& rows) override
    {
        most_rows = std::max(most_rows, rows.height());
        ImageRows::read(first, rows);
    }
    int most_rows = 0;
};

/// The display, put together from the strips as they come.
Image<Rgb> mapInStrips(RadianceRows& rows, const ToneMapOperator& tone_map)
{
    Progress silent;
    Image<Rgb> display(rows.width(), rows.height());
    int top = 0;
    mapRows(
        rows,
        tone_map,
        measureRows(rows, silent),
        [&](const Image<Rgb>& strip) {
            for (int y = 0; y < strip.height(); ++y)
                std::ranges::copy(strip.row(y), display.row(top + y).begin());
            top += strip.height();
        },
        silent);
    EXPECT_EQ(top, rows.height());
    return display;
}

void expectSameAsWhole(const ToneMapOperator& tone_map, const Image<Rgb>& scene, int most_rows)
{
    Progress silent;
    const Image<Rgb> whole = tone_map.map(scene, silent);
    WatchedRows rows(scene);
    const Image<Rgb> strips = mapInStrips(rows, tone_map);
    for (int y = 0; y < scene.height(); ++y)
        for (int x = 0; x < scene.width(); ++x)
            ASSERT_EQ(strips(x, y), whole(x, y)) << x << ' ' << y;
    EXPECT_LE(rows.most_rows, most_rows);
}

/// Three strips, the last one of an odd height.
Image<Rgb> tallRoom()
{
    return tone_scenes::room(150, 1233);
}

constexpr int kStrip = SceneMapping::kStripRows;

TEST(Strips, GlobalAndLocalOperatorsGiveTheSameBytes)
{
    const Image<Rgb> scene = tallRoom();
    // The local parts look a few dozen rows around.
    expectSameAsWhole(*makeReinhard({}), scene, kStrip + 2 * 4);
    expectSameAsWhole(*makeReinhardLocal({}), scene, kStrip + 2 * 128);
    expectSameAsWhole(*makeAshikhmin(), scene, kStrip + 2 * 128);
    expectSameAsWhole(*makeDurand({}), scene, kStrip);
}

TEST(Strips, SelectiveMappingToo)
{
    const Image<Rgb> scene = tallRoom();
    SelectiveOptions options;
    options.importance_threshold = 2.0;
    options.always = Image<float>(scene.width(), scene.height());
    for (int y = 500; y < 530; ++y)
        for (int x = 20; x < 60; ++x)
            options.always(x, y) = 1.0f;
    expectSameAsWhole(*makeSelective(makeAshikhmin(), options), scene, kStrip + 2 * 128);
}

TEST(Strips, HistogramAdjustmentBlursAcrossThem)
{
    // Dim: the acuity asks for the pyramid's coarse levels.
    for (const double white : {100.0, 1e-3}) {
        HistogramAdjustmentOptions options;
        options.viewing.scene_white_cd_m2 = white;
        options.field_of_view_deg = 5.0;
        expectSameAsWhole(*makeHistogramAdjustment(options), tallRoom(), kStrip + 4 * 64);
    }
    // Places of the fovea that are larger than a strip.
    HistogramAdjustmentOptions options;
    options.field_of_view_deg = 0.1;
    expectSameAsWhole(*makeHistogramAdjustment(options), tallRoom(), 1 << 20);
}

TEST(Strips, TheLibrarysOperatorsSeeTheWhole)
{
    expectSameAsWhole(*makeLibraryOperator(LibraryOperator::Drago), tallRoom(), 1 << 20);
}

TEST(Strips, HardSizes)
{
    for (const auto& [width, height] :
         {std::pair{1, 1}, {1, 5000}, {5000, 1}, {7, 512}, {7, 513}}) {
        const Image<Rgb> scene = tone_scenes::noise(width, height, 4.0f);
        for (const auto& tone_map :
             {std::function<std::unique_ptr<ToneMapOperator>()>([] { return makeAshikhmin(); }),
              std::function<std::unique_ptr<ToneMapOperator>()>([] { return makeDurand({}); }),
              std::function<std::unique_ptr<ToneMapOperator>()>(
                  [] { return makeHistogramAdjustment(); })})
            expectSameAsWhole(*tone_map(), scene, 1 << 20);
    }
}

TEST(Strips, MeasuringThemFindsTheSameAndNamesTheFlawedPixel)
{
    Image<Rgb> scene = tallRoom();
    Progress silent;
    const SceneStatistics whole = measureScene(scene);
    ImageRows rows(scene);
    const SceneStatistics strips = measureRows(rows, silent);
    EXPECT_EQ(strips.pixels, whole.pixels);
    EXPECT_EQ(strips.smallest, whole.smallest);
    EXPECT_EQ(strips.largest, whole.largest);
    EXPECT_EQ(strips.mean, whole.mean);
    EXPECT_EQ(strips.log_average, whole.log_average);

    scene(7, 1100).r = -1.0f;
    ImageRows broken(scene);
    EXPECT_THAT(inputErrorOf([&] { (void)measureRows(broken, silent); }),
                testing::HasSubstr("pixel (7, 1100)"));
}

class Cancelled : public Progress {
public:
    [[nodiscard]] bool cancelled() const override { return true; }
};

TEST(Strips, CanBeCancelled)
{
    ImageRows rows(tallRoom());
    Cancelled progress;
    EXPECT_THROW((void)measureRows(rows, progress), CancelledError);
    EXPECT_THROW(mapRows(
                     rows, *makeReinhard({}), {}, [](const Image<Rgb>&) {}, progress),
                 CancelledError);
}

}  // namespace
}  // namespace insitu
