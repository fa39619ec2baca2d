#include "composite/tonemap/selective.h"

#include "composite/tonemap/importance_cells.h"
#include "composite/tonemap/patch_reader.h"
#include "composite/tonemap/tile_map.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

using tonemap::Cells;

/// Marks cells with a pixel of the map above the threshold, weighted by the map where asked.
void markFromMap(
    const Image<float>& map, float threshold, bool weighted, int x0, int y0, Cells& cells)
{
    const auto lastCell = [](int pixels) { return (pixels + Cells::kSize - 1) / Cells::kSize; };
    const int cell_x0 = x0 / Cells::kSize;
    const int cell_y0 = y0 / Cells::kSize;
    for (int row = -Cells::kMargin; row < cells.rows + Cells::kMargin; ++row)
        for (int column = -Cells::kMargin; column < cells.columns + Cells::kMargin; ++column) {
            const int cx = std::clamp(cell_x0 + column, 0, lastCell(map.width()) - 1);
            const int cy = std::clamp(cell_y0 + row, 0, lastCell(map.height()) - 1);
            float largest = 0.0f;
            for (int y = cy * Cells::kSize; y < std::min((cy + 1) * Cells::kSize, map.height());
                 ++y)
                for (int x = cx * Cells::kSize; x < std::min((cx + 1) * Cells::kSize, map.width());
                     ++x)
                    largest = std::max(largest, map(x, y));
            float& cell = cells.row(row)[column];
            if (largest > threshold) cell = std::max(cell, weighted ? largest : 1.0f);
        }
}

class SelectedPixels : public tonemap::Importance {
public:
    explicit SelectedPixels(const SelectiveOptions& options) : options_(options) {}

    [[nodiscard]] int halo() const override { return Cells::kHalo; }

    WantedBlocks weigh(const LuminancePatch& patch,
                       const ToneCurve& /*curve*/,
                       int x0,
                       int y0,
                       float* weights) const override
    {
        Cells cells(patch.width / Cells::kSize, patch.height / Cells::kSize);
        const auto threshold = static_cast<float>(options_.importance_threshold);
        if (options_.importance.empty())
            tonemap::markEdges(patch, threshold, cells);
        else
            markFromMap(options_.importance, threshold, false, x0, y0, cells);
        if (!options_.always.empty()) markFromMap(options_.always, 0.0f, true, x0, y0, cells);
        tonemap::spreadCells(cells);
        return tonemap::weighPixels(cells, patch.width, patch.height, weights);
    }

private:
    const SelectiveOptions& options_;
};

void requireSize(const Image<float>& map, const Image<Rgb>& scene, const char* name)
{
    if (map.empty() || map.sameSize(scene)) return;
    throw InputError("tone mapping",
                     fmt::format("the {} is {}x{}, the picture {}x{}; sizes must be the same",
                                 name,
                                 map.width(),
                                 map.height(),
                                 scene.width(),
                                 scene.height()));
}

class Selective : public ToneMapOperator {
public:
    Selective(std::shared_ptr<const SeparableOperator> tone_map, SelectiveOptions options)
        : tone_map_(std::move(tone_map)), options_(std::move(options))
    {
    }

    void mapInto(Image<Rgb>& display,
                 const Image<Rgb>& scene,
                 const SceneStatistics& statistics,
                 Progress& progress) const override
    {
        requireSize(options_.always, scene, "map of what always counts");
        requireSize(options_.importance, scene, "importance map");
        const auto curve = tone_map_->curve(statistics);
        const auto local = tone_map_->local();
        const SelectedPixels selected(options_);
        tonemap::mapTiles(
            scene, *curve, local.get(), local ? &selected : nullptr, display, progress);
    }

private:
    std::shared_ptr<const SeparableOperator> tone_map_;
    SelectiveOptions options_;
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
            const LuminancePatch patch = tonemap::readPatch(scene,
                                                            x,
                                                            y,
                                                            tonemap::kTileWidth,
                                                            tonemap::kTileHeight,
                                                            selected.halo(),
                                                            curve->scale());
            std::vector<float> weights(static_cast<std::size_t>(patch.width) *
                                       static_cast<std::size_t>(patch.height));
            const WantedBlocks found = selected.weigh(patch, *curve, x, y, weights.data());
            wanted += static_cast<std::size_t>(
                std::count(found.wanted.begin(), found.wanted.end(), std::uint8_t{1}));
            blocks += found.wanted.size();
        }
    return static_cast<double>(wanted) / static_cast<double>(blocks);
}

}  // namespace insitu
