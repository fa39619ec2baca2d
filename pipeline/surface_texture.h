#pragma once

#include "core/mesh.h"
#include "pipeline/simulated_room.h"

#include <cstdint>

namespace insitu {

/// The picture of a whole rectangle of width x height metres that is covered by floor boards:
/// staggered, each with its own brightness, grain along it and dark joints. Deterministic.
///
/// Texture coordinate (0,0)..(1,1) is the rectangle; boards run along v unless boards_along_x.
[[nodiscard]] Texture boardsTexture(const SimulatedSurface& surface,
                                    double width_m,
                                    double height_m,
                                    std::uint64_t seed);

/// Two by two fields of a checker, to be repeated every 2·size_m.
[[nodiscard]] Texture checkerTexture(const SimulatedSurface& surface);

/// An image file (sRGB) as a repeated texture, multiplied by the surface's colour. InputError as
/// readPhoto.
[[nodiscard]] Texture pictureTexture(const SimulatedSurface& surface);

}  // namespace insitu
