#include "core/io/json.h"
#include "pipeline/project_json.h"
#include "pipeline/project_keys.h"
#include "reconstruct/primitive_json.h"

#include <glm/glm.hpp>

#include <numbers>

namespace insitu {

namespace {

double radians(double degrees)
{
    return degrees * std::numbers::pi / 180.0;
}

}  // namespace

RoomPrimitive readPrimitive(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kPrimitive);
    PrimitiveLibrary own;
    const PrimitiveLibrary* library = &builtinPrimitives();
    if (const auto file = node.find("library")) {
        own = builtinPrimitives();
        addPrimitives(own, existingFile(*file, folder));
        library = &own;
    }
    const PrimitiveShape& shape = findShape(*library, node.at("shape"));
    std::vector<double> values = shape.initialParameters();
    if (const auto parameters = node.find("parameters"))
        for (const auto& [index, value] : namedParameters(*parameters, shape))
            values[index] = readParameterValue(value, shape.parameters[index]);
    const double turn =
        node.has("rotation_y_deg") ? radians(node.at("rotation_y_deg").number()) : 0.0;
    RoomPrimitive primitive;
    primitive.faces = placedFaces(shape, values, node.at("position_m").vec3(), turn);
    primitive.two_sided = shape.two_sided;
    primitive.solid = node.has("solid") ? node.at("solid").boolean() : shape.solid;
    primitive.name = node.has("name") ? node.at("name").text() : shape.name;
    return primitive;
}

RoomPrimitive turnedBox(const RoomBox& box, double rotation_y_deg)
{
    const PrimitiveShape& shape = builtinPrimitives().at(box.solid ? "box" : "room-box");
    const glm::dvec3 size = box.max_m - box.min_m;
    const glm::dvec3 center = 0.5 * (box.min_m + box.max_m);
    // Parameters are width, height, depth; the shape's origin is the centre of its bottom.
    const std::vector<double> values = {size.x, size.y, size.z};
    RoomPrimitive primitive;
    primitive.faces =
        placedFaces(shape, values, {center.x, box.min_m.y, center.z}, radians(rotation_y_deg));
    primitive.solid = box.solid;
    primitive.name = !box.name.empty() ? box.name : box.solid ? "box" : "room";
    return primitive;
}

RoomDescription readRoomOrFile(const JsonNode& node, const std::filesystem::path& folder)
{
    if (!node.value().is_string()) return readRoom(node, folder);
    const std::filesystem::path path = existingFile(node, folder);
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    if (json.is_array()) return readRoom(root, path.parent_path());
    root.expectKeys(keys::kRoomFile);
    return readRoom(root.at("room"), path.parent_path());
}

}  // namespace insitu
