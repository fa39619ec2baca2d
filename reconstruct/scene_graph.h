#pragma once

#include "reconstruct/primitive.h"

#include <glm/glm.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// A number of a primitive: held, or solved from its value on, with what is known beforehand.
struct SceneNumber {
    double value = 0.0;
    bool fixed = false;
    std::optional<double> sigma;  ///< standard deviation of `value` as a prior; > 0
};

/// An upright face that lies in the plane of another primitive's upright face, exactly.
struct SceneContact {
    std::size_t face = 0;
    std::size_t target = 0;  ///< index of the other primitive, below the own
    std::size_t target_face = 0;
    bool flush = false;  ///< false: the faces look at each other and touch; true: the same way
    double gap_m = 0.0;  ///< the own face lies so far in front of the target's
};

/// Turned as another primitive, and by `turn_rad` more, exactly.
struct SceneAlignment {
    std::size_t target = 0;
    double turn_rad = 0.0;
};

/// What keeps a primitive's plane y = 0 at its height.
enum class SceneHeight { Free, Fixed, OnFace };

/// A node of the scene graph. What its hierarchical constraints decide is no unknown: the rest is
/// counted from the primitive it stands on or leans against, so that it follows when that moves.
/// Source: [GibCha03] section 3.
struct ScenePrimitive {
    std::string name;
    PrimitiveShape shape;
    std::vector<SceneNumber> parameters;  ///< one each of the shape's
    glm::dvec3 position_m{0.0};           ///< where the solution begins, or stays
    double rotation_y_rad = 0.0;
    bool position_fixed = false;  ///< x and z, as far as no contact decides them
    bool rotation_fixed = false;
    SceneHeight height = SceneHeight::Fixed;
    std::size_t support = 0;  ///< OnFace: the primitive, below the own, and its level face
    std::size_t support_face = 0;
    double support_gap_m = 0.0;
    std::vector<SceneContact> contacts;  ///< at most one along local x and one along local z
    std::optional<SceneAlignment> aligned;
    bool solid = true;
};

/// A vertex by indices.
struct SceneVertex {
    std::size_t primitive = 0;
    std::size_t vertex = 0;
    friend bool operator==(const SceneVertex&, const SceneVertex&) = default;
};
/// The vertex is seen at this pixel; each coordinate has this standard deviation.
struct VertexObservation {
    SceneVertex vertex;
    glm::dvec2 pixel{0.0};
    double sigma_px = 1.0;
    std::string name;  ///< for reports
};
/// The straight line through two vertices of one primitive passes two marked points, each off by
/// this standard deviation across the line.
struct EdgeObservation {
    SceneVertex from;
    SceneVertex to;
    glm::dvec2 from_px{0.0};
    glm::dvec2 to_px{0.0};
    double sigma_px = 1.0;
    std::string name;
};
/// Two vertices are this far apart.
struct LengthObservation {
    SceneVertex from;
    SceneVertex to;
    double metres = 1.0;
    double sigma_m = 0.01;
    std::string name;
};

/// A room as primitives, what holds between them, and what the photograph shows of them. Targets
/// come before those that refer to them.
struct SceneGraph {
    std::vector<ScenePrimitive> primitives;
    std::vector<VertexObservation> vertices;
    std::vector<EdgeObservation> edges;
    std::vector<LengthObservation> lengths;
};

/// What is wrong with the graph's hierarchical constraints, or nothing: a face that is not level or
/// upright, two contacts along one axis, directions that contradict each other, more than 64
/// unknowns from a primitive up to its last ancestor. Indices out of range are a LogicError.
struct SceneProblem {
    std::size_t primitive = 0;
    std::string cause;
};
[[nodiscard]] std::optional<SceneProblem> sceneProblem(const SceneGraph& graph);

}  // namespace insitu
