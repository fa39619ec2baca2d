#include "reconstruct/primitive.h"

#include "core/check.h"
#include "core/random.h"

#include <algorithm>
#include <cmath>
#include <ranges>

namespace insitu {

namespace {

/// Below this share of its size a face's corners may leave its plane, its edges turn inwards.
constexpr double kFlatness = 1e-6;

template <class Items, class Name>
std::optional<std::size_t> findByName(const Items& items, std::string_view wanted, Name name)
{
    const auto found = std::find_if(
        items.begin(), items.end(), [&](const auto& item) { return name(item) == wanted; });
    if (found == items.end()) return std::nullopt;
    return static_cast<std::size_t>(found - items.begin());
}

/// Newell's normal: twice the area of the polygon, along its front.
glm::dvec3 polygonNormal(std::span<const glm::dvec3> corners)
{
    glm::dvec3 sum(0.0);
    const std::size_t n = corners.size();
    for (std::size_t i = 0; i < n; ++i)
        sum += glm::cross(corners[i] - corners[0], corners[(i + 1) % n] - corners[0]);
    return sum;
}

std::vector<glm::dvec3> faceCorners(const PrimitiveShape& shape,
                                    const PrimitiveFace& face,
                                    std::span<const double> parameters)
{
    std::vector<glm::dvec3> corners;
    for (const std::size_t corner : face.corners)
        corners.push_back(shape.vertex(corner, parameters));
    return corners;
}

/// What is wrong with a face's polygon, or nothing.
std::optional<std::string> polygonProblem(std::span<const glm::dvec3> corners)
{
    const std::size_t n = corners.size();
    double size = 0.0;
    for (const glm::dvec3& corner : corners)
        size = std::max(size, glm::distance(corner, corners[0]));
    const glm::dvec3 twice_area = polygonNormal(corners);
    if (!(glm::length(twice_area) > kFlatness * size * size)) return "has no area";
    const glm::dvec3 normal = glm::normalize(twice_area);
    for (std::size_t i = 0; i < n; ++i) {
        if (std::abs(glm::dot(corners[i] - corners[0], normal)) > kFlatness * size)
            return "is not flat";
        const glm::dvec3 in = corners[i] - corners[(i + n - 1) % n];
        const glm::dvec3 out = corners[(i + 1) % n] - corners[i];
        if (glm::dot(glm::cross(in, out), normal) < -kFlatness * size * size)
            return "is not convex, or its corners are out of order";
    }
    return std::nullopt;
}

}  // namespace

std::vector<double> PrimitiveShape::initialParameters() const
{
    std::vector<double> values;
    for (const PrimitiveParameter& parameter : parameters)
        values.push_back(parameter.initial);
    return values;
}

glm::dvec3 PrimitiveShape::vertex(std::size_t index, std::span<const double> values) const
{
    const auto& v = vertices[index];
    return {v[0].value(values), v[1].value(values), v[2].value(values)};
}

std::optional<std::size_t> PrimitiveShape::findParameter(std::string_view wanted) const
{
    return findByName(parameters, wanted, [](const PrimitiveParameter& p) { return p.name; });
}
std::optional<std::size_t> PrimitiveShape::findVertex(std::string_view wanted) const
{
    return findByName(vertex_names, wanted, [](const std::string& n) { return n; });
}
std::optional<std::size_t> PrimitiveShape::findFace(std::string_view wanted) const
{
    return findByName(faces, wanted, [](const PrimitiveFace& f) { return f.name; });
}

std::optional<AxisPlane> axisPlane(const PrimitiveShape& shape, std::size_t face)
{
    const std::vector<std::size_t>& corners = shape.faces[face].corners;
    const std::vector<double> initial = shape.initialParameters();
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const LinearExpression& offset = shape.vertices[corners[0]][axis];
        const bool flat = std::all_of(corners.begin(), corners.end(), [&](std::size_t corner) {
            return shape.vertices[corner][axis] == offset;
        });
        if (!flat) continue;
        const glm::dvec3 normal = polygonNormal(faceCorners(shape, shape.faces[face], initial));
        const int a = static_cast<int>(axis);
        return AxisPlane{a, normal[a] > 0.0 ? 1 : -1, offset};
    }
    return std::nullopt;
}

std::optional<std::string> shapeProblem(const PrimitiveShape& shape)
{
    // The initial parameters, and some between a tenth and ten times them.
    constexpr int kTrials = 6;
    std::vector<double> values = shape.initialParameters();
    for (int trial = 0; trial < kTrials; ++trial) {
        for (const PrimitiveFace& face : shape.faces) {
            const auto problem = polygonProblem(faceCorners(shape, face, values));
            if (!problem) continue;
            std::string with;
            for (std::size_t i = 0; i < values.size(); ++i)
                with += fmt::format(
                    "{}{} = {:.4g}", i ? ", " : "", shape.parameters[i].name, values[i]);
            return fmt::format("face \"{}\" {} with {}", face.name, *problem, with);
        }
        RandomStream random(1, static_cast<std::uint64_t>(trial), 0);
        for (std::size_t i = 0; i < values.size(); ++i) {
            const PrimitiveParameter& p = shape.parameters[i];
            const double tried = p.initial * std::pow(10.0, 2.0 * random.uniformDouble() - 1.0);
            values[i] = std::clamp(tried, p.minimum, p.maximum);
        }
    }
    return std::nullopt;
}

PrimitiveShape shapeFromMesh(const TriangleMesh& mesh, const std::string& name)
{
    PrimitiveShape shape;
    shape.name = name;
    shape.parameters = {{"scale", 1.0, 1e-6, 1e6}};
    shape.two_sided = true;
    shape.solid = false;
    for (const glm::vec3& position : mesh.positions) {
        auto& vertex = shape.vertices.emplace_back();
        for (int axis = 0; axis < 3; ++axis)
            vertex[static_cast<std::size_t>(axis)] = {0.0, {static_cast<double>(position[axis])}};
        shape.vertex_names.push_back(fmt::format("{}", shape.vertex_names.size()));
    }
    for (const glm::uvec3& t : mesh.triangles) {
        const glm::dvec3 a(mesh.positions[t.x]);
        const glm::dvec3 area =
            glm::cross(glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a);
        if (glm::length(area) > 0.0)
            shape.faces.push_back({fmt::format("{}", shape.faces.size()), {t.x, t.y, t.z}});
    }
    return shape;
}

std::vector<WorldFace> placedFaces(const PrimitiveShape& shape,
                                   std::span<const double> parameters,
                                   glm::dvec3 position_m,
                                   double rotation_y_rad)
{
    INSITU_CHECK(parameters.size() == shape.parameters.size(),
                 "{}: {} values for {} parameters",
                 shape.name,
                 parameters.size(),
                 shape.parameters.size());
    std::vector<WorldFace> faces;
    for (const PrimitiveFace& face : shape.faces) {
        WorldFace placed{faceCorners(shape, face, parameters), face.name};
        for (glm::dvec3& corner : placed.corners_m)
            corner = position_m + rotatedY(corner, rotation_y_rad);
        faces.push_back(std::move(placed));
    }
    return faces;
}

glm::dvec3 rotatedY(glm::dvec3 v, double angle_rad)
{
    const double c = std::cos(angle_rad);
    const double s = std::sin(angle_rad);
    return {c * v.x + s * v.z, v.y, -s * v.x + c * v.z};
}

}  // namespace insitu
