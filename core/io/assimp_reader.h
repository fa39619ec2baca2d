#pragma once

#include "core/mesh.h"

#include <filesystem>
#include <string>

namespace insitu {

/// Formats that are read through assimp: ".ply", ".stl", ".dae", ".fbx" (lower case).
[[nodiscard]] bool isAssimpFormat(const std::string& extension);

/// Reads a model through assimp, from memory, so that it opens no other file; the result is not
/// validated yet.
///
/// Node transforms are applied, negative scales flip the winding. Normals as in the file, else
/// flat. Diffuse colour, opacity, emission and diffuse texture become a matt material; metallic
/// and roughness factors are taken where the format has them. A texture is looked for beside the
/// model only: of an absolute name (usual in FBX) just the file name counts.
/// InputError: what assimp cannot read, more than 20 million vertices, a name with "..".
[[nodiscard]] Model readWithAssimp(const std::filesystem::path& path);

}  // namespace insitu
