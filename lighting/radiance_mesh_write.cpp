#include "core/io/file.h"
#include "core/io/json.h"
#include "lighting/radiance_mesh.h"

#include <bit>

namespace insitu {

namespace {

Json rgbJson(Rgb value)
{
    return Json::array({value.r, value.g, value.b});
}

Json meshJson(const RadianceMesh& mesh)
{
    static constexpr const char* kSources[] = {"probe", "photograph", "opening"};
    Json vertices = Json::array();
    for (const RadianceVertex& vertex : mesh.vertices)
        vertices.push_back({{"position_m", toJson(vertex.position_m)},
                            {"normal", toJson(vertex.normal)},
                            {"radiance", rgbJson(vertex.radiance)},
                            {"reflectance", rgbJson(vertex.reflectance)}});
    Json patches = Json::array();
    for (const RadiancePatch& patch : mesh.patches)
        patches.push_back(
            {{"vertices", Json::array({patch.corners.x, patch.corners.y, patch.corners.z})},
             {"source", kSources[static_cast<std::size_t>(patch.source)]},
             {"area_m2", patch.area_m2},
             {"radiance", rgbJson(patch.radiance)},
             {"irradiance", rgbJson(patch.irradiance)},
             {"reflectance", rgbJson(patch.reflectance)}});
    return {{"format", "insitu-radiance-mesh"},
            {"version", 1},
            {"vertices", vertices},
            {"patches", patches}};
}

std::string plyHeader(const RadianceMesh& mesh)
{
    const auto colors = [](const char* name) {
        std::string text;
        for (const char* channel : {"r", "g", "b"})
            text += fmt::format("property float {}_{}\n", name, channel);
        return text;
    };
    std::string header = "ply\nformat binary_little_endian 1.0\n";
    header += "comment radiance mesh, metres, y up\n";
    header += fmt::format("element vertex {}\n", mesh.vertices.size());
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz"})
        header += fmt::format("property float {}\n", name);
    header += colors("radiance") + colors("reflectance");
    header += fmt::format("element face {}\nproperty list uchar uint vertex_indices\n",
                          mesh.patches.size());
    return header + colors("radiance") + colors("reflectance") + "end_header\n";
}

void appendFloats(std::string& bytes, glm::vec3 values)
{
    static_assert(std::endian::native == std::endian::little);
    bytes.append(reinterpret_cast<const char*>(&values), sizeof(values));
}

}  // namespace

void writeRadianceMesh(const std::filesystem::path& path, const RadianceMesh& mesh)
{
    const std::string extension = path.extension().string();
    if (extension == ".json") {
        writeJson(path, meshJson(mesh));
        return;
    }
    if (extension != ".ply")
        throw InputError(path.string(), "a radiance mesh is written as .ply or .json");
    std::string bytes = plyHeader(mesh);
    for (const RadianceVertex& vertex : mesh.vertices) {
        appendFloats(bytes, glm::vec3(vertex.position_m));
        appendFloats(bytes, glm::vec3(vertex.normal));
        appendFloats(bytes, vertex.radiance);
        appendFloats(bytes, vertex.reflectance);
    }
    for (const RadiancePatch& patch : mesh.patches) {
        bytes.push_back(3);
        bytes.append(reinterpret_cast<const char*>(&patch.corners), sizeof(patch.corners));
        appendFloats(bytes, patch.radiance);
        appendFloats(bytes, patch.reflectance);
    }
    writeTextFile(path, bytes);
}

}  // namespace insitu
