#include "core/io/gltf_reader.h"

#include "core/check.h"
#include "core/io/file.h"
#include "core/io/gltf_check.h"
#include "core/io/gltf_geometry.h"
#include "core/io/gltf_library.h"
#include "core/io/gltf_material.h"
#include "core/io/model_resources.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

namespace insitu {

namespace fs = std::filesystem;

namespace {

/// What the callbacks need to hand tinygltf the buffers that lie beside the model, in order.
struct BufferSource {
    fs::path model;
    const std::vector<ExternalBuffer>& buffers;
    std::size_t next = 0;
};

// tinygltf decodes "+" in names as a blank and insists on the exact file size; the outline knows
// the right name and how much of the file is wanted.
bool readNextBuffer(std::vector<unsigned char>* out,
                    std::string* error,
                    const std::string& name,
                    void* user)
{
    auto& source = *static_cast<BufferSource*>(user);
    if (source.next >= source.buffers.size()) {
        *error = "unexpected file " + name;
        return false;
    }
    const ExternalBuffer& wanted = source.buffers[source.next++];
    const fs::path file = resourceBeside(source.model, wanted.name);
    *out = readFile(file, kMaxModelBytes);
    const auto length = static_cast<std::size_t>(wanted.byte_length);
    if (out->size() < length)
        throw InputError(
            file.string(),
            fmt::format("has {} bytes; {} needs {}", out->size(), source.model.string(), length));
    out->resize(length);
    return true;
}

// Images stay encoded until a material uses them. Those in buffers are found there again.
bool keepEncodedImage(tinygltf::Image* image,
                      int,
                      std::string*,
                      std::string*,
                      int,
                      int,
                      const unsigned char* bytes,
                      int size,
                      void*)
{
    if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
    return true;
}

tinygltf::Model parse(const std::vector<std::uint8_t>& bytes,
                      const GltfOutline& outline,
                      const fs::path& path)
{
    BufferSource source{path, outline.external_buffers};
    tinygltf::TinyGLTF parser;
    parser.SetFsCallbacks({[](const std::string&, void*) { return true; },
                           [](const std::string& name, void*) { return name; },
                           readNextBuffer,
                           nullptr,
                           &source});
    parser.SetImageLoader(keepEncodedImage, nullptr);
    tinygltf::Model gltf;
    std::string error;
    std::string warning;
    const auto size = static_cast<unsigned>(bytes.size());
    bool good = false;
    try {
        good = outline.binary
                   ? parser.LoadBinaryFromMemory(&gltf, &error, &warning, bytes.data(), size, "")
                   : parser.LoadASCIIFromString(&gltf,
                                                &error,
                                                &warning,
                                                reinterpret_cast<const char*>(bytes.data()),
                                                size,
                                                "");
    } catch (const InputError&) {
        throw;
    } catch (const std::exception& cause) {
        throw InputError(path.string(), fmt::format("damaged glTF: {}", cause.what()));
    }
    if (!good) {
        std::replace(error.begin(), error.end(), '\n', ' ');
        constexpr std::size_t kShown = 300;  // tinygltf quotes whole data URIs
        throw InputError(path.string(), "damaged glTF: " + error.substr(0, kShown));
    }
    return gltf;
}

void noteIgnoredExtensions(const GltfOutline& outline, const fs::path& path, Model& model)
{
    std::vector<std::string> ignored = outline.extensions_used;
    std::erase_if(ignored, isGltfExtensionImplemented);
    if (ignored.empty()) return;
    constexpr std::size_t kNamed = 10;
    ignored.resize(std::min(ignored.size(), kNamed));
    model.findings.push_back(
        {Severity::Info,
         "model-extension-ignored",
         fmt::format("{}: glTF extensions not used: {}", path.string(), fmt::join(ignored, ", "))});
}

}  // namespace

Model readGltf(const fs::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxModelBytes);
    const GltfOutline outline = checkGltf(bytes, path);
    const tinygltf::Model gltf = parse(bytes, outline, path);
    Model model;
    noteIgnoredExtensions(outline, path, model);
    GltfMaterials materials(gltf, path, model);
    gatherGltfTriangles(gltf, path.string(), materials, model);
    return model;
}

}  // namespace insitu
