#include "core/io/obj_reader.h"

#include "core/io/file.h"
#include "core/io/model_resources.h"
#include "core/io/mtl_reader.h"
#include "core/io/obj_parser.h"
#include "core/io/smooth_normals.h"
#include "core/io/triangulate.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <set>
#include <unordered_map>
#include <utility>

namespace insitu {

namespace fs = std::filesystem;

namespace {

/// Everything that makes two corners the same vertex. `shading` tells apart what shares a position
/// but not a normal: a stated normal, a smoothing group, or a single flat triangle.
struct VertexKey {
    std::int64_t position = 0;
    std::int64_t texcoord = 0;
    std::int64_t shading = 0;
    bool operator==(const VertexKey&) const = default;
};

struct VertexKeyHash {
    std::size_t operator()(const VertexKey& key) const
    {
        std::uint64_t hash = 0;
        for (const std::int64_t part : {key.position, key.texcoord, key.shading})
            hash = (hash ^ static_cast<std::uint64_t>(part)) * 0x9E3779B97F4A7C15ull;
        return static_cast<std::size_t>(hash ^ (hash >> 32));
    }
};

PolygonSoup soupOf(const ObjFile& file)
{
    PolygonSoup soup;
    soup.positions = file.positions;
    soup.corner_position.reserve(file.corners.size());
    for (const ObjCorner& corner : file.corners)
        soup.corner_position.push_back(static_cast<std::uint32_t>(corner.position));
    for (const ObjFace& face : file.faces) {
        soup.face_begin.push_back(static_cast<std::uint32_t>(face.first_corner));
        soup.face_group.push_back(face.smoothing);
    }
    soup.face_begin.push_back(static_cast<std::uint32_t>(file.corners.size()));
    return soup;
}

/// Turns polygons into triangles with one set of attributes a vertex.
class MeshBuilder {
public:
    explicit MeshBuilder(const ObjFile& file)
        : file_(file), soup_(soupOf(file)), corner_normals_(cornerNormals(soup_))
    {
        has_texcoords_ = std::any_of(file.corners.begin(), file.corners.end(), [](auto& corner) {
            return corner.texcoord != kObjAbsent;
        });
        for (const ObjFace& face : file.faces)
            has_normals_ |= face.smoothing != 0 || statesNormals(face);
    }

    TriangleMesh build()
    {
        for (std::size_t face = 0; face < file_.faces.size(); ++face)
            addFace(face);
        return std::move(mesh_);
    }
    [[nodiscard]] bool simplified() const { return triangulator_.gaveUp(); }

private:
    [[nodiscard]] bool statesNormals(const ObjFace& face) const
    {
        const auto corners = std::span(file_.corners).subspan(face.first_corner, face.corner_count);
        return std::all_of(corners.begin(), corners.end(), [](const ObjCorner& corner) {
            return corner.normal != kObjAbsent;
        });
    }

    void addFace(std::size_t index)
    {
        const ObjFace& face = file_.faces[index];
        polygon_.clear();
        for (const std::uint32_t position : soup_.corners(index))
            polygon_.push_back(file_.positions[position]);
        triangles_.clear();
        triangulator_.triangulate(polygon_, triangles_);
        for (const glm::uvec3& triangle : triangles_) {
            const glm::uvec3 vertices(addVertex(face, triangle, 0),
                                      addVertex(face, triangle, 1),
                                      addVertex(face, triangle, 2));
            mesh_.triangles.push_back(vertices);
            mesh_.material_of.push_back(face.material);
        }
    }

    std::uint32_t addVertex(const ObjFace& face, const glm::uvec3& triangle, int which)
    {
        const std::size_t at = face.first_corner + triangle[which];
        const ObjCorner& corner = file_.corners[at];
        // Shading numbers: 0 when nothing has normals, > 0 smoothing groups, odd < 0 stated
        // normals, even < 0 flat triangles.
        std::int64_t shading = 0;
        glm::vec3 normal(0.0f);
        if (statesNormals(face)) {
            shading = -2 * corner.normal - 1;
            normal = file_.normals[static_cast<std::size_t>(corner.normal)];
        } else if (face.smoothing != 0) {
            shading = face.smoothing;
            normal = corner_normals_[at];
        } else if (has_normals_) {
            // A renderer shades a bent flat quadrilateral by its triangles, not by their mean.
            shading = -2 * static_cast<std::int64_t>(mesh_.triangles.size()) - 2;
            normal = triangleNormal(triangle);
        }
        const auto next = static_cast<std::uint32_t>(mesh_.positions.size());
        const auto [entry, is_new] =
            vertices_.try_emplace({corner.position, corner.texcoord, shading}, next);
        if (!is_new) return entry->second;
        mesh_.positions.push_back(file_.positions[static_cast<std::size_t>(corner.position)]);
        if (has_normals_) mesh_.normals.push_back(normal);
        if (has_texcoords_) mesh_.texcoords.push_back(texcoord(corner));
        return next;
    }

    [[nodiscard]] glm::vec3 triangleNormal(const glm::uvec3& triangle) const
    {
        const glm::dvec3 a(polygon_[triangle[0]]);
        const glm::dvec3 n = glm::cross(glm::dvec3(polygon_[triangle[1]]) - a,
                                        glm::dvec3(polygon_[triangle[2]]) - a);
        const double length = glm::length(n);
        return length > 0.0 ? glm::vec3(n / length) : glm::vec3(0.0f);
    }

    [[nodiscard]] glm::vec2 texcoord(const ObjCorner& corner) const
    {
        if (corner.texcoord == kObjAbsent) return glm::vec2(0.0f);
        const glm::vec2 from_bottom = file_.texcoords[static_cast<std::size_t>(corner.texcoord)];
        return {from_bottom.x, 1.0f - from_bottom.y};
    }

    const ObjFile& file_;
    PolygonSoup soup_;
    std::vector<glm::vec3> corner_normals_;
    bool has_texcoords_ = false;
    bool has_normals_ = false;
    Triangulator triangulator_;
    std::vector<glm::vec3> polygon_;
    std::vector<glm::uvec3> triangles_;
    std::unordered_map<VertexKey, std::uint32_t, VertexKeyHash> vertices_;
    TriangleMesh mesh_;
};

using MtlLibrary = std::map<std::string, MtlMaterial>;

void addLibrary(MtlLibrary& library, const fs::path& file)
{
    for (auto& [name, material] : readMtl(file))
        library.insert_or_assign(name, material);
}

// `mtllib` may name several files, but file names may also hold blanks: the whole name first.
MtlLibrary readLibraries(const ObjFile& file, const fs::path& path, Findings& findings)
{
    MtlLibrary library;
    for (const std::string& argument : file.material_libraries) {
        std::error_code error;
        const fs::path whole = resourceBeside(path, argument);
        if (fs::is_regular_file(whole, error)) {
            addLibrary(library, whole);
            continue;
        }
        ObjLines words(argument);
        while (words.next())
            for (const std::string_view word : words.words()) {
                const fs::path part = resourceBeside(path, word);
                if (fs::is_regular_file(part, error))
                    addLibrary(library, part);
                else
                    findings.push_back({Severity::Warning,
                                        "model-material-missing",
                                        fmt::format("{}: material library {} does not exist",
                                                    path.string(),
                                                    part.string())});
            }
    }
    return library;
}

void addMaterial(Model& model,
                 const std::string& name,
                 const MtlLibrary& library,
                 const fs::path& path,
                 std::map<std::string, int>& texture_of_name)
{
    const auto found = library.find(name);
    if (found == library.end()) {
        Material plain;
        plain.name = name;
        plain.double_sided = true;
        model.materials.push_back(plain);
        if (!name.empty())
            model.findings.push_back(
                {Severity::Warning,
                 "model-material-missing",
                 fmt::format("{}: no material '{}' in its libraries; a matt grey is used",
                             path.string(),
                             name)});
        return;
    }
    const MtlMaterial& source = found->second;
    Material material = source.material;
    if (!source.diffuse_map.empty()) {
        const std::string key = source.diffuse_map + (source.clamp ? "|clamp" : "|repeat");
        const auto [entry, is_new] = texture_of_name.try_emplace(key, kNoTexture);
        if (is_new) entry->second = addTextureFile(model, path, source.diffuse_map, true);
        material.base_color_texture = entry->second;
    }
    if (material.base_color_texture != kNoTexture) {
        Texture& texture = model.textures[static_cast<std::size_t>(material.base_color_texture)];
        texture.clamp_s = texture.clamp_t = source.clamp;
        material.base_color = glm::vec3(1.0f);  // the texture replaces Kd
    }
    if (!source.ignored.empty())
        model.findings.push_back(
            {Severity::Info,
             "model-map-ignored",
             fmt::format("{}: material '{}': not used: {}", path.string(), name, source.ignored)});
    if (material.alpha_mask)
        model.findings.push_back(
            {Severity::Warning,
             "model-blend-as-mask",
             fmt::format("{}: material '{}' has opacity {}; it is drawn {}",
                         path.string(),
                         name,
                         material.alpha,
                         material.alpha < material.alpha_cutoff ? "not at all" : "opaque")});
    model.materials.push_back(material);
}

void addFindings(Model& model, const ObjFile& file, const std::string& path)
{
    if (file.faces_with_too_few_corners > 0)
        model.findings.push_back({Severity::Warning,
                                  "model-faces-skipped",
                                  fmt::format("{}: {} faces with fewer than three corners are "
                                              "skipped",
                                              path,
                                              file.faces_with_too_few_corners)});
    if (file.has_vertex_colors)
        model.findings.push_back({Severity::Info,
                                  "model-vertex-colors-ignored",
                                  fmt::format("{}: vertex colours are not used", path)});
    if (!file.ignored_statements.empty())
        model.findings.push_back(
            {Severity::Info,
             "model-primitives-skipped",
             fmt::format(
                 "{}: statements not used: {}", path, fmt::join(file.ignored_statements, ", "))});
}

// Faces name their material by its place in `usemtl` order; only those that occur are kept.
void addMaterials(Model& model, const ObjFile& file, const fs::path& path)
{
    const MtlLibrary library = readLibraries(file, path, model.findings);
    const std::set<std::uint32_t> used(model.mesh.material_of.begin(),
                                       model.mesh.material_of.end());
    std::vector<std::uint32_t> kept(file.material_names.size(), 0);
    std::map<std::string, int> texture_of_name;
    for (const std::uint32_t material : used) {
        kept[material] = static_cast<std::uint32_t>(model.materials.size());
        addMaterial(model, file.material_names[material], library, path, texture_of_name);
    }
    for (std::uint32_t& material : model.mesh.material_of)
        material = kept[material];
}

}  // namespace

Model readObj(const fs::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, kMaxModelBytes);
    const ObjFile file =
        parseObj({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path.string());
    Model model;
    MeshBuilder builder(file);
    model.mesh = builder.build();
    addFindings(model, file, path.string());
    if (builder.simplified())
        model.findings.push_back({Severity::Warning,
                                  "model-polygons-simplified",
                                  fmt::format("{}: polygons with very many corners were cut "
                                              "roughly",
                                              path.string())});
    addMaterials(model, file, path);
    return model;
}

}  // namespace insitu
