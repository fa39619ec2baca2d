#include "reconstruct/primitive_library.h"

#include "reconstruct/primitive_json.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

namespace insitu {

namespace {

constexpr std::string_view kFormat = "insitu-primitives";
constexpr int kVersion = 1;
constexpr std::size_t kMaxShapes = 1000;
constexpr std::size_t kMaxParameters = 64;
constexpr std::size_t kMaxVertices = 4096;
constexpr std::size_t kMaxFaces = 4096;
constexpr std::size_t kMaxCorners = 256;

void demandAtMost(const JsonNode& node, std::size_t most, const char* what)
{
    if (node.size() > most)
        node.fail(fmt::format("holds {} {}; at most {} are read", node.size(), what, most));
}

/// Names appear in expressions and after dots: letters, digits, _ and -.
std::string readName(const JsonNode& node, bool for_expression)
{
    const std::string name = node.text();
    const auto allowed = [&](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == '_' || (!for_expression && c == '-');
    };
    const bool starts_well =
        !name.empty() && (!for_expression || !(name[0] >= '0' && name[0] <= '9'));
    if (!starts_well || name.size() > 64 || !std::all_of(name.begin(), name.end(), allowed))
        node.fail(fmt::format("\"{}\" is no name: 1 to 64 letters, digits and _{}",
                              name.substr(0, 64),
                              for_expression ? ", no digit first" : " or -"));
    return name;
}

PrimitiveParameter readParameter(const JsonNode& node)
{
    node.expectKeys({"name", "default", "min", "max"});
    PrimitiveParameter parameter;
    parameter.name = readName(node.at("name"), true);
    parameter.initial = node.at("default").number();
    if (const auto value = node.find("min")) parameter.minimum = value->number();
    if (const auto value = node.find("max")) parameter.maximum = value->number();
    if (!(parameter.minimum < parameter.maximum))
        node.fail(fmt::format("min {} is not below max {}", parameter.minimum, parameter.maximum));
    if (parameter.initial < parameter.minimum || parameter.initial > parameter.maximum)
        node.at("default").fail(fmt::format("is {}; must lie in {} to {}",
                                            parameter.initial,
                                            parameter.minimum,
                                            parameter.maximum));
    return parameter;
}

LinearExpression readExpression(const JsonNode& node, std::span<const std::string> parameters)
{
    if (node.value().is_number())
        return {node.number(), std::vector<double>(parameters.size(), 0.0)};
    try {
        return parseLinearExpression(node.text(), parameters);
    } catch (const std::invalid_argument& error) {
        node.fail(error.what());
    }
}

void readVertex(const JsonNode& node,
                std::span<const std::string> parameters,
                PrimitiveShape& shape)
{
    node.expectKeys({"name", "at"});
    shape.vertex_names.push_back(readName(node.at("name"), false));
    const JsonNode at = node.at("at");
    if (at.size() != 3) at.fail(fmt::format("must have 3 coordinates, not {}", at.size()));
    auto& vertex = shape.vertices.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis)
        vertex[axis] = readExpression(at.at(axis), parameters);
}

PrimitiveFace readFace(const JsonNode& node, const PrimitiveShape& shape)
{
    node.expectKeys({"name", "corners"});
    PrimitiveFace face;
    face.name = readName(node.at("name"), false);
    const JsonNode corners = node.at("corners");
    demandAtMost(corners, kMaxCorners, "corners");
    for (std::size_t i = 0; i < corners.size(); ++i)
        face.corners.push_back(
            indexOfName(corners.at(i), corners.at(i).text(), shape.vertex_names, "vertex"));
    if (std::set(face.corners.begin(), face.corners.end()).size() != face.corners.size())
        corners.fail("names a vertex twice");
    if (face.corners.size() < 3) corners.fail("needs at least three corners");
    return face;
}

template <class Names>
void demandDistinct(const JsonNode& node, const Names& names)
{
    std::set<std::string> seen;
    for (const std::string& name : names)
        if (!seen.insert(name).second) node.fail(fmt::format("\"{}\" is there twice", name));
}

PrimitiveShape readShape(const JsonNode& node)
{
    node.expectKeys({"name", "parameters", "vertices", "faces", "two_sided", "solid", "note"});
    PrimitiveShape shape;
    shape.name = readName(node.at("name"), false);
    std::vector<std::string> names;
    if (const auto parameters = node.find("parameters")) {
        demandAtMost(*parameters, kMaxParameters, "parameters");
        for (std::size_t i = 0; i < parameters->size(); ++i) {
            shape.parameters.push_back(readParameter(parameters->at(i)));
            names.push_back(shape.parameters.back().name);
        }
        demandDistinct(*parameters, names);
    }
    const JsonNode vertices = node.at("vertices");
    demandAtMost(vertices, kMaxVertices, "vertices");
    for (std::size_t i = 0; i < vertices.size(); ++i)
        readVertex(vertices.at(i), names, shape);
    demandDistinct(vertices, shape.vertex_names);
    const JsonNode faces = node.at("faces");
    demandAtMost(faces, kMaxFaces, "faces");
    if (faces.size() == 0) faces.fail("is empty; a shape has at least one face");
    std::vector<std::string> face_names;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        shape.faces.push_back(readFace(faces.at(i), shape));
        face_names.push_back(shape.faces.back().name);
    }
    demandDistinct(faces, face_names);
    if (const auto value = node.find("two_sided")) shape.two_sided = value->boolean();
    if (const auto value = node.find("solid")) shape.solid = value->boolean();
    if (const auto problem = shapeProblem(shape)) faces.fail(*problem);
    return shape;
}

void addShapes(PrimitiveLibrary& library, const JsonNode& root)
{
    root.expectKeys({"format", "version", "primitives", "note"});
    if (root.at("format").text() != kFormat)
        root.at("format").fail(fmt::format("must be \"{}\"", kFormat));
    if (root.at("version").integer() != kVersion)
        root.at("version").fail(fmt::format("this program reads version {}", kVersion));
    const JsonNode shapes = root.at("primitives");
    demandAtMost(shapes, kMaxShapes, "shapes");
    for (std::size_t i = 0; i < shapes.size(); ++i) {
        PrimitiveShape shape = readShape(shapes.at(i));
        const std::string name = shape.name;
        library.insert_or_assign(name, std::move(shape));
    }
}

}  // namespace

const PrimitiveLibrary& builtinPrimitives()
{
    static const PrimitiveLibrary library = [] {
        PrimitiveLibrary made;
        const Json json = Json::parse(builtinPrimitivesText());
        addShapes(made, JsonNode(json, "built-in primitives"));
        return made;
    }();
    return library;
}

void addPrimitives(PrimitiveLibrary& library, const std::filesystem::path& path)
{
    const Json json = readJson(path);
    addShapes(library, JsonNode(json, path.string()));
}

}  // namespace insitu
