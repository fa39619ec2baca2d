#pragma once

#include "core/io/json.h"
#include "reconstruct/scene_graph.h"

#include <map>
#include <string>
#include <vector>

namespace insitu {

/// The primitives of a scene file by name, and what refers to them: "table", "table.top". Private
/// to this module; all throw InputError with file, position, cause and remedy.
class SceneNames {
public:
    /// A vertex or a face of a primitive, by indices.
    struct Part {
        std::size_t primitive = 0;
        std::size_t part = 0;
    };

    void add(ScenePrimitive primitive);
    /// Names must be distinct, not empty and without dots.
    void check(const JsonNode& list) const;
    [[nodiscard]] std::vector<ScenePrimitive>& primitives() { return primitives_; }
    [[nodiscard]] const std::vector<ScenePrimitive>& primitives() const { return primitives_; }
    /// From now on indices are those of this order.
    void reorder(std::vector<ScenePrimitive> primitives);

    [[nodiscard]] std::size_t primitive(const JsonNode& node) const;
    [[nodiscard]] Part face(const JsonNode& node) const;
    [[nodiscard]] SceneVertex vertex(const JsonNode& node) const;
    /// One entry of `constraints`, added to the graph.
    void readConstraint(const JsonNode& node, SceneGraph& graph) const;

private:
    [[nodiscard]] Part part(const JsonNode& node, bool of_faces) const;
    [[nodiscard]] std::size_t named(const JsonNode& node, const std::string& name) const;

    std::vector<ScenePrimitive> primitives_;
    std::vector<std::string> names_;
};

}  // namespace insitu
