#include "reconstruct/primitive_library.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace insitu {

namespace {

struct Parameter {
    const char* name;
    double initial;
};

/// Coordinates are linear expressions of the parameters, as in a library file.
struct Vertex {
    std::string name, x, y, z;
};

/// Corners counter-clockwise as seen from the side that shows.
struct Face {
    std::string name;
    std::vector<std::string> corners;
};

struct Shape {
    const char* name;
    const char* note;
    std::vector<Parameter> parameters;
    std::vector<Vertex> vertices;
    std::vector<Face> faces;
    /// Members beside these, with a comma after each.
    const char* more = "";
};

/// A shape in the form of docs/file_format.md, one vertex and one face a line.
std::string shapeText(const Shape& shape)
{
    std::vector<std::string> parameters;
    std::vector<std::string> vertices;
    std::vector<std::string> faces;
    for (const Parameter& p : shape.parameters)
        parameters.push_back(fmt::format(R"({{"name": "{}", "default": {}}})", p.name, p.initial));
    for (const Vertex& v : shape.vertices)
        vertices.push_back(
            fmt::format(R"({{"name": "{}", "at": ["{}", "{}", "{}"]}})", v.name, v.x, v.y, v.z));
    for (const Face& f : shape.faces)
        faces.push_back(fmt::format(
            R"({{"name": "{}", "corners": ["{}"]}})", f.name, fmt::join(f.corners, R"(", ")")));
    return fmt::format(R"(    {{"name": "{}", "note": "{}",
     "parameters": [{}],
     "vertices": [
       {}],
     {}"faces": [
       {}]}})",
                       shape.name,
                       shape.note,
                       fmt::join(parameters, ", "),
                       fmt::join(vertices, ",\n       "),
                       shape.more,
                       fmt::join(faces, ",\n       "));
}

constexpr const char* kSurface = "\"two_sided\": true, \"solid\": false,\n     ";
constexpr const char* kInside = "\"solid\": false,\n     ";

const std::vector<Parameter> kUnitBox{{"width_m", 1}, {"height_m", 1}, {"depth_m", 1}};

/// A rectangle's corners about the middle of its lower edge or, lying, about its own.
std::vector<Vertex> base(const std::string& name, const std::string& y)
{
    return {{name + "back_left", "-width_m/2", y, "-depth_m/2"},
            {name + "back_right", "width_m/2", y, "-depth_m/2"},
            {name + "front_left", "-width_m/2", y, "depth_m/2"},
            {name + "front_right", "width_m/2", y, "depth_m/2"}};
}

std::vector<Vertex> boxVertices()
{
    std::vector<Vertex> vertices = base("bottom_", "0");
    for (Vertex& vertex : base("top_", "height_m"))
        vertices.push_back(std::move(vertex));
    return vertices;
}

const std::vector<Face> kBoxFaces{
    {"bottom",
     {"bottom_back_left", "bottom_back_right", "bottom_front_right", "bottom_front_left"}},
    {"top", {"top_back_left", "top_front_left", "top_front_right", "top_back_right"}},
    {"back", {"bottom_back_left", "top_back_left", "top_back_right", "bottom_back_right"}},
    {"front", {"bottom_front_left", "bottom_front_right", "top_front_right", "top_front_left"}},
    {"left", {"bottom_back_left", "bottom_front_left", "top_front_left", "top_back_left"}},
    {"right", {"bottom_back_right", "top_back_right", "top_front_right", "bottom_front_right"}}};

Shape roomBox()
{
    std::vector<Face> faces = kBoxFaces;
    for (Face& face : faces)
        std::reverse(face.corners.begin(), face.corners.end());
    faces[0].name = "floor";
    faces[1].name = "ceiling";
    return {"room-box",
            "the room, seen from inside",
            {{"width_m", 4}, {"height_m", 2.5}, {"depth_m", 5}},
            boxVertices(),
            faces,
            kInside};
}

Shape wedge()
{
    std::vector<Vertex> vertices = base("bottom_", "0");
    vertices.push_back({"top_left", "-width_m/2", "height_m", "-depth_m/2"});
    vertices.push_back({"top_right", "width_m/2", "height_m", "-depth_m/2"});
    return {"wedge",
            "slopes from the top of its back down to the front",
            kUnitBox,
            vertices,
            {kBoxFaces[0],
             {"back", {"bottom_back_left", "top_left", "top_right", "bottom_back_right"}},
             {"slope", {"bottom_front_left", "bottom_front_right", "top_right", "top_left"}},
             {"left", {"bottom_back_left", "bottom_front_left", "top_left"}},
             {"right", {"bottom_back_right", "top_right", "bottom_front_right"}}}};
}

Shape cylinder()
{
    constexpr int kSides = 24;
    Shape shape{"cylinder",
                "upright, with 24 sides; its corners lie on the circle",
                {{"radius_m", 0.5}, {"height_m", 1}},
                {},
                {{"bottom", {}}, {"top", {}}}};
    const auto name = [](const char* ring, int i) {
        return fmt::format("{}_{}", ring, i % kSides);
    };
    for (const auto& [ring, y] : {std::pair{"bottom", "0"}, std::pair{"top", "height_m"}})
        for (int i = 0; i < kSides; ++i) {
            const double angle = 2.0 * std::numbers::pi * i / kSides;
            // Rounded, so that a quarter turn is 0; + 0.0 takes the sign off it.
            const auto share = [](double s) {
                return fmt::format("{:.15g}*radius_m", std::round(s * 1e15) / 1e15 + 0.0);
            };
            shape.vertices.push_back(
                {name(ring, i), share(std::cos(angle)), y, share(std::sin(angle))});
        }
    for (int i = 0; i < kSides; ++i) {
        shape.faces[0].corners.push_back(name("bottom", i));
        shape.faces[1].corners.push_back(name("top", kSides - 1 - i));
        shape.faces.push_back(
            {fmt::format("side_{}", i),
             {name("bottom", i), name("top", i), name("top", i + 1), name("bottom", i + 1)}});
    }
    return shape;
}

}  // namespace

const std::string& builtinPrimitivesText()
{
    static const std::string text = [] {
        const Shape plane{"plane",
                          "a horizontal rectangle",
                          {{"width_m", 2}, {"depth_m", 2}},
                          base("", "0"),
                          {{"top", {"back_left", "front_left", "front_right", "back_right"}}},
                          kSurface};
        const Shape panel{"panel",
                          "an upright rectangle",
                          {{"width_m", 2}, {"height_m", 2}},
                          {{"bottom_left", "-width_m/2", "0", "0"},
                           {"bottom_right", "width_m/2", "0", "0"},
                           {"top_left", "-width_m/2", "height_m", "0"},
                           {"top_right", "width_m/2", "height_m", "0"}},
                          {{"front", {"bottom_left", "bottom_right", "top_right", "top_left"}}},
                          kSurface};
        const Shape box{"box", "seen from outside", kUnitBox, boxVertices(), kBoxFaces};
        std::vector<std::string> shapes;
        for (const Shape& shape : {plane, panel, box, roomBox(), wedge(), cylinder()})
            shapes.push_back(shapeText(shape));
        return fmt::format(
            "{{\"format\": \"insitu-primitives\", \"version\": 1,\n"
            "  \"primitives\": [\n{}]}}\n",
            fmt::join(shapes, ",\n"));
    }();
    return text;
}

}  // namespace insitu
