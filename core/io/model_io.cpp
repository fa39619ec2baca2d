#include "core/io/model_io.h"

#include "core/check.h"
#include "core/io/assimp_reader.h"
#include "core/io/gltf_reader.h"
#include "core/io/obj_reader.h"

#include <algorithm>
#include <cctype>
#include <string>

namespace insitu {

namespace {

std::string lowerExtension(const std::filesystem::path& path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) {
        return static_cast<char>(std::tolower(c));
    });
    return extension;
}

Model readByExtension(const std::filesystem::path& path)
{
    const std::string extension = lowerExtension(path);
    if (extension == ".obj") return readObj(path);
    if (extension == ".gltf" || extension == ".glb") return readGltf(path);
    if (isAssimpFormat(extension)) return readWithAssimp(path);
    throw InputError(path.string(),
                     fmt::format("'{}' is no model format that is read; use .gltf, .glb, .obj, "
                                 ".ply, .stl, .dae or .fbx",
                                 extension));
}

}  // namespace

Model readModel(const std::filesystem::path& path)
{
    Model model = readByExtension(path);
    validateMesh(model, path.string());
    return model;
}

}  // namespace insitu
