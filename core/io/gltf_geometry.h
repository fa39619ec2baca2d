#pragma once

#include "core/io/gltf_material.h"
#include "core/mesh.h"

#include <string>

namespace tinygltf {
class Model;
}

namespace insitu {

/// Gathers the triangles of a glTF's default scene (or first, or all root nodes when it has none)
/// into `model.mesh`, node transforms applied.
///
/// Triangles, strips and fans; points and lines are skipped (finding model-primitives-skipped), as
/// are vertex colours (model-vertex-colors-ignored) and skins (model-skin-ignored). A primitive
/// without normals is flat. InputError: a node that is reached twice (a cycle or two parents), an
/// index out of range, more than kMaxModelElements vertices.
void gatherGltfTriangles(const tinygltf::Model& gltf,
                         const std::string& path,
                         GltfMaterials& materials,
                         Model& model);

}  // namespace insitu
