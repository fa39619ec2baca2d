#pragma once

#include "core/mesh.h"

namespace insitu {

/// False where a triangle's surface is cut out: alpha below the cutoff of a material with
/// alpha_mask. `barycentric`: weights of the second and third corner.
[[nodiscard]] bool isThere(const Model& model, std::uint32_t triangle, glm::vec2 barycentric);

/// Does any material cut holes?
[[nodiscard]] bool hasCutOuts(const Model& model);

/// Positions and triangles of what is left of a model when holes are cut out of it: for all that
/// knows geometry alone. Other members are empty.
///
/// A triangle with holes is divided evenly until its parts are no longer than `largest_edge` (in
/// the model's unit, > 0) or than its texture's texels, and parts are kept or left out by the alpha
/// at their middle. The edges of holes are off by half a part at most. A model never becomes more
/// than four million parts: parts grow instead.
[[nodiscard]] TriangleMesh withoutCutOuts(const Model& model, double largest_edge);

}  // namespace insitu
