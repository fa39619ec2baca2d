#include "core/io/json.h"
#include "reconstruct/scene_file.h"

#include <cmath>
#include <numbers>

namespace insitu {

namespace {

/// Turned by less than this, radians, a box is axis-aligned.
constexpr double kAligned = 1e-9;

double degrees(double radians)
{
    return radians * 180.0 / std::numbers::pi;
}
double turnOf(const SolvedPrimitive& solved)
{
    return std::remainder(solved.rotation_y_rad.value, 2.0 * std::numbers::pi);
}
glm::dvec3 positionOf(const SolvedPrimitive& solved)
{
    return {solved.position_m[0].value, solved.position_m[1].value, solved.position_m[2].value};
}
Json sigmaJson(const std::optional<double>& sigma, double factor = 1.0)
{
    return sigma ? Json(factor * *sigma) : Json();
}

/// A box or a room of the built-in shapes that is not turned, as projects have always had it.
Json boxItem(const ScenePrimitive& primitive, const SolvedPrimitive& solved)
{
    const glm::dvec3 size(
        solved.parameters[0].value, solved.parameters[1].value, solved.parameters[2].value);
    const glm::dvec3 position = positionOf(solved);
    const glm::dvec3 low(position.x - 0.5 * size.x, position.y, position.z - 0.5 * size.z);
    Json item = {{"type", "box"}, {"name", primitive.name}};
    item["min_m"] = toJson(low);
    item["max_m"] = toJson(low + size);
    item["solid"] = primitive.solid;
    return item;
}

Json roomItem(const ScenePrimitive& primitive,
              const ShapeSource& source,
              const SolvedPrimitive& solved,
              const std::filesystem::path& folder)
{
    const bool built_in = source.library.empty() && source.model.empty();
    const bool upright_box = built_in && std::abs(turnOf(solved)) < kAligned &&
                             ((primitive.shape.name == "box" && primitive.solid) ||
                              (primitive.shape.name == "room-box" && !primitive.solid));
    if (upright_box) return boxItem(primitive, solved);
    const auto relative = [&](const std::filesystem::path& path) {
        return path.lexically_relative(folder).generic_string();
    };
    Json item = {{"type", source.model.empty() ? "primitive" : "mesh"}, {"name", primitive.name}};
    if (source.model.empty()) {
        item["shape"] = primitive.shape.name;
        if (!source.library.empty()) item["library"] = relative(source.library);
        item["solid"] = primitive.solid;
        for (std::size_t i = 0; i < solved.parameters.size(); ++i)
            item["parameters"][primitive.shape.parameters[i].name] = solved.parameters[i].value;
    } else {
        item["model"] = relative(source.model);
        item["scale"] = solved.parameters[0].value;
    }
    item["position_m"] = toJson(positionOf(solved));
    item["rotation_y_deg"] = degrees(turnOf(solved));
    return item;
}

Json primitiveJson(const ScenePrimitive& primitive, const SolvedPrimitive& solved)
{
    Json json = {{"name", primitive.name}, {"shape", primitive.shape.name}};
    for (std::size_t i = 0; i < solved.parameters.size(); ++i) {
        const std::string& name = primitive.shape.parameters[i].name;
        json["parameters"][name] = {{"value", solved.parameters[i].value},
                                    {"sigma", sigmaJson(solved.parameters[i].sigma)}};
    }
    json["position_m"] = toJson(positionOf(solved));
    json["position_m_sigma"] = Json::array();
    for (const SolvedNumber& number : solved.position_m)
        json["position_m_sigma"].push_back(sigmaJson(number.sigma));
    json["rotation_y_deg"] = degrees(turnOf(solved));
    json["rotation_y_deg_sigma"] = sigmaJson(solved.rotation_y_rad.sigma, degrees(1.0));
    return json;
}

}  // namespace

void writeReconstruction(const std::filesystem::path& path,
                         const SceneFile& scene,
                         const SceneEstimate& estimate)
{
    const std::filesystem::path folder =
        std::filesystem::absolute(path).lexically_normal().parent_path();
    Json room = Json::array();
    Json primitives = Json::array();
    for (std::size_t i = 0; i < scene.graph.primitives.size(); ++i) {
        const ScenePrimitive& primitive = scene.graph.primitives[i];
        room.push_back(roomItem(primitive, scene.sources[i], estimate.primitives[i], folder));
        primitives.push_back(primitiveJson(primitive, estimate.primitives[i]));
    }
    if (!scene.room_items.empty())
        for (const Json& item : Json::parse(scene.room_items))
            room.push_back(item);
    Json constraints = Json::array();
    for (const ConstraintFit& fit : estimate.constraints)
        constraints.push_back({{"name", fit.name},
                               {"residual", fit.residual},
                               {"sigmas", fit.sigmas},
                               {"redundancy", fit.redundancy}});
    const Json json = {{"format", "insitu-reconstruction"},
                       {"version", 1},
                       {"room", room},
                       {"primitives", primitives},
                       {"constraints", constraints},
                       {"summary",
                        {{"unknowns", estimate.unknowns},
                         {"redundancy", estimate.redundancy},
                         {"variance_factor", estimate.variance_factor},
                         {"iterations", estimate.solution.iterations},
                         {"converged", estimate.solution.converged}}},
                       {"findings", toJson(estimate.findings)}};
    writeJson(path, json);
}

}  // namespace insitu
