#pragma once

#include "core/mesh.h"

#include <filesystem>

namespace insitu {

/// Loads a model by extension: .gltf/.glb through tinygltf; .obj and the rest through assimp.
///
/// The result is validated (validateMesh) and in the file's own units and axes. glTF: node
/// transforms applied (negative scales flip the winding), base-colour and metallic-roughness
/// textures, alpha mask, double-sided; without normals: flat. OBJ without normals: angle-weighted
/// smooth normals within each smoothing group, flat where smoothing is off.
/// Throws InputError: unreadable or malformed file, no triangles, an entry of
/// `extensionsRequired` that we do not implement (named), a URI that leaves the model's folder.
[[nodiscard]] Model readModel(const std::filesystem::path& path);

}  // namespace insitu
