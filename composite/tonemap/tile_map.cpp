#include "composite/tonemap/tile_map.h"

#include "composite/tonemap/patch_reader.h"
#include "core/parallel.h"

#include <algorithm>

namespace insitu::tonemap {

WantedBlocks uniformBlocks(const LuminancePatch& patch, std::uint8_t wanted)
{
    const auto parts = [](int pixels, int size) { return (pixels + size - 1) / size; };
    WantedBlocks blocks;
    blocks.columns = parts(patch.width, WantedBlocks::kWidth);
    blocks.wanted.assign(static_cast<std::size_t>(blocks.columns) *
                             static_cast<std::size_t>(parts(patch.height, WantedBlocks::kHeight)),
                         wanted);
    return blocks;
}

namespace {

/// The rectangle of blocks that holds all wanted ones.
struct BlockBox {
    int left, top, right, bottom;  ///< the last two are outside
};

BlockBox boxOf(const WantedBlocks& blocks)
{
    const int rows = static_cast<int>(blocks.wanted.size()) / blocks.columns;
    BlockBox box{blocks.columns, rows, 0, 0};
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < blocks.columns; ++x) {
            if (blocks.wanted[static_cast<std::size_t>(y * blocks.columns + x)] == 0) continue;
            box = {std::min(box.left, x),
                   std::min(box.top, y),
                   std::max(box.right, x + 1),
                   std::max(box.bottom, y + 1)};
        }
    return box;
}

WantedBlocks cutBlocks(const WantedBlocks& blocks, const BlockBox& box)
{
    WantedBlocks part;
    part.columns = box.right - box.left;
    for (int y = box.top; y < box.bottom; ++y)
        for (int x = box.left; x < box.right; ++x)
            part.wanted.push_back(blocks.wanted[static_cast<std::size_t>(y * blocks.columns + x)]);
    return part;
}

/// What a tile's pixels adapt to, rows with even columns first; not initialised when made.
using Luminances = std::unique_ptr<float[]>;

/// A tile of the picture, and what it is mapped with.
struct Tile {
    const SceneStrip& scene;
    const ToneCurve& curve;
    PixelBox box;
};

/// Blends the local part in, where it is wanted; only there the picture is read as far around as
/// the local part looks.
void blendLocal(const Tile& tile,
                const LuminancePatch& patch,
                const LocalAdaptation& local,
                const WantedBlocks& blocks,
                const std::vector<float>& weights,
                float* adapted)
{
    const BlockBox box = boxOf(blocks);
    const int left = box.left * WantedBlocks::kWidth;
    const int top = box.top * WantedBlocks::kHeight;
    const LuminancePatch part =
        readPatch(tile.scene,
                  tile.box.left + left,
                  tile.box.top + top,
                  std::min(box.right * WantedBlocks::kWidth, patch.width) - left,
                  std::min(box.bottom * WantedBlocks::kHeight, patch.height) - top,
                  local.halo(),
                  tile.curve.scale());
    const std::ptrdiff_t part_half = part.width / 2;
    const std::ptrdiff_t half = patch.width / 2;
    // What is not wanted has no weight: any finite value will do.
    std::vector<float> locally(static_cast<std::size_t>(part.width) *
                               static_cast<std::size_t>(part.height));
    local.adapt(part, cutBlocks(blocks, box), locally.data());
    const auto blend = [&](std::ptrdiff_t to, std::ptrdiff_t from) {
        const float* const weight = weights.data() + to;
        const float* const value = locally.data() + from;
        float* const out = adapted + to;
        for (std::ptrdiff_t i = 0; i < part_half; ++i)
            out[i] = (1.0f - weight[i]) * out[i] + weight[i] * value[i];
    };
    for (int y = 0; y < part.height; ++y) {
        const std::ptrdiff_t to = (top + y) * 2 * half + left / 2;
        const std::ptrdiff_t from = y * 2 * part_half;
        blend(to, from);
        blend(to + half, from + part_half);
    }
}

/// The same from the patch itself, which holds all that the local part looks at.
void blendWhole(const LuminancePatch& patch,
                const LocalAdaptation& local,
                const WantedBlocks& blocks,
                const std::vector<float>& weights,
                float* adapted)
{
    const std::ptrdiff_t half = patch.width / 2;
    local.adapt(patch, blocks, adapted);
    if (weights.empty()) return;
    const auto blend = [&](std::ptrdiff_t at, const float* own) {
        const float* const weight = weights.data() + at;
        float* const out = adapted + at;
        for (std::ptrdiff_t i = 0; i < half; ++i)
            out[i] = (1.0f - weight[i]) * own[i] + weight[i] * out[i];
    };
    for (int y = 0; y < patch.height; ++y) {
        blend(y * 2 * half, patch.even(y));
        blend(y * 2 * half + half, patch.odd(y));
    }
}

/// What a tile's pixels adapt to by importance; null: each to itself.
Luminances adaptSelected(const Tile& tile,
                         const LuminancePatch& patch,
                         const LocalAdaptation& local,
                         const Importance& importance)
{
    const std::size_t pixels =
        static_cast<std::size_t>(patch.width) * static_cast<std::size_t>(patch.height);
    std::vector<float> weights;
    const WantedBlocks blocks =
        importance.weigh(patch, tile.curve, tile.box.left, tile.box.top, weights);
    if (!blocks.any()) return nullptr;
    Luminances adapted(new float[pixels]);
    if (patch.halo >= local.halo() &&
        std::ranges::count(blocks.wanted, std::uint8_t{1}) == std::ssize(blocks.wanted)) {
        blendWhole(patch, local, blocks, weights, adapted.get());
        return adapted;
    }
    weights.resize(pixels, 1.0f);
    const auto half = static_cast<std::size_t>(patch.width / 2);
    for (int y = 0; y < patch.height; ++y) {
        float* const row = adapted.get() + 2 * half * static_cast<std::size_t>(y);
        std::copy_n(patch.even(y), half, row);
        std::copy_n(patch.odd(y), half, row + half);
    }
    blendLocal(tile, patch, local, blocks, weights, adapted.get());
    return adapted;
}

/// Curve and colours of a tile; `adapted` null: each pixel adapts to itself.
void writeTile(const Tile& tile,
               const LuminancePatch& patch,
               const Luminances& adapted,
               int top,
               Image<Rgb>& display)
{
    const auto half = static_cast<std::size_t>(patch.width / 2);
    std::vector<float> luminances(2 * half);
    std::vector<float> mapped(2 * half);
    std::vector<float> line;
    for (int y = 0; y < tile.box.height; ++y) {
        std::copy_n(patch.even(y), half, luminances.data());
        std::copy_n(patch.odd(y), half, luminances.data() + half);
        const float* const adaptation =
            adapted == nullptr ? luminances.data()
                               : adapted.get() + 2 * half * static_cast<std::size_t>(y);
        tile.curve.apply(luminances.data(), adaptation, mapped.data(), patch.width);
        const RowResult result{luminances.data(),
                               mapped.data(),
                               tile.curve.scale(),
                               static_cast<std::ptrdiff_t>(half)};
        writeRow(tile.scene.row(tile.box.top + y).data() + tile.box.left,
                 result,
                 tile.box.width,
                 line,
                 display.row(tile.box.top + y - top).data() + tile.box.left);
    }
}

void mapTile(const Tile& tile,
             const LocalAdaptation* local,
             const Importance* importance,
             int top,
             Image<Rgb>& display)
{
    int halo = importance != nullptr ? importance->halo() : 0;
    if (local != nullptr && (importance == nullptr || importance->expectsWholeTiles()))
        halo = std::max(halo, local->halo());
    const LuminancePatch patch = readPatch(tile.scene,
                                           tile.box.left,
                                           tile.box.top,
                                           tile.box.width,
                                           tile.box.height,
                                           halo,
                                           tile.curve.scale());
    Luminances adapted;
    if (local != nullptr && importance != nullptr) {
        adapted = adaptSelected(tile, patch, *local, *importance);
    } else if (local != nullptr) {
        adapted.reset(new float[static_cast<std::size_t>(patch.width) *
                                static_cast<std::size_t>(patch.height)]);
        local->adapt(patch, uniformBlocks(patch, 1), adapted.get());
    }
    writeTile(tile, patch, adapted, top, display);
}

}  // namespace

int TileMapping::reach() const
{
    // Patches are filled up to multiples of 4.
    constexpr int kFill = 3;
    return std::max(importance_ != nullptr ? importance_->halo() : 0,
                    local_ != nullptr ? local_->halo() : 0) +
           kFill;
}

void TileMapping::map(const SceneStrip& strip,
                      int top,
                      Image<Rgb>& display,
                      Progress& progress) const
{
    static_assert(kStripRows % kTileHeight == 0);
    INSITU_CHECK(top % kTileHeight == 0, "row {}", top);
    const int columns = (strip.width() + kTileWidth - 1) / kTileWidth;
    const int rows = (display.height() + kTileHeight - 1) / kTileHeight;
    parallelFor(0, static_cast<std::int64_t>(columns) * rows, [&](std::int64_t tile) {
        if (progress.cancelled()) return;
        const int left = static_cast<int>(tile % columns) * kTileWidth;
        const int row = top + static_cast<int>(tile / columns) * kTileHeight;
        const Tile part{strip,
                        *curve_,
                        {left,
                         row,
                         std::min(kTileWidth, strip.width() - left),
                         std::min(kTileHeight, top + display.height() - row)}};
        mapTile(part, local_.get(), importance_, top, display);
    });
}

void TileMapping::mapBox(const SceneStrip& whole, const PixelBox& box, Image<Rgb>& display) const
{
    mapTile({whole, *curve_, box}, local_.get(), importance_, 0, display);
}

}  // namespace insitu::tonemap
