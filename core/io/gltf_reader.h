#pragma once

#include "core/mesh.h"

#include <filesystem>

namespace insitu {

/// Reads a .gltf or .glb (by content, not by name); the result is not validated yet.
///
/// Only what checkGltf lets pass reaches tinygltf. Buffers and images come from the file itself,
/// data URIs, or files in its own folder. Cameras, lights, animations and skins are not used. An
/// entry of `extensionsUsed` that is not implemented gives finding model-extension-ignored; one of
/// `extensionsRequired` is an InputError. Other findings: see gltf_geometry.h, gltf_material.h.
[[nodiscard]] Model readGltf(const std::filesystem::path& path);

}  // namespace insitu
