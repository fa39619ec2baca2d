#pragma once

#include "composite/tonemap/operator.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace insitu {

/// A part of a picture's luminance with what surrounds it, for one tile of the picture.
///
/// Rows of `stride` floats from `height + 2 halo` rows; the picture's border pixels go on outside
/// it. Columns are sorted by parity, for vector loops that go in steps of two pixels: first the
/// even columns (x = -halo, -halo + 2, …), `half()` later the odd ones. Width, height and halo are
/// multiples of 4; tiles at the right and lower border are filled up so.
struct LuminancePatch {
    int width = 0;  ///< of the tile, without the halo
    int height = 0;
    int halo = 0;
    std::unique_ptr<float[]> values;

    [[nodiscard]] std::ptrdiff_t half() const { return (width + 2 * halo) / 2; }
    [[nodiscard]] std::ptrdiff_t stride() const { return 2 * half(); }
    /// Even columns of a row in [-halo, height + halo), from x = 0.
    [[nodiscard]] const float* even(int y) const
    {
        return values.get() + (y + halo) * stride() + halo / 2;
    }
    [[nodiscard]] const float* odd(int y) const { return even(y) + half(); }
};

/// Which blocks of a tile the local part is wanted for.
struct WantedBlocks {
    /// Pixels; block columns start at multiples of kWidth, block rows at multiples of kHeight.
    static constexpr int kWidth = 64;
    static constexpr int kHeight = 16;

    int columns = 0;
    std::vector<std::uint8_t> wanted;  ///< by rows of blocks; 1 = wanted

    [[nodiscard]] bool any() const;
};

/// The local part of a separable operator: to which luminance the eye adapts at each pixel.
class LocalAdaptation {
public:
    virtual ~LocalAdaptation() = default;

    /// How far around a pixel it looks: pixels, a multiple of 4.
    [[nodiscard]] virtual int halo() const = 0;
    /// Adaptation luminance of the wanted blocks' pixels, row-major `patch.width` wide, each row's
    /// even columns first. Other pixels keep what `adapted` holds. Independent of how the picture
    /// is cut into tiles, as long as they start at multiples of 4.
    virtual void adapt(const LuminancePatch& patch,
                       const WantedBlocks& blocks,
                       float* adapted) const = 0;
};

/// The global part: luminance and adaptation luminance to display luminance, pixel by pixel.
class ToneCurve {
public:
    virtual ~ToneCurve() = default;

    /// What luminances are multiplied by before both parts see them.
    [[nodiscard]] virtual float scale() const = 0;
    /// display[i] in [0, 1] from luminance[i] >= 0 and adapted[i] >= 0, both scaled; `count` of
    /// them. The arrays do not overlap.
    virtual void apply(const float* luminance,
                       const float* adapted,
                       float* display,
                       std::ptrdiff_t count) const = 0;
};

/// An operator that is a global curve after local adaptation. Where the local part is left out a
/// pixel adapts to its own luminance, which is the operator's global version.
/// Source: [Michael10] 4.3, equation 16, and 4.4.
class SeparableOperator : public ToneMapOperator {
public:
    [[nodiscard]] std::unique_ptr<SceneMapping> begin(
        int width, int height, const SceneStatistics& statistics) const override;

    [[nodiscard]] virtual std::unique_ptr<ToneCurve> curve(
        const SceneStatistics& statistics) const = 0;
    /// Null: the operator is global.
    [[nodiscard]] virtual std::unique_ptr<LocalAdaptation> local() const = 0;
};

}  // namespace insitu
