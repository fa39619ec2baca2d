#include "composite/tonemap/tile_map.h"

#include "composite/tonemap/patch_reader.h"
#include "core/parallel.h"

#include <algorithm>

namespace insitu::tonemap {

namespace {

WantedBlocks allBlocks(const LuminancePatch& patch)
{
    const auto parts = [](int pixels, int size) { return (pixels + size - 1) / size; };
    WantedBlocks blocks;
    blocks.columns = parts(patch.width, WantedBlocks::kWidth);
    blocks.wanted.assign(static_cast<std::size_t>(blocks.columns) *
                             static_cast<std::size_t>(parts(patch.height, WantedBlocks::kHeight)),
                         1);
    return blocks;
}

/// What a tile's pixels adapt to, rows with even columns first.
std::vector<float> adaptTile(const LuminancePatch& patch,
                             const ToneCurve& curve,
                             const LocalAdaptation& local,
                             const Importance* importance,
                             int x0,
                             int y0)
{
    const std::size_t pixels =
        static_cast<std::size_t>(patch.width) * static_cast<std::size_t>(patch.height);
    std::vector<float> adapted(pixels);
    if (importance == nullptr) {
        local.adapt(patch, allBlocks(patch), adapted.data());
        return adapted;
    }
    const auto half = static_cast<std::size_t>(patch.width / 2);
    for (int y = 0; y < patch.height; ++y) {
        float* const row = adapted.data() + 2 * half * static_cast<std::size_t>(y);
        std::copy_n(patch.even(y), half, row);
        std::copy_n(patch.odd(y), half, row + half);
    }
    std::vector<float> weights(pixels, 0.0f);
    const WantedBlocks blocks = importance->weigh(patch, curve, x0, y0, weights.data());
    if (!blocks.any()) return adapted;
    std::vector<float> locally = adapted;
    local.adapt(patch, blocks, locally.data());
    for (std::size_t i = 0; i < pixels; ++i)
        adapted[i] = (1.0f - weights[i]) * adapted[i] + weights[i] * locally[i];
    return adapted;
}

void mapTile(const Image<Rgb>& scene,
             const ToneCurve& curve,
             const LocalAdaptation* local,
             const Importance* importance,
             int x0,
             int y0,
             Image<Rgb>& display)
{
    const int halo = std::max(local != nullptr ? local->halo() : 0,
                              importance != nullptr ? importance->halo() : 0);
    const LuminancePatch patch =
        readPatch(scene, x0, y0, kTileWidth, kTileHeight, halo, curve.scale());
    const auto half = static_cast<std::size_t>(patch.width / 2);
    std::vector<float> adapted;
    if (local != nullptr) adapted = adaptTile(patch, curve, *local, importance, x0, y0);
    std::vector<float> luminances(2 * half);
    std::vector<float> mapped(2 * half);
    std::vector<float> line;
    const int width = std::min(kTileWidth, scene.width() - x0);
    const int height = std::min(kTileHeight, scene.height() - y0);
    for (int y = 0; y < height; ++y) {
        std::copy_n(patch.even(y), half, luminances.data());
        std::copy_n(patch.odd(y), half, luminances.data() + half);
        const float* const adaptation =
            local != nullptr ? adapted.data() + 2 * half * static_cast<std::size_t>(y)
                             : luminances.data();
        curve.apply(luminances.data(), adaptation, mapped.data(), patch.width);
        const RowResult result{
            luminances.data(), mapped.data(), curve.scale(), static_cast<std::ptrdiff_t>(half)};
        writeRow(
            scene.row(y0 + y).data() + x0, result, width, line, display.row(y0 + y).data() + x0);
    }
}

}  // namespace

void mapTiles(const Image<Rgb>& scene,
              const ToneCurve& curve,
              const LocalAdaptation* local,
              const Importance* importance,
              Image<Rgb>& display,
              Progress& progress)
{
    INSITU_CHECK(display.sameSize(scene), "{}x{}", display.width(), display.height());
    if (scene.empty()) return;
    progress.checkpoint();
    const int columns = (scene.width() + kTileWidth - 1) / kTileWidth;
    const int rows = (scene.height() + kTileHeight - 1) / kTileHeight;
    parallelFor(0, static_cast<std::int64_t>(columns) * rows, [&](std::int64_t tile) {
        if (progress.cancelled()) return;
        mapTile(scene,
                curve,
                local,
                importance,
                static_cast<int>(tile % columns) * kTileWidth,
                static_cast<int>(tile / columns) * kTileHeight,
                display);
    });
    progress.checkpoint();
    progress.report("tone mapping", 1.0);
}

}  // namespace insitu::tonemap
