#include "core/io/model_io.h"
#include "pipeline/project_json.h"
#include "pipeline/project_keys.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// Corners of a polygon may leave its plane by this much: positions read off a plan.
constexpr double kFlatnessM = 0.01;
/// Below this area, in square metres, a parallelogram or polygon counts as empty.
constexpr double kMinAreaM2 = 1e-8;

RoomFloor readFloor(const JsonNode& node)
{
    node.expectKeys(keys::kFloor);
    RoomFloor floor;
    if (const auto height = node.find("height_m")) floor.height_m = height->number();
    if (const auto half_size = node.find("half_size_m")) floor.half_size_m = half_size->positive();
    return floor;
}

RoomPlane readPlane(const JsonNode& node)
{
    node.expectKeys(keys::kPlane);
    RoomPlane plane;
    if (const auto corners = node.find("corners_m")) {
        if (node.has("corner_m") || node.has("edge_u_m") || node.has("edge_v_m"))
            node.fail("give either corners_m or corner_m, edge_u_m and edge_v_m, not both");
        const std::vector<glm::dvec3> points = readPolygon(*corners);
        if (points.size() != 4) corners->fail("a plane has four corners");
        plane = {points[0], points[1] - points[0], points[3] - points[0]};
        const double gap = glm::distance(points[2], points[0] + plane.edge_u_m + plane.edge_v_m);
        if (gap > kFlatnessM)
            corners->fail(
                fmt::format("the four corners are no parallelogram: the third is {:.3f} m "
                            "off; use a mesh for other shapes",
                            gap));
    } else {
        plane.corner_m = node.at("corner_m").vec3();
        plane.edge_u_m = node.at("edge_u_m").vec3();
        plane.edge_v_m = node.at("edge_v_m").vec3();
    }
    if (glm::length(glm::cross(plane.edge_u_m, plane.edge_v_m)) < kMinAreaM2)
        node.fail("the plane has no area: its edges are parallel or of length 0");
    return plane;
}

RoomMesh readMesh(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kMesh);
    const ProjectObject object = readPlacedModel(node, folder);
    RoomMesh mesh;
    mesh.name = node.has("name") ? node.at("name").text() : object.model.stem().string();
    const Model model = readModel(object.model);
    mesh.mesh = placed(model.mesh, placementOf(object, model.mesh));
    return mesh;
}

RoomOpening readOpening(const JsonNode& node)
{
    node.expectKeys(keys::kOpening);
    return RoomOpening{readPolygon(node.at("corners_m"))};
}

}  // namespace

double readFraction(const JsonNode& node)
{
    const double value = node.number();
    if (value < 0.0 || value > 1.0) node.fail(fmt::format("is {}; must lie in 0 to 1", value));
    return value;
}

std::string readChoice(const JsonNode& node, std::initializer_list<std::string_view> choices)
{
    const std::string text = node.text();
    if (std::find(choices.begin(), choices.end(), text) != choices.end()) return text;
    std::string list;
    for (const std::string_view choice : choices)
        list += fmt::format("{}\"{}\"", list.empty() ? "" : ", ", choice);
    const auto meant = didYouMean(text, choices);
    node.fail(fmt::format("\"{}\" is none of {}{}",
                          text,
                          list,
                          meant ? fmt::format("; did you mean \"{}\"?", *meant) : ""));
}

std::filesystem::path existingFile(const JsonNode& node, const std::filesystem::path& folder)
{
    const std::string name = node.text();
    const std::filesystem::path path = (folder / name).lexically_normal();
    std::error_code error;
    if (name.empty() || !std::filesystem::is_regular_file(path, error))
        node.fail(
            fmt::format("no file \"{}\" (looked for {}); paths are relative to the folder of "
                        "the file that names them",
                        name,
                        path.string()));
    return path;
}

std::vector<glm::dvec3> readPolygon(const JsonNode& node)
{
    std::vector<glm::dvec3> corners;
    for (std::size_t i = 0; i < node.size(); ++i)
        corners.push_back(node.at(i).vec3());
    if (corners.size() < 3) node.fail("needs at least three corners");

    // Newell's normal: twice the area of the polygon, also when the first corners are in a line.
    glm::dvec3 normal{0.0};
    const std::size_t n = corners.size();
    for (std::size_t i = 0; i < n; ++i)
        normal += glm::cross(corners[i] - corners[0], corners[(i + 1) % n] - corners[0]);
    if (glm::length(normal) < 2.0 * kMinAreaM2) node.fail("the corners enclose no area");
    normal = glm::normalize(normal);
    for (std::size_t i = 0; i < n; ++i) {
        const double off = std::abs(glm::dot(corners[i] - corners[0], normal));
        if (off > kFlatnessM)
            node.at(i).fail(fmt::format("lies {:.3f} m off the plane of the other corners", off));
        const glm::dvec3 in = corners[i] - corners[(i + n - 1) % n];
        const glm::dvec3 out = corners[(i + 1) % n] - corners[i];
        if (glm::dot(glm::cross(in, out), normal) < -kMinAreaM2)
            node.at(i).fail("the polygon is not convex here, or its corners are out of order");
    }
    return corners;
}

RoomBox readBox(const JsonNode& node)
{
    RoomBox box;
    box.min_m = node.at("min_m").vec3();
    box.max_m = node.at("max_m").vec3();
    for (int axis = 0; axis < 3; ++axis)
        if (!(box.min_m[axis] < box.max_m[axis]))
            node.at("min_m").fail(fmt::format("min_m {} is not below max_m {} in {}",
                                              box.min_m[axis],
                                              box.max_m[axis],
                                              "xyz"[axis]));
    if (const auto solid = node.find("solid")) box.solid = solid->boolean();
    if (const auto name = node.find("name")) box.name = name->text();
    return box;
}

RoomDescription readRoom(const JsonNode& node, const std::filesystem::path& folder)
{
    RoomDescription room;
    for (std::size_t i = 0; i < node.size(); ++i) {
        const JsonNode item = node.at(i);
        const std::string type =
            readChoice(item.at("type"), {"floor", "plane", "box", "primitive", "mesh", "opening"});
        if (type == "floor") room.floors.push_back(readFloor(item));
        if (type == "plane") room.planes.push_back(readPlane(item));
        if (type == "mesh") room.meshes.push_back(readMesh(item, folder));
        if (type == "opening") room.openings.push_back(readOpening(item));
        if (type == "box") {
            item.expectKeys(keys::kBox);
            const double turn =
                item.has("rotation_y_deg") ? item.at("rotation_y_deg").number() : 0.0;
            if (turn == 0.0)
                room.boxes.push_back(readBox(item));
            else
                room.primitives.push_back(turnedBox(readBox(item), turn));
        }
        if (type == "primitive") room.primitives.push_back(readPrimitive(item, folder));
    }
    if (room.empty())
        node.fail("names no surface; give at least {\"type\": \"floor\"} or the room's box");
    return room;
}

Material readMaterial(const JsonNode& node)
{
    node.expectKeys(keys::kMaterial);
    Material material;
    material.name = "project";
    const JsonNode color = node.at("base_color_linear");
    material.base_color = glm::vec3(color.vec3());
    for (std::size_t c = 0; c < 3; ++c)
        (void)readFraction(color.at(c));
    if (const auto value = node.find("roughness"))
        material.roughness = static_cast<float>(readFraction(*value));
    if (const auto value = node.find("metallic"))
        material.metallic = static_cast<float>(readFraction(*value));
    if (const auto value = node.find("specular"))
        material.specular = static_cast<float>(readFraction(*value));
    return material;
}

ProjectObject readPlacedModel(const JsonNode& node, const std::filesystem::path& folder)
{
    ProjectObject object;
    object.model = existingFile(node.at("model"), folder);
    if (const auto pivot = node.find("pivot"))
        object.pivot_bottom_center =
            readChoice(*pivot, {"bottom-center", "origin"}) == "bottom-center";
    if (const auto position = node.find("position_m")) object.position_m = position->vec3();
    if (const auto rotation = node.find("rotation_y_deg"))
        object.rotation_y_deg = rotation->number();
    if (const auto scale = node.find("scale")) object.scale = scale->positive();
    return object;
}

ProjectObject readObject(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kObject);
    ProjectObject object = readPlacedModel(node, folder);
    if (const auto material = node.find("material")) object.material = readMaterial(*material);
    return object;
}

Placement placementOf(const ProjectObject& object, const TriangleMesh& mesh)
{
    Placement placement;
    if (object.pivot_bottom_center) placement.pivot_in_model = bottomCenter(boundingBox(mesh));
    placement.scale = object.scale;
    placement.rotation_y_rad = object.rotation_y_deg * std::numbers::pi / 180.0;
    placement.position_m = object.position_m;
    return placement;
}

PlacedModel loadObject(const ProjectObject& object)
{
    Model model = readModel(object.model);
    if (object.material) {
        model.materials = {*object.material};
        model.textures.clear();
        std::fill(model.mesh.material_of.begin(), model.mesh.material_of.end(), 0u);
    }
    const Placement placement = placementOf(object, model.mesh);
    return {std::move(model), placement};
}

}  // namespace insitu
