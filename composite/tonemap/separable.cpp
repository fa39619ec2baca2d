#include "composite/tonemap/separable.h"

#include "composite/tonemap/tile_map.h"

#include <algorithm>

namespace insitu {

bool WantedBlocks::any() const
{
    return std::find(wanted.begin(), wanted.end(), std::uint8_t{1}) != wanted.end();
}

std::unique_ptr<SceneMapping> SeparableOperator::begin(int /*width*/,
                                                       int /*height*/,
                                                       const SceneStatistics& statistics) const
{
    return std::make_unique<tonemap::TileMapping>(curve(statistics), local(), nullptr);
}

}  // namespace insitu
