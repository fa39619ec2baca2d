#include "core/io/gltf_geometry.h"

#include "core/check.h"
#include "core/io/gltf_accessor.h"
#include "core/io/gltf_library.h"
#include "core/io/model_resources.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace insitu {

namespace {

struct Placed {
    int node = 0;
    glm::dmat4 model_from_parent{1.0};
};

glm::dmat4 rotationOf(const std::vector<double>& xyzw)
{
    const double x = xyzw[0], y = xyzw[1], z = xyzw[2], w = xyzw[3];
    const double norm = x * x + y * y + z * z + w * w;
    if (!(norm > 0.0)) return glm::dmat4(1.0);
    const double s = 2.0 / norm;
    glm::dmat4 m(1.0);
    m[0] = {1.0 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y), 0.0};
    m[1] = {s * (x * y - w * z), 1.0 - s * (x * x + z * z), s * (y * z + w * x), 0.0};
    m[2] = {s * (x * z + w * y), s * (y * z - w * x), 1.0 - s * (x * x + y * y), 0.0};
    return m;
}

// glTF 2.0, section 3.5.3: a matrix (column-major), or T * R * S.
glm::dmat4 parentFromNode(const tinygltf::Node& node)
{
    if (node.matrix.size() == 16) {
        glm::dmat4 m(1.0);
        for (int column = 0; column < 4; ++column)
            for (int row = 0; row < 4; ++row)
                m[column][row] = node.matrix[static_cast<std::size_t>(4 * column + row)];
        return m;
    }
    glm::dmat4 m(1.0);
    if (node.rotation.size() == 4) m = rotationOf(node.rotation);
    if (node.scale.size() == 3)
        for (int i = 0; i < 3; ++i)
            m[i] *= node.scale[static_cast<std::size_t>(i)];
    if (node.translation.size() == 3)
        m[3] = {node.translation[0], node.translation[1], node.translation[2], 1.0};
    return m;
}

// The cofactors det(M) * M^-T need no division, hence a squashed axis does no harm; the sign of the
// determinant is taken out, so that a mirrored normal points to the side it is seen from.
glm::dmat3 normalMatrix(const glm::dmat3& m)
{
    const double sign = glm::determinant(m) < 0.0 ? -1.0 : 1.0;
    return {sign * glm::cross(m[1], m[2]),
            sign * glm::cross(m[2], m[0]),
            sign * glm::cross(m[0], m[1])};
}

/// Corner numbers of the triangles of one primitive.
std::vector<glm::uvec3> trianglesOf(int mode, const std::vector<std::uint32_t>& v)
{
    std::vector<glm::uvec3> triangles;
    switch (mode) {
        case TINYGLTF_MODE_TRIANGLES:
            for (std::size_t i = 0; i + 2 < v.size(); i += 3)
                triangles.emplace_back(v[i], v[i + 1], v[i + 2]);
            return triangles;
        case TINYGLTF_MODE_TRIANGLE_STRIP:
            // glTF 2.0, section 3.7.2.1: every other triangle is turned round.
            for (std::size_t i = 0; i + 2 < v.size(); ++i)
                triangles.emplace_back(v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]);
            return triangles;
        case TINYGLTF_MODE_TRIANGLE_FAN:
            for (std::size_t i = 1; i + 1 < v.size(); ++i)
                triangles.emplace_back(v[i], v[i + 1], v[0]);
            return triangles;
        default:
            return triangles;
    }
}

/// One primitive, in its own frame.
struct Part {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;
    std::vector<glm::vec2> texcoords;
    std::vector<glm::uvec3> triangles;
    std::uint32_t material = 0;
};

void flatten(Part& part)
{
    Part flat;
    flat.material = part.material;
    for (const glm::uvec3& triangle : part.triangles) {
        const glm::dvec3 a(part.positions[triangle.x]);
        const glm::dvec3 n = glm::cross(glm::dvec3(part.positions[triangle.y]) - a,
                                        glm::dvec3(part.positions[triangle.z]) - a);
        const double length = glm::length(n);
        const auto first = static_cast<std::uint32_t>(flat.positions.size());
        flat.triangles.emplace_back(first, first + 1, first + 2);
        for (int i = 0; i < 3; ++i) {
            flat.positions.push_back(part.positions[triangle[i]]);
            flat.normals.push_back(length > 0.0 ? glm::vec3(n / length) : glm::vec3(0.0f));
            if (!part.texcoords.empty()) flat.texcoords.push_back(part.texcoords[triangle[i]]);
        }
    }
    part = std::move(flat);
}

class Gatherer {
public:
    Gatherer(const tinygltf::Model& gltf,
             const std::string& path,
             GltfMaterials& materials,
             Model& model)
        : gltf_(gltf), path_(path), materials_(materials), model_(model)
    {
    }

    void gather()
    {
        std::vector<Placed> open;
        for (const int node : rootNodes())
            open.push_back({node, glm::dmat4(1.0)});
        std::vector<bool> visited(gltf_.nodes.size(), false);
        while (!open.empty()) {
            const Placed placed = open.back();
            open.pop_back();
            if (placed.node < 0 || static_cast<std::size_t>(placed.node) >= gltf_.nodes.size())
                throw InputError(path_, fmt::format("node {} does not exist", placed.node));
            const auto index = static_cast<std::size_t>(placed.node);
            if (visited[index])
                throw InputError(
                    path_,
                    fmt::format("node {} has two parents or is its own ancestor", placed.node));
            visited[index] = true;
            const tinygltf::Node& node = gltf_.nodes[index];
            const glm::dmat4 model_from_node = placed.model_from_parent * parentFromNode(node);
            if (node.skin >= 0) has_skin_ = true;
            if (node.mesh >= 0) addMesh(node.mesh, model_from_node);
            for (auto child = node.children.rbegin(); child != node.children.rend(); ++child)
                open.push_back({*child, model_from_node});
        }
        for (const auto& [primitive, model_from_node] : instances_)
            append(readPart(*primitive), model_from_node);
        if (!any_normals_) model_.mesh.normals.clear();
        if (!any_texcoords_) model_.mesh.texcoords.clear();
        report();
    }

private:
    std::vector<int> rootNodes() const
    {
        const int scene = gltf_.defaultScene >= 0 ? gltf_.defaultScene : 0;
        if (static_cast<std::size_t>(scene) < gltf_.scenes.size()) {
            const auto& nodes = gltf_.scenes[static_cast<std::size_t>(scene)].nodes;
            return {nodes.rbegin(), nodes.rend()};
        }
        if (!gltf_.scenes.empty())
            throw InputError(path_, fmt::format("scene {} does not exist", scene));
        std::vector<bool> is_child(gltf_.nodes.size(), false);
        for (const tinygltf::Node& node : gltf_.nodes)
            for (const int child : node.children)
                if (child >= 0 && static_cast<std::size_t>(child) < is_child.size())
                    is_child[static_cast<std::size_t>(child)] = true;
        std::vector<int> roots;
        for (std::size_t i = is_child.size(); i-- > 0;)
            if (!is_child[i]) roots.push_back(static_cast<int>(i));
        return roots;
    }

    void addMesh(int mesh, const glm::dmat4& model_from_node)
    {
        if (static_cast<std::size_t>(mesh) >= gltf_.meshes.size())
            throw InputError(path_, fmt::format("mesh {} does not exist", mesh));
        for (const auto& primitive : gltf_.meshes[static_cast<std::size_t>(mesh)].primitives)
            addPrimitive(primitive, model_from_node);
    }

    // Instances share a mesh, so a small file could ask for any amount: sizes are added up before
    // anything is read.
    void addPrimitive(const tinygltf::Primitive& primitive, const glm::dmat4& model_from_node)
    {
        const int mode = modeOf(primitive);
        const auto positions = primitive.attributes.find("POSITION");
        if (mode < TINYGLTF_MODE_TRIANGLES || mode > TINYGLTF_MODE_TRIANGLE_FAN ||
            positions == primitive.attributes.end()) {
            ++skipped_primitives_;
            return;
        }
        const int corners = primitive.indices >= 0 ? primitive.indices : positions->second;
        vertices_ += accessorCount(gltf_, positions->second, path_);
        corners_ += accessorCount(gltf_, corners, path_);
        checkElementCount(std::max(vertices_, corners_), path_);
        has_colors_ |= primitive.attributes.contains("COLOR_0");
        instances_.emplace_back(&primitive, model_from_node);
    }

    static int modeOf(const tinygltf::Primitive& primitive)
    {
        return primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
    }

    Part readPart(const tinygltf::Primitive& primitive)
    {
        Part part;
        part.positions = readVec3Accessor(gltf_, primitive.attributes.at("POSITION"), path_);
        part.material = materials_.materialOf(primitive.material);
        std::vector<std::uint32_t> corners;
        if (primitive.indices >= 0) {
            corners = readIndexAccessor(gltf_, primitive.indices, path_);
            for (const std::uint32_t corner : corners)
                if (corner >= part.positions.size())
                    throw InputError(path_,
                                     fmt::format("a triangle names vertex {} of {}; the file is "
                                                 "damaged",
                                                 corner,
                                                 part.positions.size()));
        } else {
            corners.resize(part.positions.size());
            for (std::size_t i = 0; i < corners.size(); ++i)
                corners[i] = static_cast<std::uint32_t>(i);
        }
        part.triangles = trianglesOf(modeOf(primitive), corners);

        const auto texcoords = primitive.attributes.find(
            fmt::format("TEXCOORD_{}", materials_.texcoordSetOf(primitive.material)));
        if (texcoords != primitive.attributes.end()) {
            part.texcoords = readTexcoordAccessor(gltf_, texcoords->second, path_);
            requireOneEach(part.texcoords.size(), part.positions.size(), "texture coordinates");
            any_texcoords_ = true;
        }
        const auto normals = primitive.attributes.find("NORMAL");
        if (normals == primitive.attributes.end()) {
            flatten(part);
        } else {
            part.normals = readVec3Accessor(gltf_, normals->second, path_);
            requireOneEach(part.normals.size(), part.positions.size(), "normals");
            any_normals_ = true;
        }
        part.texcoords.resize(part.positions.size(), glm::vec2(0.0f));
        return part;
    }

    void requireOneEach(std::size_t count, std::size_t vertices, const char* what) const
    {
        if (count != vertices)
            throw InputError(path_, fmt::format("{} {} for {} vertices", count, what, vertices));
    }

    void append(const Part& part, const glm::dmat4& model_from_node)
    {
        TriangleMesh& mesh = model_.mesh;
        const glm::dmat3 linear(model_from_node);
        const glm::dmat3 model_from_normal = normalMatrix(linear);
        const bool mirrored = glm::determinant(linear) < 0.0;
        const auto first = static_cast<std::uint32_t>(mesh.positions.size());
        for (const glm::vec3& position : part.positions)
            mesh.positions.emplace_back(glm::dvec3(model_from_node * glm::dvec4(position, 1.0)));
        for (const glm::vec3& stated : part.normals) {
            const glm::dvec3 normal = model_from_normal * glm::dvec3(stated);
            const double before = glm::length(glm::dvec3(stated));
            const double after = glm::length(normal);
            // A stretched normal is ours to mend; one that was not of unit length stays visible
            // to the validator.
            mesh.normals.emplace_back(after > 0.0 ? normal * (before / after) : normal);
        }
        mesh.texcoords.insert(mesh.texcoords.end(), part.texcoords.begin(), part.texcoords.end());
        for (const glm::uvec3& t : part.triangles) {
            mesh.triangles.push_back(first + (mirrored ? glm::uvec3(t.x, t.z, t.y) : t));
            mesh.material_of.push_back(part.material);
        }
    }

    void report()
    {
        const auto note = [&](const char* code, const std::string& message) {
            model_.findings.push_back(
                {Severity::Info, code, fmt::format("{}: {}", path_, message)});
        };
        if (skipped_primitives_ > 0)
            note("model-primitives-skipped",
                 fmt::format("{} parts are points, lines or without positions; they are not drawn",
                             skipped_primitives_));
        if (has_colors_) note("model-vertex-colors-ignored", "vertex colours are not used");
        if (has_skin_)
            note("model-skin-ignored", "its skeleton is not used; it stands in rest pose");
    }

    const tinygltf::Model& gltf_;
    const std::string& path_;
    GltfMaterials& materials_;
    Model& model_;
    std::vector<std::pair<const tinygltf::Primitive*, glm::dmat4>> instances_;
    std::size_t vertices_ = 0;
    std::size_t corners_ = 0;
    std::size_t skipped_primitives_ = 0;
    bool any_normals_ = false;
    bool any_texcoords_ = false;
    bool has_colors_ = false;
    bool has_skin_ = false;
};

}  // namespace

void gatherGltfTriangles(const tinygltf::Model& gltf,
                         const std::string& path,
                         GltfMaterials& materials,
                         Model& model)
{
    Gatherer(gltf, path, materials, model).gather();
}

}  // namespace insitu
