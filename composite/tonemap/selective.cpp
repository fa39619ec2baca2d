#include "composite/tonemap/selective.h"

#include "composite/tonemap/importance_cells.h"
#include "composite/tonemap/patch_reader.h"
#include "composite/tonemap/tile_map.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

using tonemap::Cells;

/// Largest value of a map in each cell; empty for an empty map.
Image<float> cellPeaks(const Image<float>& map)
{
    const auto cellsOf = [](int pixels) { return (pixels + Cells::kSize - 1) / Cells::kSize; };
    Image<float> peaks(cellsOf(map.width()), cellsOf(map.height()), 0.0f);
    parallelFor(0, peaks.height(), [&](std::int64_t row) {
        const auto line = peaks.row(static_cast<int>(row));
        const int top = static_cast<int>(row) * Cells::kSize;
        for (int y = top; y < std::min(top + Cells::kSize, map.height()); ++y) {
            const auto values = map.row(y);
            for (std::size_t x = 0; x < values.size(); ++x)
                line[x / Cells::kSize] = std::max(line[x / Cells::kSize], values[x]);
        }
    });
    return peaks;
}

/// Marks a tile's cells whose peak is above the threshold, with 1 or, where asked, with the peak.
void markPeaks(
    const Image<float>& peaks, float threshold, bool weighted, int x0, int y0, Cells& cells)
{
    for (int row = -Cells::kMargin; row < cells.rows + Cells::kMargin; ++row) {
        const auto line = peaks.row(std::clamp(y0 / Cells::kSize + row, 0, peaks.height() - 1));
        float* const cell = cells.row(row);
        for (int column = -Cells::kMargin; column < cells.columns + Cells::kMargin; ++column) {
            const float peak = line[static_cast<std::size_t>(
                std::clamp(x0 / Cells::kSize + column, 0, peaks.width() - 1))];
            if (peak > threshold) cell[column] = std::max(cell[column], weighted ? peak : 1.0f);
        }
    }
}

class SelectedPixels : public tonemap::Importance {
public:
    explicit SelectedPixels(const SelectiveOptions& options)
        : threshold_(static_cast<float>(options.importance_threshold)),
          importance_(cellPeaks(options.importance)),
          always_(cellPeaks(options.always))
    {
    }

    [[nodiscard]] int halo() const override { return Cells::kHalo; }

    [[nodiscard]] bool expectsWholeTiles() const override { return importance_.empty(); }

    WantedBlocks weigh(const LuminancePatch& patch,
                       const ToneCurve& /*curve*/,
                       int x0,
                       int y0,
                       std::vector<float>& weights) const override
    {
        Cells cells(patch.width / Cells::kSize, patch.height / Cells::kSize);
        if (importance_.empty())
            tonemap::markEdges(patch, threshold_, cells);
        else
            markPeaks(importance_, threshold_, false, x0, y0, cells);
        if (!always_.empty()) markPeaks(always_, 0.0f, true, x0, y0, cells);
        // Plain tiles, important or not, need neither spreading nor blending.
        const auto all = [&cells](float value) {
            return std::all_of(cells.values.begin(), cells.values.end(), [&](float cell) {
                return cell == value;
            });
        };
        if (all(0.0f)) return tonemap::uniformBlocks(patch, 0);
        if (all(1.0f)) return tonemap::uniformBlocks(patch, 1);
        tonemap::spreadCells(cells);
        weights.resize(static_cast<std::size_t>(patch.width) *
                       static_cast<std::size_t>(patch.height));
        return tonemap::weighPixels(cells, patch.width, patch.height, weights.data());
    }

private:
    float threshold_;
    Image<float> importance_;  ///< peaks by cells
    Image<float> always_;
};

void requireSize(const Image<float>& map, int width, int height, const char* name)
{
    if (map.empty() || (map.width() == width && map.height() == height)) return;
    throw InputError("tone mapping",
                     fmt::format("the {} is {}x{}, the picture {}x{}; sizes must be the same",
                                 name,
                                 map.width(),
                                 map.height(),
                                 width,
                                 height));
}

class Selective : public ToneMapOperator {
public:
    Selective(std::shared_ptr<const SeparableOperator> tone_map, SelectiveOptions options)
        : tone_map_(std::move(tone_map)), options_(std::move(options)), selected_(options_)
    {
    }

    [[nodiscard]] std::unique_ptr<SceneMapping> begin(
        int width, int height, const SceneStatistics& statistics) const override
    {
        requireSize(options_.always, width, height, "map of what always counts");
        requireSize(options_.importance, width, height, "importance map");
        auto local = tone_map_->local();
        const bool anywhere = local != nullptr;
        return std::make_unique<tonemap::TileMapping>(
            tone_map_->curve(statistics), std::move(local), anywhere ? &selected_ : nullptr);
    }

private:
    std::shared_ptr<const SeparableOperator> tone_map_;
    SelectiveOptions options_;
    SelectedPixels selected_;  ///< maps are gathered once, for all frames
};

}  // namespace

Findings SelectiveOptions::validate() const
{
    Findings findings;
    if (!std::isfinite(importance_threshold) || importance_threshold <= 0.0)
        findings.push_back({Severity::Error,
                            "tonemap-importance-threshold",
                            fmt::format("the importance threshold is {}; give a number above 0",
                                        importance_threshold)});
    for (const Image<float>* map : {&always, &importance})
        for (const float value : map->pixels())
            if (!(value >= 0.0f && value <= 1.0f)) {
                findings.push_back({Severity::Error,
                                    "tonemap-importance-map",
                                    fmt::format("an importance of {} is outside 0 to 1", value)});
                break;
            }
    return findings;
}

std::unique_ptr<ToneMapOperator> makeSelective(std::shared_ptr<const SeparableOperator> tone_map,
                                               SelectiveOptions options)
{
    INSITU_CHECK(tone_map != nullptr, "no operator");
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<Selective>(std::move(tone_map), std::move(options));
}

double selectedShare(const SeparableOperator& tone_map,
                     const SelectiveOptions& options,
                     const Image<Rgb>& scene)
{
    if (scene.empty()) return 0.0;
    const auto curve = tone_map.curve(measureScene(scene));
    const SelectedPixels selected(options);
    std::size_t wanted = 0;
    std::size_t blocks = 0;
    for (int y = 0; y < scene.height(); y += tonemap::kTileHeight)
        for (int x = 0; x < scene.width(); x += tonemap::kTileWidth) {
            const LuminancePatch patch = tonemap::readPatch(SceneStrip(scene),
                                                            x,
                                                            y,
                                                            tonemap::kTileWidth,
                                                            tonemap::kTileHeight,
                                                            selected.halo(),
                                                            curve->scale());
            std::vector<float> weights;
            const WantedBlocks found = selected.weigh(patch, *curve, x, y, weights);
            wanted += static_cast<std::size_t>(
                std::count(found.wanted.begin(), found.wanted.end(), std::uint8_t{1}));
            blocks += found.wanted.size();
        }
    return static_cast<double>(wanted) / static_cast<double>(blocks);
}

}  // namespace insitu
