#include "core/io/model_io.h"

#include "core/check.h"
#include "core/io/gltf_reader.h"
#include "core/io/obj_reader.h"
#include "core/io/ply_reader.h"
#include "core/io/stl_reader.h"

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
    if (extension == ".ply") return readPly(path);
    if (extension == ".stl") return readStl(path);
    throw InputError(path.string(),
                     fmt::format("'{}' is no model format that is read; use .gltf, .glb, .obj, "
                                 ".ply or .stl (Blender converts most others)",
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
