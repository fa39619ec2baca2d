#pragma once

#include "core/mesh.h"

#include <filesystem>

namespace insitu {

/// Loads a model by extension: .gltf and .glb (through tinygltf), .obj, .ply and .stl.
///
/// Readers are our own, and tinygltf sees only what was checked before: assimp 5.2, the obvious
/// choice for these and for .dae and .fbx, crashes on damaged PLY and DAE files and forgets OBJ
/// smoothing groups. Other formats are an InputError that says what to use.
///
/// The result is validated (validateMesh) and in the file's own units and axes. glTF: node
/// transforms applied (negative scales flip the winding), base-colour and metallic-roughness
/// textures, alpha mask, double-sided; without normals: flat. OBJ without normals: angle-weighted
/// smooth normals within each smoothing group, flat where smoothing is off.
/// Throws InputError: unreadable or malformed file, no triangles, an entry of
/// `extensionsRequired` that we do not implement (named), a URI that leaves the model's folder.
[[nodiscard]] Model readModel(const std::filesystem::path& path);

}  // namespace insitu
