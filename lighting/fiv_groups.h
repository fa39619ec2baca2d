#pragma once

#include "lighting/cell_light.h"
#include "lighting/fiv_kernel.h"
#include "lighting/hidden_light.h"

#include <glm/glm.hpp>

#include <span>

namespace insitu::fiv {

/// Lists the light of directions the way the kernel wants it. `against` may be empty; `normal`
/// matters for Sum::Irradiance only.
[[nodiscard]] Source sourceOf(const SilhouetteSet* set,
                              std::span<const IrradianceVector> along,
                              std::span<const IrradianceVector> against,
                              Sum sum,
                              glm::vec3 normal);

/// The same for four lights at once, Sum::Corners.
[[nodiscard]] Source sourceOfCorners(const SilhouetteSet& set, const CornerIrradiance& light);

/// Fills a block with the places (and normals, if any) from `begin` on, and the ball around it;
/// sums become 0. Places that are not finite are a LogicError.
void fillBlock(Group& group,
               std::size_t index,
               std::span<const glm::vec3> places,
               std::span<const glm::vec3> normals,
               std::size_t begin);

/// What a block's sums are, by Sum.
[[nodiscard]] inline Rgb irradianceOf(const Block& block, std::size_t i, std::size_t first = 0)
{
    const auto sum = [&](std::size_t k) { return block.sums[k][i] + block.uniform[k]; };
    return {sum(first), sum(first + 1), sum(first + 2)};
}
[[nodiscard]] inline IrradianceVector vectorOf(const Block& block, std::size_t i)
{
    IrradianceVector v;
    for (int c = 0; c < 3; ++c)
        for (int axis = 0; axis < 3; ++axis)
            v.channels[static_cast<std::size_t>(c)][axis] =
                block.sums[3 * c + axis][i] + block.uniform[3 * c + axis];
    return v;
}

}  // namespace insitu::fiv
