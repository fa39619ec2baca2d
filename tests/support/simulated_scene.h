#pragma once

#include "core/random.h"
#include "reconstruct/primitive_library.h"
#include "reconstruct/scene_solve.h"

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace insitu::simulated_scene {

/// Rooms of which everything is known, for tests and benchmarks of the scene graph.

inline ScenePrimitive primitive(const std::string& name,
                                const std::string& shape,
                                const std::vector<double>& parameters,
                                glm::dvec3 position_m,
                                double rotation_y_rad = 0.0)
{
    ScenePrimitive made;
    made.name = name;
    made.shape = builtinPrimitives().at(shape);
    made.solid = made.shape.solid;
    for (const double value : parameters)
        made.parameters.push_back({value, false, {}});
    made.position_m = position_m;
    made.rotation_y_rad = rotation_y_rad;
    return made;
}

inline std::size_t face(const ScenePrimitive& of, const char* name)
{
    return *of.shape.findFace(name);
}
inline void standOn(ScenePrimitive& primitive,
                    const SceneGraph& graph,
                    std::size_t target,
                    const char* face_name)
{
    primitive.height = SceneHeight::OnFace;
    primitive.support = target;
    primitive.support_face = face(graph.primitives[target], face_name);
}
inline void touch(ScenePrimitive& primitive,
                  const char* own_face,
                  const SceneGraph& graph,
                  std::size_t target,
                  const char* target_face,
                  double gap_m = 0.0,
                  bool flush = false)
{
    primitive.contacts.push_back({face(primitive, own_face),
                                  target,
                                  face(graph.primitives[target], target_face),
                                  flush,
                                  gap_m});
}

/// A room of 4.6 x 2.6 x 5.2 m with a cupboard in its corner, a shelf beside it, a turned table
/// with a lamp on it and a wedge before the wall; its walls are turned by 5 degrees.
inline SceneGraph furnishedRoom()
{
    SceneGraph graph;
    auto add = [&](ScenePrimitive made) { graph.primitives.push_back(std::move(made)); };
    add(primitive("room", "room-box", {4.6, 2.6, 5.2}, {0.2, 0, -0.4}, 0.0872664626));

    graph.primitives[0].parameters[2].fixed = true;  // the wall behind the camera is not seen

    ScenePrimitive cupboard = primitive("cupboard", "box", {0.9, 1.9, 0.6}, {-1.5, 0, -2.6});
    standOn(cupboard, graph, 0, "floor");
    touch(cupboard, "back", graph, 0, "back", 0.02);
    touch(cupboard, "left", graph, 0, "left");
    add(cupboard);

    ScenePrimitive shelf = primitive("shelf", "box", {0.7, 1.2, 0.35}, {-0.6, 0, -2.7});
    standOn(shelf, graph, 0, "floor");
    touch(shelf, "left", graph, 1, "right");
    touch(shelf, "front", graph, 1, "front", 0.0, true);
    add(shelf);

    ScenePrimitive table = primitive("table", "box", {1.2, 0.75, 0.8}, {0.6, 0, -1.2}, 0.4);
    standOn(table, graph, 0, "floor");
    add(table);

    ScenePrimitive lamp = primitive("lamp", "cylinder", {0.12, 0.4}, {0.7, 0.75, -1.1}, 0.4);
    standOn(lamp, graph, 3, "top");
    lamp.aligned = SceneAlignment{3, 0.0};
    add(lamp);

    ScenePrimitive ramp = primitive("ramp", "wedge", {0.8, 0.5, 0.9}, {1.4, 0, -2.3});
    standOn(ramp, graph, 0, "floor");
    touch(ramp, "back", graph, 0, "back");
    add(ramp);
    return graph;
}

inline Camera camera(int width = 1200, int height = 800)
{
    return Camera::lookAt({0.9, 1.5, 2.0}, {0.0, 0.8, -2.0}, 0.75 * width, width, height);
}

inline double gauss(RandomStream& random)
{
    const double u = std::max(random.uniformDouble(), 1e-300);
    return std::sqrt(-2.0 * std::log(u)) *
           std::cos(2.0 * std::numbers::pi * random.uniformDouble());
}

/// Where the graph's contacts put everything, its observations aside.
inline std::vector<SolvedPrimitive> placedByContacts(const SceneGraph& graph, const Camera& camera)
{
    SceneGraph bare = graph;
    bare.vertices.clear();
    bare.edges.clear();
    bare.lengths.clear();
    return SceneSolver(bare, camera).primitives();
}

inline glm::dvec3 vertexOf(const SceneGraph& graph,
                           const std::vector<SolvedPrimitive>& solved,
                           SceneVertex which)
{
    const SolvedPrimitive& p = solved[which.primitive];
    std::vector<double> values;
    for (const SolvedNumber& number : p.parameters)
        values.push_back(number.value);
    const glm::dvec3 position(p.position_m[0].value, p.position_m[1].value, p.position_m[2].value);
    return position + rotatedY(graph.primitives[which.primitive].shape.vertex(which.vertex, values),
                               p.rotation_y_rad.value);
}

/// Every `stride`-th vertex that is in the picture, seen with this noise.
inline void observe(SceneGraph& graph,
                    const Camera& camera,
                    double sigma_px,
                    RandomStream& random,
                    std::size_t stride = 1)
{
    const std::vector<SolvedPrimitive> truth = placedByContacts(graph, camera);
    for (std::size_t p = 0; p < graph.primitives.size(); ++p) {
        const ScenePrimitive& of = graph.primitives[p];
        const std::size_t step = of.shape.vertices.size() > 8 ? 6 : stride;
        for (std::size_t v = 0; v < of.shape.vertices.size(); v += step) {
            const auto pixel = camera.project(vertexOf(graph, truth, {p, v}));
            if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > camera.width ||
                pixel->y > camera.height)
                continue;
            const glm::dvec2 noise(gauss(random), gauss(random));
            graph.vertices.push_back({{p, v},
                                      *pixel + sigma_px * noise,
                                      std::max(sigma_px, 0.01),
                                      of.name + "." + of.shape.vertex_names[v]});
        }
    }
}

/// The same graph with every free number off by up to this share or as many metres.
inline SceneGraph disturbed(const SceneGraph& graph, double amount, RandomStream& random)
{
    SceneGraph result = graph;
    for (ScenePrimitive& p : result.primitives) {
        for (SceneNumber& number : p.parameters)
            if (!number.fixed && !number.sigma)
                number.value *= 1.0 + amount * (2.0 * random.uniformDouble() - 1.0);
        for (int axis : {0, 2})
            p.position_m[axis] += amount * (2.0 * random.uniformDouble() - 1.0);
        if (!p.rotation_fixed)
            p.rotation_y_rad += 0.5 * amount * (2.0 * random.uniformDouble() - 1.0);
    }
    return result;
}

}  // namespace insitu::simulated_scene
