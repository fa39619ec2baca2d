// Operators beside Ashikhmin's: Reinhard's local one, Durand's, and those of the library.
#include "composite/tonemap/bilateral_grid.h"
#include "composite/tonemap/durand.h"
#include "composite/tonemap/library_operators.h"
#include "composite/tonemap/reinhard.h"
#include "composite/tonemap/selective.h"
#include "core/color.h"
#include "core/parallel.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"
#include "tests/support/tone_scenes.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace insitu {
namespace {

Image<Rgb> mapWith(const ToneMapOperator& tone_map, const Image<Rgb>& scene)
{
    Progress silent;
    return tone_map.map(scene, silent);
}

/// Mean of a picture's luminance around a pixel, weighted with a Gaussian cut at 32 pixels.
double gaussianMean(const Image<Rgb>& scene, int x, int y, double sigma)
{
    const int reach = std::min(32, static_cast<int>(std::ceil(3.0 * sigma)));
    double sum = 0.0;
    double weights = 0.0;
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx) {
            const double w = std::exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma));
            sum += w * luminance(scene(std::clamp(x + dx, 0, scene.width() - 1),
                                       std::clamp(y + dy, 0, scene.height() - 1)));
            weights += w;
        }
    return sum / weights;
}

// [Reinhard02] equations 5 to 9, pixel by pixel in double precision.
TEST(ReinhardLocal, IsTheDirectEvaluation)
{
    const Image<Rgb> scene = tone_scenes::room(150, 90);
    const SceneStatistics statistics = measureScene(scene);
    ReinhardOptions options;
    options.key = 0.3;
    const Image<Rgb> display = mapWith(*makeReinhardLocal(options), scene);
    const double scale = options.key / statistics.log_average;
    const double white = scale * statistics.largest;
    int beyond_first = 0;
    int compared = 0;
    for (int y = 1; y < scene.height(); y += 13)
        for (int x = 0; x < scene.width(); x += 7) {
            double v = scale * gaussianMean(scene, x, y, 0.25);
            double mean = v;
            bool undecided = false;
            for (int i = 0; i < 8; ++i) {
                const double wider = scale * gaussianMean(scene, x, y, 0.25 * std::pow(1.6, i + 1));
                const double activity =
                    std::abs(v - wider) / (256.0 * options.key / std::pow(1.6, 2.0 * i) + v);
                undecided = undecided || std::abs(activity - 0.05) < 1e-4;
                if (activity >= 0.05) break;
                mean = v;
                v = wider;
                beyond_first += i == 4 ? 1 : 0;
            }
            if (undecided) continue;
            ++compared;
            const double l = scale * luminance(scene(x, y));
            const double expected = std::min(1.0, l * (1.0 + l / (white * white)) / (1.0 + mean));
            const double found = luminance(display(x, y));
            // A channel that reaches white takes luminance with it.
            if (std::max({display(x, y).r, display(x, y).g, display(x, y).b}) >= 1.0f) continue;
            EXPECT_NEAR(found, expected, 2e-5 * std::max(expected, 0.1)) << x << " " << y;
        }
    EXPECT_GT(compared, 100);
    EXPECT_GT(beyond_first, 20) << "wide surroundings must occur";
}

TEST(ReinhardLocal, WhereNothingIsSelectedItIsTheGlobalOne)
{
    const Image<Rgb> scene = tone_scenes::room(200, 150);
    SelectiveOptions nowhere;
    nowhere.importance = Image<float>(200, 150, 0.0f);
    const Image<Rgb> selected = mapWith(*makeSelective(makeReinhardLocal({}), nowhere), scene);
    const Image<Rgb> global = mapWith(*makeReinhard({}), scene);
    EXPECT_TRUE(std::ranges::equal(selected.pixels(), global.pixels()));
    // And everywhere the local one, whatever blocks it is cut into.
    SelectiveOptions everywhere;
    everywhere.always = Image<float>(200, 150, 1.0f);
    const Image<Rgb> local = mapWith(*makeReinhardLocal({}), scene);
    const Image<Rgb> all = mapWith(*makeSelective(makeReinhardLocal({}), everywhere), scene);
    for (std::size_t i = 0; i < local.pixelCount(); ++i)
        ASSERT_NEAR(all.pixels()[i].g, local.pixels()[i].g, tolerance::kFloat) << i;
}

// The direct sum over all pixels.
TEST(BilateralGrid, IsNearTheDirectSum)
{
    Image<float> values(60, 44);
    RandomStream random(5, 0, 0);
    for (int y = 0; y < values.height(); ++y)
        for (int x = 0; x < values.width(); ++x)
            values(x, y) = (x > 30 ? 2.0f : 0.0f) + 0.02f * static_cast<float>(y) +
                           0.1f * static_cast<float>(random.uniformDouble());
    const double spatial = 6.0;
    const double range = 0.4;
    tonemap::BilateralGrid grid({values.width(), values.height(), 0.0, 3.0}, spatial, range);
    for (int y = 0; y < values.height(); ++y) {
        const auto row = values.row(y);
        grid.add(y, std::vector<float>(row.begin(), row.end()));
    }
    grid.blur();
    double squares = 0.0;
    int count = 0;
    for (int y = 2; y < values.height(); y += 5)
        for (int x = 2; x < values.width(); x += 3, ++count) {
            double sum = 0.0;
            double weights = 0.0;
            for (int j = 0; j < values.height(); ++j)
                for (int i = 0; i < values.width(); ++i) {
                    const double far =
                        ((i - x) * (i - x) + (j - y) * (j - y)) / (spatial * spatial);
                    const double off = (values(i, j) - values(x, y)) / range;
                    const double w = std::exp(-0.5 * (far + off * off));
                    sum += w * values(i, j);
                    weights += w;
                }
            const double error = grid.at(x, y, values(x, y)) - sum / weights;
            squares += error * error;
        }
    EXPECT_LT(std::sqrt(squares / count), 0.01);
}

TEST(Durand, CompressesTheBaseAndKeepsTheDetail)
{
    // Two halves 10^4 apart, each with stripes of 10 %.
    Image<Rgb> scene(120, 80);
    for (int y = 0; y < scene.height(); ++y)
        for (int x = 0; x < scene.width(); ++x)
            scene(x, y) = Rgb((x < 60 ? 0.01f : 100.0f) * (y % 2 == 0 ? 1.0f : 1.1f));
    const Image<Rgb> display = mapWith(*makeDurand(), scene);
    const double base = display(90, 40).g / display(30, 40).g;
    EXPECT_NEAR(base, 50.0, 2.0);
    EXPECT_NEAR(display(30, 41).g / display(30, 40).g, 1.1, 0.005);
    EXPECT_EQ(display(90, 41).g, 1.0f) << "the base's brightest is white, its detail beyond";
    // Little contrast is not stretched.
    for (Rgb& pixel : scene.pixels())
        pixel = Rgb(std::pow(pixel.g / 0.01f, 0.1f));
    const Image<Rgb> mild = mapWith(*makeDurand(), scene);
    EXPECT_NEAR(mild(90, 40).g / mild(30, 40).g, std::pow(10.0, 0.4), 0.02);
}

std::vector<std::unique_ptr<ToneMapOperator>> allOperators()
{
    std::vector<std::unique_ptr<ToneMapOperator>> all;
    all.push_back(makeReinhardLocal({}));
    all.push_back(makeDurand());
    all.push_back(makeLibraryOperator(LibraryOperator::Drago));
    all.push_back(makeLibraryOperator(LibraryOperator::ReinhardDevlin));
    return all;
}

TEST(AllOperators, HardScenes)
{
    Image<Rgb> range(64, 48);
    for (int x = 0; x < 64; ++x)
        for (int y = 0; y < 48; ++y)
            range(x, y) = Rgb(std::pow(10.0f, 8.0f * static_cast<float>(x) / 63.0f - 4.0f));
    Image<Rgb> half_black = tone_scenes::room(64, 48);
    for (int y = 0; y < 24; ++y)
        for (int x = 0; x < 64; ++x)
            half_black(x, y) = Rgb(0.0f);
    const std::vector<Image<Rgb>> scenes = {Image<Rgb>(1, 1, Rgb(3.0f)),
                                            Image<Rgb>(1, 10000, Rgb(2.0f)),
                                            tone_scenes::noise(10000, 1, 4.0f),
                                            tone_scenes::noise(33, 17, 4.0f),
                                            Image<Rgb>(40, 30, Rgb(0.7f)),
                                            range,
                                            half_black};
    for (const auto& tone_map : allOperators()) {
        for (const Image<Rgb>& scene : scenes) {
            const Image<Rgb> display = mapWith(*tone_map, scene);
            float largest = 0.0f;
            for (std::size_t i = 0; i < scene.pixelCount(); ++i) {
                const Rgb shown = display.pixels()[i];
                for (int c = 0; c < 3; ++c) {
                    ASSERT_TRUE(shown[c] >= 0.0f && shown[c] <= 1.0f) << shown[c];
                    largest = std::max(largest, shown[c]);
                }
                if (scene.pixels()[i] == Rgb(0.0f)) {
                    ASSERT_EQ(shown, Rgb(0.0f)) << "black stays black";
                }
            }
            EXPECT_GT(largest, 0.05f) << scene.width() << "x" << scene.height();
        }
        const Image<Rgb> black = mapWith(*tone_map, Image<Rgb>(20, 10));
        EXPECT_TRUE(std::ranges::all_of(black.pixels(), [](Rgb p) { return p == Rgb(0.0f); }));
        EXPECT_TRUE(mapWith(*tone_map, Image<Rgb>()).empty());
        Image<Rgb> broken(8, 8, Rgb(1.0f));
        broken(3, 2).g = -1.0f;
        EXPECT_THAT(inputErrorOf([&] { (void)mapWith(*tone_map, broken); }),
                    testing::HasSubstr("(3, 2)"));
    }
}

TEST(AllOperators, SameFromAnyUnitAndNumberOfThreads)
{
    const Image<Rgb> scene = tone_scenes::room(160, 120);
    Image<Rgb> scaled = scene;
    for (Rgb& pixel : scaled.pixels())
        pixel *= 1024.0f;
    for (const auto& tone_map : allOperators()) {
        const Image<Rgb> display = mapWith(*tone_map, scene);
        setThreadCount(1);
        const Image<Rgb> alone = mapWith(*tone_map, scene);
        setThreadCount(0);
        EXPECT_TRUE(std::ranges::equal(display.pixels(), alone.pixels()));
        const Image<Rgb> other = mapWith(*tone_map, scaled);
        double squares = 0.0;
        for (std::size_t i = 0; i < scene.pixelCount(); ++i)
            squares += std::pow(display.pixels()[i].g - other.pixels()[i].g, 2.0f);
        EXPECT_LT(std::sqrt(squares / static_cast<double>(scene.pixelCount())), 1e-3);
    }
}

TEST(Durand, OptionsOutOfRangeAreNamedAllAtOnce)
{
    DurandOptions options;
    options.base_contrast = 1.0;
    options.spatial_sigma = 0.0;
    options.range_sigma = -1.0;
    EXPECT_EQ(options.validate().size(), 3u);
    EXPECT_THROW((void)makeDurand(options), InputError);
}

}  // namespace
}  // namespace insitu
