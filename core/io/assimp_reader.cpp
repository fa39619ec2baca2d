#include "core/io/assimp_reader.h"

#include "core/check.h"
#include "core/io/file.h"
#include "core/io/model_resources.h"

#include <assimp/GltfMaterial.h>
#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <map>
#include <utility>
#include <vector>

namespace insitu {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxVertices = 20'000'000;

std::string hintOf(const fs::path& path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) {
        return static_cast<char>(std::tolower(c));
    });
    return extension.empty() ? extension : extension.substr(1);
}

glm::dmat4 convert(const aiMatrix4x4& m)
{
    return {{m.a1, m.b1, m.c1, m.d1},
            {m.a2, m.b2, m.c2, m.d2},
            {m.a3, m.b3, m.c3, m.d3},
            {m.a4, m.b4, m.c4, m.d4}};
}

std::string textureName(const std::string& stated)
{
    std::string name = stated;
    std::replace(name.begin(), name.end(), '\\', '/');
    const bool absolute = name.starts_with('/') || name.find(':') != std::string::npos;
    return absolute ? name.substr(name.find_last_of("/:") + 1) : name;
}

int embeddedTexture(const aiTexture& source, Model& model, const std::string& name)
{
    if (source.mHeight == 0)  // compressed: mWidth is its size in bytes
        return addTexture(model,
                          {reinterpret_cast<const std::uint8_t*>(source.pcData), source.mWidth},
                          name,
                          true);
    model.findings.push_back({Severity::Warning,
                              "model-texture-unreadable",
                              name + ": raw texels inside the file; the plain colour is used"});
    return kNoTexture;
}

class AssimpConverter {
public:
    AssimpConverter(const aiScene& scene, const fs::path& path) : scene_(scene), path_(path) {}

    Model convertScene()
    {
        for (unsigned i = 0; i < scene_.mNumMaterials; ++i)
            model_.materials.push_back(material(*scene_.mMaterials[i]));
        if (model_.materials.empty()) model_.materials.emplace_back();
        for (unsigned i = 0; i < scene_.mNumMeshes; ++i) {
            any_normals_ |= scene_.mMeshes[i]->HasNormals();
            any_texcoords_ |= scene_.mMeshes[i]->HasTextureCoords(0);
        }
        std::vector<std::pair<const aiNode*, glm::dmat4>> open = {
            {scene_.mRootNode, glm::dmat4(1.0)}};
        while (!open.empty()) {
            const auto [node, model_from_parent] = open.back();
            open.pop_back();
            const glm::dmat4 model_from_node = model_from_parent * convert(node->mTransformation);
            for (unsigned i = 0; i < node->mNumMeshes; ++i)
                if (node->mMeshes[i] < scene_.mNumMeshes)
                    append(*scene_.mMeshes[node->mMeshes[i]], model_from_node);
            for (unsigned i = node->mNumChildren; i-- > 0;)
                open.emplace_back(node->mChildren[i], model_from_node);
        }
        return std::move(model_);
    }

private:
    Material material(const aiMaterial& source)
    {
        Material material;
        material.double_sided = true;
        material.specular = 0.0f;
        aiString text;
        if (source.Get(AI_MATKEY_NAME, text) == AI_SUCCESS) material.name = text.C_Str();
        aiColor4D color;
        if (source.Get(AI_MATKEY_BASE_COLOR, color) == AI_SUCCESS ||
            source.Get(AI_MATKEY_COLOR_DIFFUSE, color) == AI_SUCCESS)
            material.base_color = unit({color.r, color.g, color.b});
        if (source.Get(AI_MATKEY_COLOR_EMISSIVE, color) == AI_SUCCESS)
            material.emissive = unit({color.r, color.g, color.b});
        float value = 0.0f;
        if (source.Get(AI_MATKEY_METALLIC_FACTOR, value) == AI_SUCCESS)
            material.metallic = unit(glm::vec3(value)).x;
        if (source.Get(AI_MATKEY_ROUGHNESS_FACTOR, value) == AI_SUCCESS) {
            material.roughness = unit(glm::vec3(value)).x;
            material.specular = 1.0f;
        }
        if (source.Get(AI_MATKEY_OPACITY, value) == AI_SUCCESS)
            material.alpha = unit(glm::vec3(value)).x;
        material.alpha_mask = material.alpha < 1.0f;
        if (material.alpha_mask) noteTranslucent(material);
        if (source.GetTexture(aiTextureType_DIFFUSE, 0, &text) == AI_SUCCESS && text.length > 0) {
            material.base_color_texture = texture(text.C_Str());
            if (material.base_color_texture != kNoTexture) material.base_color = glm::vec3(1.0f);
        }
        return material;
    }

    // Not a number becomes 0.
    static glm::vec3 unit(glm::vec3 v)
    {
        for (int c = 0; c < 3; ++c)
            v[c] = v[c] > 0.0f ? std::min(v[c], 1.0f) : 0.0f;
        return v;
    }

    void noteTranslucent(const Material& material)
    {
        model_.findings.push_back(
            {Severity::Warning,
             "model-blend-as-mask",
             fmt::format("{}: material '{}' has opacity {}; it is drawn {}",
                         path_.string(),
                         material.name,
                         material.alpha,
                         material.alpha < material.alpha_cutoff ? "not at all" : "opaque")});
    }

    int texture(const std::string& name)
    {
        const auto [entry, is_new] = textures_.try_emplace(name, kNoTexture);
        if (!is_new) return entry->second;
        const aiTexture* embedded = nullptr;
        if (name.starts_with('*')) {
            const int index = std::atoi(name.c_str() + 1);
            if (index >= 0 && static_cast<unsigned>(index) < scene_.mNumTextures)
                embedded = scene_.mTextures[index];
        } else {
            embedded = scene_.GetEmbeddedTexture(name.c_str());
        }
        entry->second =
            embedded ? embeddedTexture(*embedded, model_, path_.string() + ": texture " + name)
                     : addTextureFile(model_, path_, textureName(name), true);
        return entry->second;
    }

    void append(const aiMesh& source, const glm::dmat4& model_from_node)
    {
        TriangleMesh& mesh = model_.mesh;
        const auto first = static_cast<std::uint32_t>(mesh.positions.size());
        if (source.mNumVertices > kMaxVertices - first)
            throw InputError(path_.string(), fmt::format("more than {} vertices", kMaxVertices));
        const glm::dmat3 linear(model_from_node);
        const bool mirrored = glm::determinant(linear) < 0.0;
        appendVertices(source, model_from_node, mirrored);
        for (unsigned i = 0; i < source.mNumFaces; ++i) {
            const aiFace& face = source.mFaces[i];
            if (face.mNumIndices != 3) continue;
            const glm::uvec3 corners(
                face.mIndices[0], face.mIndices[mirrored ? 2 : 1], face.mIndices[mirrored ? 1 : 2]);
            if (std::max({corners.x, corners.y, corners.z}) >= source.mNumVertices)
                throw InputError(path_.string(), "a triangle names a vertex that does not exist");
            mesh.triangles.push_back(first + corners);
            mesh.material_of.push_back(
                source.mMaterialIndex < model_.materials.size() ? source.mMaterialIndex : 0);
        }
    }

    void appendVertices(const aiMesh& source, const glm::dmat4& model_from_node, bool mirrored)
    {
        TriangleMesh& mesh = model_.mesh;
        const glm::dmat3 m(model_from_node);
        const double sign = mirrored ? -1.0 : 1.0;
        // Cofactors, as in the glTF reader: normals survive uneven scales.
        const glm::dmat3 model_from_normal(sign * glm::cross(m[1], m[2]),
                                           sign * glm::cross(m[2], m[0]),
                                           sign * glm::cross(m[0], m[1]));
        for (unsigned i = 0; i < source.mNumVertices; ++i) {
            const aiVector3D& p = source.mVertices[i];
            mesh.positions.emplace_back(
                glm::dvec3(model_from_node * glm::dvec4(p.x, p.y, p.z, 1.0)));
            if (any_normals_) {
                glm::dvec3 normal(0.0);
                if (source.HasNormals())
                    normal = model_from_normal * glm::dvec3(source.mNormals[i].x,
                                                            source.mNormals[i].y,
                                                            source.mNormals[i].z);
                const double length = glm::length(normal);
                mesh.normals.emplace_back(length > 0.0 ? normal / length : glm::dvec3(0.0));
            }
            if (any_texcoords_) {
                glm::vec2 uv(0.0f);
                if (source.HasTextureCoords(0))
                    uv = {source.mTextureCoords[0][i].x, 1.0f - source.mTextureCoords[0][i].y};
                mesh.texcoords.push_back(uv);
            }
        }
    }

    const aiScene& scene_;
    const fs::path& path_;
    Model model_;
    std::map<std::string, int> textures_;
    bool any_normals_ = false;
    bool any_texcoords_ = false;
};

}  // namespace

bool isAssimpFormat(const std::string& extension)
{
    return extension == ".ply" || extension == ".stl" || extension == ".dae" || extension == ".fbx";
}

Model readWithAssimp(const fs::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxModelBytes);
    if (bytes.empty()) throw InputError(path.string(), "is empty");
    Assimp::Importer importer;
    importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
    const aiScene* scene =
        importer.ReadFileFromMemory(bytes.data(),
                                    bytes.size(),
                                    aiProcess_Triangulate | aiProcess_SortByPType,
                                    hintOf(path).c_str());
    if (!scene || !scene->mRootNode)
        throw InputError(path.string(),
                         fmt::format("cannot be read: {}", importer.GetErrorString()));
    return AssimpConverter(*scene, path).convertScene();
}

}  // namespace insitu
