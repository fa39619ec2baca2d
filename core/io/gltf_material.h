#pragma once

#include "core/mesh.h"

#include <filesystem>
#include <map>
#include <string>
#include <tuple>
#include <vector>

namespace tinygltf {
class Model;
struct Material;
}  // namespace tinygltf

namespace insitu {

/// Turns glTF materials into ours, loading each texture once for each use of it.
///
/// BLEND becomes a mask at 0.5 (finding model-blend-as-mask) where anything is transparent at all;
/// KHR_materials_specular's factor and KHR_materials_emissive_strength are honoured; normal and
/// occlusion maps are not (model-map-ignored). A texture without image, or one that is missing or
/// damaged, leaves the plain colour and a finding; a file outside the folder is an InputError.
class GltfMaterials {
public:
    GltfMaterials(const tinygltf::Model& gltf, std::filesystem::path path, Model& model)
        : gltf_(gltf), path_(std::move(path)), model_(model)
    {
    }

    /// Index into Model::materials; -1 gives glTF's default material.
    [[nodiscard]] std::uint32_t materialOf(int gltf_material);
    /// TEXCOORD set that this material's textures use.
    [[nodiscard]] int texcoordSetOf(int gltf_material) const;

private:
    [[nodiscard]] Material convert(const tinygltf::Material& source);
    [[nodiscard]] int textureOf(int gltf_texture, bool srgb);
    [[nodiscard]] int loadTexture(int image, bool srgb);
    [[nodiscard]] bool isTransparent(const Material& material) const;
    void applyAlphaMode(const tinygltf::Material& source, Material& material);
    void applyExtensions(const tinygltf::Material& source, Material& material);
    void noteIgnoredMaps(const tinygltf::Material& source);
    void find(Severity severity, const char* code, const std::string& message);

    const tinygltf::Model& gltf_;
    std::filesystem::path path_;
    Model& model_;
    std::map<int, std::uint32_t> materials_;
    std::map<std::tuple<int, bool>, int> textures_;
};

}  // namespace insitu
