#pragma once

#include "core/finding.h"
#include "core/mesh.h"
#include "reconstruct/primitive.h"
#include "reconstruct/ray_scene.h"

#include <glm/glm.hpp>

#include <memory>
#include <string>
#include <vector>

namespace insitu {

/// What a designer says about the room, in metres, world frame (see docs/file_format.md, "room").
struct RoomFloor {
    double height_m = 0.0;
    double half_size_m = 10.0;  ///< a square of this half side around the origin
};
struct RoomPlane {
    glm::dvec3 corner_m{0.0}, edge_u_m{0.0},
        edge_v_m{0.0};  ///< a parallelogram, seen from both sides
};
struct RoomBox {
    glm::dvec3 min_m{0.0}, max_m{0.0};
    bool solid = false;  ///< false: the room itself, seen from inside
    std::string name;
};
struct RoomMesh {
    TriangleMesh mesh;  ///< already placed in the world
    std::string name;
};
/// A primitive (primitive.h) where it stands: flat convex faces.
struct RoomPrimitive {
    std::vector<WorldFace> faces;
    bool two_sided = false;
    bool solid = true;  ///< a stand-in for furniture; false: part of the room itself
    std::string name;
};
struct RoomOpening {
    std::vector<glm::dvec3> corners_m;  ///< convex, planar polygon, >= 3 corners
};
struct RoomDescription {
    std::vector<RoomFloor> floors;
    std::vector<RoomPlane> planes;
    std::vector<RoomBox> boxes;
    std::vector<RoomMesh> meshes;
    std::vector<RoomPrimitive> primitives;
    std::vector<RoomOpening> openings;

    [[nodiscard]] bool empty() const
    {
        return floors.empty() && planes.empty() && boxes.empty() && meshes.empty() &&
               primitives.empty();
    }
};

/// One flat piece of proxy geometry: a parallelogram corner + u·edge_u + v·edge_v, u, v in [0, 1],
/// or its half u + v <= 1 when `triangle`. The normal points to where the surface is seen from.
struct ProxyFace {
    glm::dvec3 corner{0.0}, edge_u{0.0}, edge_v{0.0}, normal{0.0};
    bool triangle = false;
    bool two_sided = false;
    bool solid = false;  ///< of a solid: a stand-in for furniture, which may have gaps
    /// Which body it belongs to: index in RoomDescription::boxes, then in its primitives; or none.
    int box = -1;
    std::string name;
    std::vector<std::size_t> openings;  ///< indices of openings that are cut into this face
};

struct ProxyHit {
    double distance_m = 0.0;
    std::size_t face = 0;
    glm::dvec2 uv{0.0};
    glm::dvec3 point{0.0};
    glm::dvec3 normal{0.0};  ///< unit, towards the ray's origin
    bool opening = false;    ///< the point lies in an opening of the face: beyond it is far away
};

/// The room as surfaces that receive, reflect and occlude light. Ray queries on Embree.
class SceneProxy {
public:
    /// Findings: "opening-off-the-walls" (farther than 0.25 m from every parallel face; ignored).
    explicit SceneProxy(const RoomDescription& room);

    [[nodiscard]] const std::vector<ProxyFace>& faces() const { return faces_; }
    [[nodiscard]] const std::vector<RoomOpening>& openings() const { return openings_; }
    [[nodiscard]] const Findings& findings() const { return findings_; }
    [[nodiscard]] std::optional<ProxyHit> intersect(glm::dvec3 origin, glm::dvec3 direction) const;
    /// True when the straight way between the points is free of proxy surfaces (ends excluded).
    [[nodiscard]] bool mutuallyVisible(glm::dvec3 a, glm::dvec3 b) const;
    [[nodiscard]] glm::dvec3 pointOn(std::size_t face, glm::dvec2 uv) const;
    [[nodiscard]] double area(std::size_t face) const;
    [[nodiscard]] bool insideOpening(std::size_t face, glm::dvec3 point) const;

private:
    std::vector<ProxyFace> faces_;
    std::vector<glm::dmat2x3> uv_axes_;  ///< of each face: (u, v) of what is relative to its corner
    std::vector<RoomOpening> openings_;
    std::vector<std::size_t> face_of_triangle_;
    TriangleMesh mesh_;
    std::unique_ptr<RayScene> rays_;
    Findings findings_;
};

}  // namespace insitu
