#pragma once

#include "core/mesh.h"

#include <filesystem>

namespace insitu {

/// Reads a PLY 1.0 (text, little- or big-endian); the result is not validated yet.
///
/// Vertices: x y z, with nx ny nz and s t (also u v, texture_u texture_v; v from the bottom) where
/// all of them are there. Faces: the list vertex_indices (or vertex_index), polygons allowed.
/// Everything else is skipped; colours give finding model-vertex-colors-ignored. Without normals:
/// flat. One matt grey double-sided material. InputError names the cause.
[[nodiscard]] Model readPly(const std::filesystem::path& path);

}  // namespace insitu
