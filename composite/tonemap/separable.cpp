#include "composite/tonemap/separable.h"

#include "composite/tonemap/tile_map.h"

#include <algorithm>

namespace insitu {

bool WantedBlocks::any() const
{
    return std::find(wanted.begin(), wanted.end(), std::uint8_t{1}) != wanted.end();
}

void SeparableOperator::mapInto(Image<Rgb>& display,
                                const Image<Rgb>& scene,
                                const SceneStatistics& statistics,
                                Progress& progress) const
{
    const auto tone_curve = curve(statistics);
    const auto adaptation = local();
    tonemap::mapTiles(scene, *tone_curve, adaptation.get(), nullptr, display, progress);
}

}  // namespace insitu
