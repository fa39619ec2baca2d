#pragma once

#include "core/mesh.h"
#include "reconstruct/linear_expression.h"

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// A number that gives a primitive its form. The unit is part of the name: `_m` is metres, any
/// other name has no unit.
struct PrimitiveParameter {
    std::string name;
    double initial = 1.0;
    double minimum = 1e-3;
    double maximum = 1e3;
};

/// A flat convex face: corners by index, counter-clockwise seen from where the face is seen.
struct PrimitiveFace {
    std::string name;
    std::vector<std::size_t> corners;
};

/// A kind of shape: vertices that are linear in named parameters, and faces between them.
///
/// Local frame: x right, y up, z towards the viewer; the shape stands on its plane y = 0 and is
/// turned about its own Y axis. See docs/file_format.md, "Primitives", for the file form.
/// Source: [GibCha03] section 3, the user-extensible library of shapes.
struct PrimitiveShape {
    std::string name;
    std::vector<PrimitiveParameter> parameters;
    std::vector<std::string> vertex_names;
    std::vector<std::array<LinearExpression, 3>> vertices;
    std::vector<PrimitiveFace> faces;
    bool two_sided = false;  ///< the faces are seen from both sides
    bool solid = true;       ///< a stand-in for furniture, as RoomBox::solid

    [[nodiscard]] std::vector<double> initialParameters() const;
    [[nodiscard]] glm::dvec3 vertex(std::size_t index, std::span<const double> parameters) const;
    [[nodiscard]] std::optional<std::size_t> findParameter(std::string_view wanted) const;
    [[nodiscard]] std::optional<std::size_t> findVertex(std::string_view wanted) const;
    [[nodiscard]] std::optional<std::size_t> findFace(std::string_view wanted) const;
};

/// A face that stays in a plane across one local axis whatever the parameters: what may stand on,
/// lean against or be aligned with others.
struct AxisPlane {
    int axis = 0;             ///< 0, 1, 2: local x, y, z
    int sign = 1;             ///< the face is seen from this side of the axis
    LinearExpression offset;  ///< coordinate of the plane along the axis
};
/// The plane of a face, or nothing when it is oblique or depends on the parameters otherwise.
[[nodiscard]] std::optional<AxisPlane> axisPlane(const PrimitiveShape& shape, std::size_t face);

/// Says what is wrong with a shape's geometry, or nothing: a face that is not flat or not convex or
/// has no area, for the initial parameters or any of a few others.
[[nodiscard]] std::optional<std::string> shapeProblem(const PrimitiveShape& shape);

/// A shape of which the only parameter is `scale`: the mesh's vertices times it, its triangles as
/// faces, seen from both sides.
[[nodiscard]] PrimitiveShape shapeFromMesh(const TriangleMesh& mesh, const std::string& name);

/// A flat polygon of a primitive in the world, corners as PrimitiveFace.
struct WorldFace {
    std::vector<glm::dvec3> corners_m;
    std::string name;
};
/// x_in_world = position + R_y(rotation) x_in_primitive. One value a parameter.
[[nodiscard]] std::vector<WorldFace> placedFaces(const PrimitiveShape& shape,
                                                 std::span<const double> parameters,
                                                 glm::dvec3 position_m,
                                                 double rotation_y_rad);
/// R_y(angle): counter-clockwise seen from above.
[[nodiscard]] glm::dvec3 rotatedY(glm::dvec3 v, double angle_rad);

}  // namespace insitu
