#pragma once

#include "core/mesh.h"

#include <filesystem>

namespace insitu {

/// Reads an OBJ with its MTL libraries and textures; the result is not validated yet.
///
/// Own reader, since assimp 5.2 joins vertices of equal coordinates before it smooths and forgets
/// `s`, so that neither smoothing groups nor Blender's rule (by vertex index) can be had from it.
/// Faces with `vn` keep them. Others are smoothed by angle within their smoothing group
/// (cornerNormals), or flat when they have none. Texture v is flipped to count from the top.
/// Findings: model-material-missing, model-texture-missing, model-texture-unreadable,
/// model-map-ignored, model-blend-as-mask, model-faces-skipped, model-vertex-colors-ignored,
/// model-primitives-skipped, model-polygons-simplified.
[[nodiscard]] Model readObj(const std::filesystem::path& path);

}  // namespace insitu
