#pragma once

#include "core/mesh.h"

#include <filesystem>

namespace insitu {

/// Reads an STL, binary or text; the result is not validated yet.
///
/// Triangles are flat and face the way they are wound; the normals in the file are not used, since
/// many writers leave them zero. One matt grey double-sided material. InputError names the cause.
[[nodiscard]] Model readStl(const std::filesystem::path& path);

}  // namespace insitu
