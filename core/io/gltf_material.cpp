#include "core/io/gltf_material.h"

#include "core/check.h"
#include "core/io/gltf_check.h"
#include "core/io/gltf_library.h"
#include "core/io/model_resources.h"

#include <algorithm>

namespace insitu {

namespace {

float unit(double value)
{
    return static_cast<float>(std::clamp(value, 0.0, 1.0));
}

const tinygltf::Value& extensionValue(const tinygltf::Material& material,
                                      const char* extension,
                                      const char* key)
{
    static const tinygltf::Value kNothing;
    const auto found = material.extensions.find(extension);
    return found != material.extensions.end() && found->second.IsObject() ? found->second.Get(key)
                                                                          : kNothing;
}

// Encoded bytes inside a buffer; the range was checked by checkGltf.
std::span<const std::uint8_t> embeddedImage(const tinygltf::Model& gltf,
                                            const tinygltf::Image& image)
{
    if (image.bufferView < 0) return image.image;
    const auto& view = gltf.bufferViews[static_cast<std::size_t>(image.bufferView)];
    const auto& data = gltf.buffers[static_cast<std::size_t>(view.buffer)].data;
    return std::span(data).subspan(view.byteOffset, view.byteLength);
}

}  // namespace

void GltfMaterials::find(Severity severity, const char* code, const std::string& message)
{
    model_.findings.push_back({severity, code, fmt::format("{}: {}", path_.string(), message)});
}

std::uint32_t GltfMaterials::materialOf(int gltf_material)
{
    if (gltf_material < -1 || gltf_material >= static_cast<int>(gltf_.materials.size()))
        throw InputError(
            path_.string(),
            fmt::format("material {} of {} does not exist", gltf_material, gltf_.materials.size()));
    const auto next = static_cast<std::uint32_t>(model_.materials.size());
    const auto [entry, is_new] = materials_.try_emplace(gltf_material, next);
    if (is_new)
        model_.materials.push_back(
            convert(gltf_material < 0 ? tinygltf::Material{}
                                      : gltf_.materials[static_cast<std::size_t>(gltf_material)]));
    return entry->second;
}

int GltfMaterials::texcoordSetOf(int gltf_material) const
{
    if (gltf_material < 0 || gltf_material >= static_cast<int>(gltf_.materials.size())) return 0;
    const auto& source = gltf_.materials[static_cast<std::size_t>(gltf_material)];
    const auto& pbr = source.pbrMetallicRoughness;
    if (pbr.baseColorTexture.index >= 0) return pbr.baseColorTexture.texCoord;
    if (pbr.metallicRoughnessTexture.index >= 0) return pbr.metallicRoughnessTexture.texCoord;
    return source.emissiveTexture.index >= 0 ? source.emissiveTexture.texCoord : 0;
}

Material GltfMaterials::convert(const tinygltf::Material& source)
{
    const auto& pbr = source.pbrMetallicRoughness;
    Material material;
    material.name = source.name;
    if (pbr.baseColorFactor.size() == 4) {
        for (int c = 0; c < 3; ++c)
            material.base_color[c] = unit(pbr.baseColorFactor[static_cast<std::size_t>(c)]);
        material.alpha = unit(pbr.baseColorFactor[3]);
    } else {
        material.base_color = glm::vec3(1.0f);
    }
    material.metallic = unit(pbr.metallicFactor);
    material.roughness = unit(pbr.roughnessFactor);
    material.double_sided = source.doubleSided;
    if (source.emissiveFactor.size() == 3)
        for (int c = 0; c < 3; ++c)
            material.emissive[c] = unit(source.emissiveFactor[static_cast<std::size_t>(c)]);
    material.base_color_texture = textureOf(pbr.baseColorTexture.index, true);
    material.metallic_roughness_texture = textureOf(pbr.metallicRoughnessTexture.index, false);
    material.emissive_texture = textureOf(source.emissiveTexture.index, true);
    applyAlphaMode(source, material);
    applyExtensions(source, material);
    noteIgnoredMaps(source);
    return material;
}

bool GltfMaterials::isTransparent(const Material& material) const
{
    if (material.alpha < 1.0f) return true;
    if (material.base_color_texture == kNoTexture) return false;
    const auto& texture = model_.textures[static_cast<std::size_t>(material.base_color_texture)];
    const auto texels = texture.texels.pixels();
    return std::any_of(texels.begin(), texels.end(), [](auto texel) { return texel.a < 255; });
}

void GltfMaterials::applyAlphaMode(const tinygltf::Material& source, Material& material)
{
    const bool blend = source.alphaMode == "BLEND";
    // OPAQUE means that alpha is ignored, whatever factor and texture hold.
    if (!blend && source.alphaMode != "MASK") {
        material.alpha = 1.0f;
        return;
    }
    material.alpha_mask = isTransparent(material);
    material.alpha_cutoff = blend ? 0.5f : static_cast<float>(std::max(source.alphaCutoff, 0.0));
    if (blend && material.alpha_mask)
        find(Severity::Warning,
             "model-blend-as-mask",
             fmt::format("material '{}' is translucent; it is cut out where its opacity is below "
                         "one half",
                         source.name));
}

void GltfMaterials::applyExtensions(const tinygltf::Material& source, Material& material)
{
    const auto& specular = extensionValue(source, "KHR_materials_specular", "specularFactor");
    if (specular.IsNumber()) material.specular = unit(specular.GetNumberAsDouble());
    const auto& strength =
        extensionValue(source, "KHR_materials_emissive_strength", "emissiveStrength");
    if (strength.IsNumber())
        material.emissive *= static_cast<float>(std::clamp(strength.GetNumberAsDouble(), 0.0, 1e9));
    for (const char* key : {"specularTexture", "specularColorTexture", "specularColorFactor"})
        if (extensionValue(source, "KHR_materials_specular", key).Type() != tinygltf::NULL_TYPE)
            find(Severity::Info,
                 "model-map-ignored",
                 fmt::format("material '{}': {} is not used", source.name, key));
}

void GltfMaterials::noteIgnoredMaps(const tinygltf::Material& source)
{
    std::string ignored;
    if (source.normalTexture.index >= 0) ignored = "normal map";
    if (source.occlusionTexture.index >= 0)
        ignored += ignored.empty() ? "occlusion" : ", occlusion";
    if (!ignored.empty())
        find(Severity::Info,
             "model-map-ignored",
             fmt::format("material '{}': not used: {}", source.name, ignored));
    const auto& pbr = source.pbrMetallicRoughness;
    if (pbr.baseColorTexture.index >= 0 && pbr.metallicRoughnessTexture.index >= 0 &&
        pbr.baseColorTexture.texCoord != pbr.metallicRoughnessTexture.texCoord)
        find(Severity::Warning,
             "model-texcoord-set-ignored",
             fmt::format("material '{}' uses two sets of texture coordinates; the base colour's is "
                         "used for all",
                         source.name));
}

int GltfMaterials::textureOf(int gltf_texture, bool srgb)
{
    if (gltf_texture < 0) return kNoTexture;
    if (static_cast<std::size_t>(gltf_texture) >= gltf_.textures.size())
        throw InputError(path_.string(), fmt::format("texture {} does not exist", gltf_texture));
    const auto [entry, is_new] = textures_.try_emplace({gltf_texture, srgb}, kNoTexture);
    if (!is_new) return entry->second;
    const auto& source = gltf_.textures[static_cast<std::size_t>(gltf_texture)];
    entry->second = loadTexture(source.source, srgb);
    if (entry->second == kNoTexture || source.sampler < 0) return entry->second;
    if (static_cast<std::size_t>(source.sampler) >= gltf_.samplers.size())
        throw InputError(path_.string(), fmt::format("sampler {} does not exist", source.sampler));
    const auto& sampler = gltf_.samplers[static_cast<std::size_t>(source.sampler)];
    Texture& texture = model_.textures[static_cast<std::size_t>(entry->second)];
    texture.clamp_s = sampler.wrapS == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
    texture.clamp_t = sampler.wrapT == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
    if (sampler.wrapS == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ||
        sampler.wrapT == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT)
        find(Severity::Warning,
             "model-wrap-ignored",
             fmt::format("texture {} is to be mirrored; it is repeated", gltf_texture));
    return entry->second;
}

int GltfMaterials::loadTexture(int image, bool srgb)
{
    if (image < 0 || static_cast<std::size_t>(image) >= gltf_.images.size()) {
        find(Severity::Warning,
             "model-texture-missing",
             "a texture has no image that can be read; the plain colour is used");
        return kNoTexture;
    }
    const auto& source = gltf_.images[static_cast<std::size_t>(image)];
    if (!source.uri.empty()) return addTextureFile(model_, path_, percentDecoded(source.uri), srgb);
    return addTexture(model_,
                      embeddedImage(gltf_, source),
                      fmt::format("{}: image {}", path_.string(), image),
                      srgb);
}

}  // namespace insitu
