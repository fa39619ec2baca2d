#include "composite/tonemap/frame_mapper.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace insitu {

namespace {

/// Relative difference of statistics that nobody sees.
constexpr double kUnseen = 0.002;
/// Boxes that are looked at for changes, and tiles in which changes are mapped together: pixels.
constexpr int kCell = PixelBox::kGrid;
constexpr int kTileCells = 8;

bool nearlySame(double a, double b)
{
    return a == b || std::abs(a - b) <= kUnseen * std::min(a, b);
}

double followed(double from, double to, double share)
{
    // Black has no logarithm.
    if (!(from > 0.0 && to > 0.0) || share >= 1.0) return to;
    return std::exp(std::log(from) + share * (std::log(to) - std::log(from)));
}

/// 1 for each cell with a pixel that differs, by rows of cells.
std::vector<std::uint8_t> changedCells(const Image<Rgb>& before, const Image<Rgb>& after)
{
    const int columns = (after.width() + kCell - 1) / kCell;
    const int rows = (after.height() + kCell - 1) / kCell;
    std::vector<std::uint8_t> changed(
        static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0);
    parallelFor(0, rows, [&](std::int64_t row) {
        const int top = static_cast<int>(row) * kCell;
        for (int y = top; y < std::min(top + kCell, after.height()); ++y)
            for (int column = 0; column < columns; ++column) {
                std::uint8_t& cell = changed[static_cast<std::size_t>(row * columns + column)];
                const int left = column * kCell;
                const auto count = static_cast<std::size_t>(std::min(kCell, after.width() - left));
                if (cell == 0 &&
                    std::memcmp(&before(left, y), &after(left, y), count * sizeof(Rgb)) != 0)
                    cell = 1;
            }
    });
    return changed;
}

/// Boxes that hold all cells within `reach` pixels of a changed one: one a tile.
std::vector<PixelBox> boxesToMap(const std::vector<std::uint8_t>& changed,
                                 int width,
                                 int height,
                                 int reach)
{
    const int columns = (width + kCell - 1) / kCell;
    const int rows = (height + kCell - 1) / kCell;
    const int around = (reach + kCell - 1) / kCell;
    std::vector<PixelBox> boxes;
    for (int tile_row = 0; tile_row < rows; tile_row += kTileCells)
        for (int tile_column = 0; tile_column < columns; tile_column += kTileCells) {
            const int end_row = std::min(tile_row + kTileCells, rows);
            const int end_column = std::min(tile_column + kTileCells, columns);
            int left = end_column;
            int right = tile_column;
            int top = end_row;
            int bottom = tile_row;
            for (int y = std::max(0, tile_row - around); y < std::min(rows, end_row + around); ++y)
                for (int x = std::max(0, tile_column - around);
                     x < std::min(columns, end_column + around);
                     ++x) {
                    if (changed[static_cast<std::size_t>(y * columns + x)] == 0) continue;
                    left = std::min(left, std::max(x - around, tile_column));
                    right = std::max(right, std::min(x + around + 1, end_column));
                    top = std::min(top, std::max(y - around, tile_row));
                    bottom = std::max(bottom, std::min(y + around + 1, end_row));
                }
            if (left >= right || top >= bottom) continue;
            boxes.push_back({left * kCell,
                             top * kCell,
                             std::min(right * kCell, width) - left * kCell,
                             std::min(bottom * kCell, height) - top * kCell});
        }
    return boxes;
}

bool sameStatistics(const SceneStatistics& a, const SceneStatistics& b)
{
    return a.smallest == b.smallest && a.largest == b.largest && a.mean == b.mean &&
           a.log_average == b.log_average;
}

}  // namespace

Findings AdaptationOptions::validate() const
{
    if (std::isfinite(time_constant_s) && time_constant_s >= 0.0) return {};
    return {
        {Severity::Error,
         "tonemap-adaptation",
         fmt::format("the time constant of adaptation is {} s; give 0 or more", time_constant_s)}};
}

AdaptationSmoother::AdaptationSmoother(const AdaptationOptions& options) : options_(options)
{
    requireValid(options.validate(), "tone mapping");
}

const SceneStatistics& AdaptationSmoother::next(const SceneStatistics& measured, double seconds)
{
    INSITU_CHECK(seconds >= 0.0, "{} s", seconds);
    if (!used_) {
        followed_ = measured;
        return used_.emplace(measured);
    }
    const double share =
        options_.time_constant_s > 0.0 ? 1.0 - std::exp(-seconds / options_.time_constant_s) : 1.0;
    bool seen = share >= 1.0;
    const auto follow = [&](double& value, double to, double used) {
        value = followed(value, to, share);
        seen = seen || !nearlySame(value, used);
    };
    follow(followed_.smallest, measured.smallest, used_->smallest);
    follow(followed_.largest, measured.largest, used_->largest);
    follow(followed_.mean, measured.mean, used_->mean);
    follow(followed_.log_average, measured.log_average, used_->log_average);
    followed_.pixels = measured.pixels;
    if (seen) used_ = followed_;
    return *used_;
}

FrameMapper::FrameMapper(std::shared_ptr<const ToneMapOperator> tone_map,
                         const AdaptationOptions& options)
    : tone_map_(std::move(tone_map)), smoother_(options)
{
    INSITU_CHECK(tone_map_ != nullptr, "no operator");
}

const Image<Rgb>& FrameMapper::map(const Image<Rgb>& scene, double seconds, Progress& progress)
{
    const SceneStatistics& statistics = smoother_.next(measureScene(scene), seconds);
    const bool same_look =
        mapping_ != nullptr && scene.sameSize(scene_) && sameStatistics(statistics, statistics_);
    if (!same_look || !mapping_->mapsBoxes()) {
        // What a cancelled frame leaves is not built upon.
        mapping_.reset();
        display_ = Image<Rgb>(scene.width(), scene.height());
        mapped_share_ = 1.0;
        if (!scene.empty()) {
            tone_map_->mapInto(display_, scene, statistics, progress);
            mapping_ = tone_map_->begin(scene.width(), scene.height(), statistics);
        }
    } else {
        std::vector<PixelBox> boxes = boxesToMap(
            changedCells(scene_, scene), scene.width(), scene.height(), mapping_->reach());
        const SceneStrip whole(scene);
        parallelFor(0, static_cast<std::int64_t>(boxes.size()), [&](std::int64_t i) {
            mapping_->mapBox(whole, boxes[static_cast<std::size_t>(i)], display_);
        });
        double mapped = 0.0;
        for (const PixelBox& box : boxes)
            mapped += static_cast<double>(box.width) * box.height;
        mapped_share_ = mapped / static_cast<double>(scene.pixelCount());
    }
    statistics_ = statistics;
    scene_ = scene;
    return display_;
}

}  // namespace insitu
