#include "core/io/ply_reader.h"

#include "core/check.h"
#include "core/io/file.h"
#include "core/io/model_resources.h"
#include "core/io/ply_parser.h"
#include "core/io/triangulate.h"

#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

namespace insitu {

namespace {

/// Where the values of a vertex go; kSlots = nowhere.
enum Slot { kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kS, kT, kSlots };

int slotOf(std::string_view name)
{
    static constexpr std::array<std::array<std::string_view, 3>, kSlots> kNames = {
        {{"x"},
         {"y"},
         {"z"},
         {"nx"},
         {"ny"},
         {"nz"},
         {"s", "u", "texture_u"},
         {"t", "v", "texture_v"}}};
    for (int slot = 0; slot < kSlots; ++slot)
        for (const std::string_view known : kNames[static_cast<std::size_t>(slot)])
            if (known == name) return slot;
    return kSlots;
}

class PlyReader {
public:
    PlyReader(std::span<const std::uint8_t> bytes, std::string path)
        : path_(std::move(path)),
          header_(
              parsePlyHeader({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path_)),
          values_(bytes, header_, path_)
    {
    }

    Model read()
    {
        for (const PlyElement& element : header_.elements) {
            if (element.properties.empty())
                throw InputError(path_,
                                 fmt::format("element '{}' has no properties", element.name));
            if (element.name == "vertex" || element.name == "face")
                checkElementCount(element.count, path_);
            if (element.name == "vertex")
                readVertices(element);
            else if (element.name == "face")
                readFaces(element);
            else
                for (std::uint64_t i = 0; i < element.count; ++i)
                    for (const PlyProperty& property : element.properties)
                        static_cast<void>(readProperty(property));
        }
        cutFaces();
        model_.materials.emplace_back().double_sided = true;
        return std::move(model_);
    }

private:
    /// Reads one property into `list_`; its first value, or 0 when it is an empty list.
    double readProperty(const PlyProperty& property)
    {
        std::size_t count = 1;
        if (property.is_list) {
            const double stated = values_.next(property.count_type);
            if (!(stated >= 0.0) || stated != std::floor(stated) || stated > 4294967295.0)
                throw InputError(path_, "a list whose length is no whole number");
            count = static_cast<std::size_t>(stated);
            checkElementCount(count, path_);
        }
        list_.clear();
        for (std::size_t i = 0; i < count; ++i)
            list_.push_back(values_.next(property.type));
        return list_.empty() ? 0.0 : list_[0];
    }

    void readVertices(const PlyElement& element)
    {
        std::array<bool, kSlots + 1> has{};
        for (const PlyProperty& property : element.properties) {
            has[static_cast<std::size_t>(slotOf(property.name))] = true;
            if (property.name == "red" || property.name == "diffuse_red") has_colors_ = true;
        }
        if (!has[kX] || !has[kY] || !has[kZ])
            throw InputError(path_, "its vertices have no x, y and z");
        const bool normals = has[kNormalX] && has[kNormalY] && has[kNormalZ];
        const bool texcoords = has[kS] && has[kT];
        TriangleMesh& mesh = model_.mesh;
        std::array<float, kSlots + 1> v{};
        for (std::uint64_t i = 0; i < element.count; ++i) {
            for (const PlyProperty& property : element.properties)
                v[static_cast<std::size_t>(slotOf(property.name))] =
                    static_cast<float>(readProperty(property));
            mesh.positions.emplace_back(v[kX], v[kY], v[kZ]);
            if (normals) mesh.normals.emplace_back(v[kNormalX], v[kNormalY], v[kNormalZ]);
            if (texcoords) mesh.texcoords.emplace_back(v[kS], 1.0f - v[kT]);
        }
    }

    void readFaces(const PlyElement& element)
    {
        for (std::uint64_t i = 0; i < element.count; ++i)
            for (const PlyProperty& property : element.properties) {
                static_cast<void>(readProperty(property));
                if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
                if (list_.size() < 3) {
                    ++faces_skipped_;
                    continue;
                }
                face_begin_.push_back(corners_.size());
                checkElementCount(corners_.size() + list_.size(), path_);
                corners_.insert(corners_.end(), list_.begin(), list_.end());
            }
    }

    // After all elements, since faces may stand before vertices.
    void cutFaces()
    {
        TriangleMesh& mesh = model_.mesh;
        face_begin_.push_back(corners_.size());
        for (const double corner : corners_)
            if (!(corner >= 0.0) || corner >= static_cast<double>(mesh.positions.size()))
                throw InputError(
                    path_,
                    fmt::format("a face names vertex {} of {}", corner, mesh.positions.size()));
        Triangulator triangulator;
        std::vector<glm::vec3> polygon;
        std::vector<glm::uvec3> cut;
        for (std::size_t face = 0; face + 1 < face_begin_.size(); ++face) {
            const std::size_t begin = face_begin_[face];
            const auto vertex = [&](std::size_t corner) {
                return static_cast<std::uint32_t>(corners_[begin + corner]);
            };
            polygon.clear();
            cut.clear();
            for (std::size_t i = 0; begin + i < face_begin_[face + 1]; ++i)
                polygon.push_back(mesh.positions[vertex(i)]);
            triangulator.triangulate(polygon, cut);
            for (const glm::uvec3& t : cut)
                mesh.triangles.emplace_back(vertex(t.x), vertex(t.y), vertex(t.z));
        }
        mesh.material_of.assign(mesh.triangles.size(), 0);
        report(triangulator.gaveUp());
    }

    void report(bool simplified)
    {
        const auto find = [&](Severity severity, const char* code, const std::string& message) {
            model_.findings.push_back({severity, code, fmt::format("{}: {}", path_, message)});
        };
        if (has_colors_)
            find(Severity::Info, "model-vertex-colors-ignored", "vertex colours are not used");
        if (faces_skipped_ > 0)
            find(Severity::Warning,
                 "model-faces-skipped",
                 fmt::format("{} faces with fewer than three corners are skipped", faces_skipped_));
        if (simplified)
            find(Severity::Warning,
                 "model-polygons-simplified",
                 "polygons with very many corners were cut roughly");
    }

    std::string path_;
    PlyHeader header_;
    PlyValues values_;
    Model model_;
    std::vector<double> list_;
    std::vector<double> corners_;
    std::vector<std::size_t> face_begin_;
    std::size_t faces_skipped_ = 0;
    bool has_colors_ = false;
};

}  // namespace

Model readPly(const std::filesystem::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxModelBytes);
    return PlyReader(bytes, path.string()).read();
}

}  // namespace insitu
