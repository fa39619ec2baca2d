#pragma once

#include "composite/tonemap/separable.h"

namespace insitu::tonemap {

/// Decides, tile by tile, where the local part counts. Private to this module.
class Importance {
public:
    virtual ~Importance() = default;

    /// How far around a tile it looks: pixels, a multiple of 4.
    [[nodiscard]] virtual int halo() const = 0;
    /// Whether most tiles will count wholly: then they are read once for both parts.
    [[nodiscard]] virtual bool expectsWholeTiles() const = 0;
    /// Weight of the local part, row-major `patch.width` wide with each row's even columns first,
    /// in [0, 1], for the tile at (x0, y0) of the picture; `weights`, empty before, stays so when
    /// they are all 0 or all 1. Returns the blocks with any weight above 0.
    virtual WantedBlocks weigh(const LuminancePatch& patch,
                               const ToneCurve& curve,
                               int x0,
                               int y0,
                               std::vector<float>& weights) const = 0;
};

/// All of a tile's blocks alike: 1 wanted, 0 not.
[[nodiscard]] WantedBlocks uniformBlocks(const LuminancePatch& patch, std::uint8_t wanted);

/// Maps a picture tile by tile. `local` null: the global curve alone. `importance` null: the local
/// part everywhere; else where it says (it must outlive this), blended by its weights with the
/// pixel's own luminance.
class TileMapping : public SceneMapping {
public:
    TileMapping(std::unique_ptr<ToneCurve> curve,
                std::unique_ptr<LocalAdaptation> local,
                const Importance* importance)
        : curve_(std::move(curve)), local_(std::move(local)), importance_(importance)
    {
    }
    [[nodiscard]] int reach() const override;
    void map(const SceneStrip& strip,
             int top,
             Image<Rgb>& display,
             Progress& progress) const override;
    [[nodiscard]] bool mapsBoxes() const override { return true; }
    void mapBox(const SceneStrip& whole, const PixelBox& box, Image<Rgb>& display) const override;

private:
    std::unique_ptr<ToneCurve> curve_;
    std::unique_ptr<LocalAdaptation> local_;
    const Importance* importance_;
};

}  // namespace insitu::tonemap
