#include "reconstruct/scene_names.h"

#include "reconstruct/primitive_json.h"
#include "reconstruct/scene_keys.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace insitu {

namespace {

/// Marks may lie outside the picture, but not beyond all reason.
constexpr double kFarthest_px = 1e6;

glm::dvec2 readMark(const JsonNode& node)
{
    const glm::dvec2 pixel = node.vec2();
    if (std::max(std::abs(pixel.x), std::abs(pixel.y)) > kFarthest_px)
        node.fail(fmt::format("[{}, {}] is no place in a picture", pixel.x, pixel.y));
    return pixel;
}

}  // namespace

void SceneNames::add(ScenePrimitive primitive)
{
    names_.push_back(primitive.name);
    primitives_.push_back(std::move(primitive));
}

void SceneNames::check(const JsonNode& list) const
{
    std::set<std::string> seen;
    for (std::size_t i = 0; i < names_.size(); ++i) {
        const JsonNode node = list.at(i).at("name");
        if (names_[i].empty() || names_[i].size() > 64 || names_[i].find('.') != std::string::npos)
            node.fail("must have 1 to 64 characters and no dot, which comes before a part");
        if (!seen.insert(names_[i]).second)
            node.fail(fmt::format("\"{}\" is there twice", names_[i]));
    }
}

void SceneNames::reorder(std::vector<ScenePrimitive> primitives)
{
    primitives_ = std::move(primitives);
    names_.clear();
    for (const ScenePrimitive& primitive : primitives_)
        names_.push_back(primitive.name);
}

std::size_t SceneNames::named(const JsonNode& node, const std::string& name) const
{
    return indexOfName(node, name, names_, "primitive");
}

std::size_t SceneNames::primitive(const JsonNode& node) const
{
    return named(node, node.text());
}

SceneNames::Part SceneNames::part(const JsonNode& node, bool of_faces) const
{
    const std::string text = node.text();
    const std::size_t dot = text.find('.');
    if (dot == std::string::npos)
        node.fail(fmt::format("\"{}\" names no {}: write \"primitive.{}\"",
                              text,
                              of_faces ? "face" : "vertex",
                              of_faces ? "face" : "vertex"));
    const std::size_t index = named(node, text.substr(0, dot));
    const PrimitiveShape& shape = primitives_[index].shape;
    std::vector<std::string> faces;
    if (of_faces)
        for (const PrimitiveFace& face : shape.faces)
            faces.push_back(face.name);
    return {index,
            indexOfName(node,
                        text.substr(dot + 1),
                        of_faces ? faces : shape.vertex_names,
                        of_faces ? "face" : "vertex")};
}

SceneNames::Part SceneNames::face(const JsonNode& node) const
{
    return part(node, true);
}

SceneVertex SceneNames::vertex(const JsonNode& node) const
{
    const Part found = part(node, false);
    return {found.primitive, found.part};
}

void SceneNames::readConstraint(const JsonNode& node, SceneGraph& graph) const
{
    const auto sigma = [&](const char* key, double fallback) {
        return node.has(key) ? node.at(key).positive() : fallback;
    };
    const auto ends = [&](const JsonNode& list) {
        if (list.size() != 2) list.fail(fmt::format("names 2 vertices, not {}", list.size()));
        return std::pair(vertex(list.at(std::size_t{0})), vertex(list.at(std::size_t{1})));
    };
    const auto nameOf = [&](const JsonNode& list) {
        return fmt::format(
            "{} to {}", list.at(std::size_t{0}).text(), list.at(std::size_t{1}).text());
    };
    if (const auto found = node.find("vertex")) {
        node.expectKeys(keys::kVertexConstraint);
        const VertexObservation observation{
            vertex(*found), readMark(node.at("at_px")), sigma("sigma_px", 1.0), found->text()};
        for (const VertexObservation& other : graph.vertices)
            if (other.vertex == observation.vertex && other.pixel == observation.pixel)
                found->fail("is marked there twice");
        graph.vertices.push_back(observation);
    } else if (const auto edge = node.find("edge")) {
        node.expectKeys(keys::kEdgeConstraint);
        const auto [from, to] = ends(*edge);
        if (from.primitive != to.primitive) edge->fail("both ends are of one primitive");
        if (from == to) edge->fail("an edge has two ends");
        EdgeObservation observation{
            from, to, readMark(node.at("from_px")), readMark(node.at("to_px")), 1.0, ""};
        observation.sigma_px = sigma("sigma_px", 1.0);
        observation.name = "edge " + nameOf(*edge);
        if (glm::distance(observation.from_px, observation.to_px) < 1.0)
            node.at("to_px").fail("the marks are less than a pixel apart");
        graph.edges.push_back(observation);
    } else if (const auto length = node.find("length")) {
        node.expectKeys(keys::kLengthConstraint);
        const auto [from, to] = ends(*length);
        if (from == to) length->fail("a length has two ends");
        graph.lengths.push_back({from,
                                 to,
                                 node.at("metres").positive(),
                                 sigma("sigma_m", 0.01),
                                 "length " + nameOf(*length)});
    } else {
        node.fail("must have \"vertex\", \"edge\" or \"length\"");
    }
}

}  // namespace insitu
