#pragma once

#include "composite/tonemap/separable.h"

namespace insitu::tonemap {

/// Importance by cells of 4x4 pixels for one tile and a margin around it. Private to this module.
struct Cells {
    static constexpr int kSize = 4;
    static constexpr int kSpread = 4;  ///< cells that importance reaches around it
    static constexpr int kBlend = 2;   ///< cells over which it then fades
    static constexpr int kMargin = kSpread + kBlend + 1;
    static constexpr int kHalo = kMargin * kSize + kSize;

    int columns = 0;  ///< of the tile, without margins
    int rows = 0;
    std::vector<float> values;

    Cells(int tile_columns, int tile_rows)
        : columns(tile_columns),
          rows(tile_rows),
          values(static_cast<std::size_t>(stride()) * static_cast<std::size_t>(rows + 2 * kMargin),
                 0.0f)
    {
    }
    [[nodiscard]] int stride() const { return columns + 2 * kMargin; }
    [[nodiscard]] float* row(int y)
    {
        return values.data() + static_cast<std::ptrdiff_t>(y + kMargin) * stride() + kMargin;
    }
    [[nodiscard]] const float* row(int y) const { return const_cast<Cells*>(this)->row(y); }
};

/// Sets to 1 each cell with a pixel whose Sobel gradient of the logarithm of luminance is above the
/// threshold. `patch.halo` >= Cells::kHalo.
void markEdges(const LuminancePatch& patch, float threshold, Cells& cells);

/// Spreads and fades importance, cell by cell; afterwards a margin of 1 cell holds.
void spreadCells(Cells& cells);

/// Weight of each pixel, linear between the centres of cells, even columns first; and the blocks
/// that any weight above 0 lies in.
WantedBlocks weighPixels(const Cells& cells, int width, int height, float* weights);

}  // namespace insitu::tonemap
