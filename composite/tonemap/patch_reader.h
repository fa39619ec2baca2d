#pragma once

#include "composite/tonemap/separable.h"
#include "core/instruction_set.h"

namespace insitu::tonemap {

/// Tiles that a picture is cut into: large, since what surrounds a tile is filtered with it.
constexpr int kTileWidth = 512;
constexpr int kTileHeight = 512;

/// The part of the picture that starts at (x0, y0), multiples of 4, luminance times `scale`.
/// The tile is width x height or what is left of the picture, filled up to multiples of 4.
[[nodiscard]] LuminancePatch readPatch(
    const SceneStrip& scene, int x0, int y0, int width, int height, int halo, float scale);

/// What the curve made of a row of a patch, even columns first.
struct RowResult {
    const float* luminance;  ///< scaled
    const float* display;
    float scale;  ///< of the luminances
    std::ptrdiff_t half;
};

/// Each colour times display / unscaled luminance, at most 1; `count` pixels, at most 2 half.
/// `line` is scratch.
void writeRow(
    const Rgb* scene, const RowResult& result, int count, std::vector<float>& line, Rgb* out);

}  // namespace insitu::tonemap
