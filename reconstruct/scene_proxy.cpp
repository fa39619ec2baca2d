#include "reconstruct/scene_proxy.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Openings farther from a wall than this are taken for a mistake.
constexpr double kOpeningReachM = 0.25;
/// A solid's face this close to a room surface is the contact itself and receives nothing.
constexpr double kContactM = 1e-3;

ProxyFace makeFace(glm::dvec3 corner,
                   glm::dvec3 edge_u,
                   glm::dvec3 edge_v,
                   const std::string& name,
                   bool two_sided = false)
{
    ProxyFace face;
    face.corner = corner;
    face.edge_u = edge_u;
    face.edge_v = edge_v;
    face.normal = glm::normalize(glm::cross(edge_u, edge_v));
    face.two_sided = two_sided;
    face.name = name;
    return face;
}

/// The six faces of a box; edge_u × edge_v points outwards for solids and inwards for rooms.
std::vector<ProxyFace> boxFaces(const RoomBox& box)
{
    static constexpr const char* kRoomNames[] = {
        "wall -x", "wall +x", "floor", "ceiling", "wall -z", "wall +z"};
    static constexpr const char* kSideNames[] = {"-x", "+x", "bottom", "top", "-z", "+z"};
    const glm::dvec3 size = box.max_m - box.min_m;
    std::vector<ProxyFace> faces;
    for (int axis = 0; axis < 3; ++axis) {
        for (int side = 0; side < 2; ++side) {
            const int a = (axis + 1) % 3;
            const int b = (axis + 2) % 3;
            glm::dvec3 corner = box.min_m;
            glm::dvec3 edge_a(0.0);
            glm::dvec3 edge_b(0.0);
            corner[axis] = side == 0 ? box.min_m[axis] : box.max_m[axis];
            edge_a[a] = size[a];
            edge_b[b] = size[b];
            // a × b points along +axis: wanted inside at the low side, outside at the high side.
            const bool towards_plus = (side == 0) != box.solid;
            const int index = axis * 2 + side;
            const std::string name =
                box.solid ? (box.name.empty() ? "box" : box.name) + " " + kSideNames[index]
                          : kRoomNames[index];
            faces.push_back(towards_plus ? makeFace(corner, edge_a, edge_b, name)
                                         : makeFace(corner, edge_b, edge_a, name));
        }
    }
    return faces;
}

/// True when a solid's face lies on or behind a surface of the room, so that no light reaches it.
bool restsOnRoom(const ProxyFace& face, const RoomDescription& room)
{
    const glm::dvec3 center = face.corner + 0.5 * (face.edge_u + face.edge_v);
    for (const RoomFloor& floor : room.floors)
        if (face.normal.y < -0.5 && center.y <= floor.height_m + kContactM) return true;
    for (const RoomBox& box : room.boxes) {
        if (box.solid) continue;
        for (int axis = 0; axis < 3; ++axis) {
            if (face.normal[axis] < -0.5 && center[axis] <= box.min_m[axis] + kContactM)
                return true;
            if (face.normal[axis] > 0.5 && center[axis] >= box.max_m[axis] - kContactM) return true;
        }
    }
    return false;
}

/// A parallelogram stays one face; other convex polygons become triangles around their first
/// corner.
std::vector<ProxyFace> polygonFaces(const std::vector<glm::dvec3>& corners,
                                    const std::string& name,
                                    bool two_sided)
{
    if (corners.size() == 4) {
        const glm::dvec3 u = corners[1] - corners[0];
        const glm::dvec3 v = corners[3] - corners[0];
        const double off = glm::length(corners[2] - corners[0] - u - v);
        if (off <= 1e-9 * (glm::length(u) + glm::length(v)))
            return {makeFace(corners[0], u, v, name, two_sided)};
    }
    std::vector<ProxyFace> faces;
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
        ProxyFace face = makeFace(
            corners[0], corners[i] - corners[0], corners[i + 1] - corners[0], name, two_sided);
        face.triangle = true;
        // Corners in a line give a triangle without area.
        if (std::isfinite(face.normal.x)) faces.push_back(std::move(face));
    }
    return faces;
}

std::vector<ProxyFace> primitiveFaces(const RoomPrimitive& primitive, const RoomDescription& room)
{
    std::vector<ProxyFace> faces;
    const std::string body = primitive.name.empty() ? "primitive" : primitive.name;
    for (const WorldFace& polygon : primitive.faces)
        for (ProxyFace& face :
             polygonFaces(polygon.corners_m, body + " " + polygon.name, primitive.two_sided)) {
            face.solid = primitive.solid;
            if (!primitive.solid || !restsOnRoom(face, room)) faces.push_back(std::move(face));
        }
    return faces;
}

std::vector<ProxyFace> collectFaces(const RoomDescription& room)
{
    std::vector<ProxyFace> faces;
    for (const RoomFloor& floor : room.floors) {
        const double h = floor.half_size_m;
        faces.push_back(makeFace({-h, floor.height_m, -h}, {0, 0, 2 * h}, {2 * h, 0, 0}, "floor"));
    }
    for (const RoomPlane& plane : room.planes)
        faces.push_back(makeFace(plane.corner_m, plane.edge_u_m, plane.edge_v_m, "plane", true));
    for (std::size_t index = 0; index < room.boxes.size(); ++index) {
        const RoomBox& box = room.boxes[index];
        for (ProxyFace& face : boxFaces(box)) {
            face.solid = box.solid;
            face.box = static_cast<int>(index);
            if (!box.solid || !restsOnRoom(face, room)) faces.push_back(std::move(face));
        }
    }
    for (std::size_t index = 0; index < room.primitives.size(); ++index)
        for (ProxyFace& face : primitiveFaces(room.primitives[index], room)) {
            face.box = static_cast<int>(room.boxes.size() + index);
            faces.push_back(std::move(face));
        }
    for (const RoomMesh& mesh : room.meshes) {
        for (const glm::uvec3& t : mesh.mesh.triangles) {
            const glm::dvec3 a(mesh.mesh.positions[t.x]);
            ProxyFace face = makeFace(a,
                                      glm::dvec3(mesh.mesh.positions[t.y]) - a,
                                      glm::dvec3(mesh.mesh.positions[t.z]) - a,
                                      mesh.name.empty() ? "mesh" : mesh.name,
                                      true);
            face.triangle = true;
            if (std::isfinite(face.normal.x)) faces.push_back(std::move(face));
        }
    }
    return faces;
}

/// Columns: what a point relative to the face's corner is multiplied by for its coordinates in the
/// face's own (not necessarily orthogonal) basis.
glm::dmat2x3 uvAxes(const ProxyFace& face)
{
    const double uu = glm::dot(face.edge_u, face.edge_u);
    const double uv = glm::dot(face.edge_u, face.edge_v);
    const double vv = glm::dot(face.edge_v, face.edge_v);
    const double determinant = uu * vv - uv * uv;
    return {(vv * face.edge_u - uv * face.edge_v) / determinant,
            (uu * face.edge_v - uv * face.edge_u) / determinant};
}

glm::dvec3 polygonNormal(const std::vector<glm::dvec3>& corners)
{
    // Newell's method: exact for planar polygons, the best plane for nearly planar ones.
    glm::dvec3 sum(0.0);
    for (std::size_t i = 0; i < corners.size(); ++i)
        sum += glm::cross(corners[i], corners[(i + 1) % corners.size()]);
    return glm::normalize(sum);
}

}  // namespace

SceneProxy::SceneProxy(const RoomDescription& room)
    : faces_(collectFaces(room)), openings_(room.openings)
{
    // Cut each opening into the nearest parallel face that holds its centre.
    for (std::size_t o = 0; o < openings_.size(); ++o) {
        const std::vector<glm::dvec3>& corners = openings_[o].corners_m;
        const glm::dvec3 normal = polygonNormal(corners);
        glm::dvec3 center(0.0);
        for (const glm::dvec3& corner : corners)
            center += corner / double(corners.size());
        double nearest = kOpeningReachM;
        ProxyFace* wall = nullptr;
        for (ProxyFace& face : faces_) {
            const double distance = std::abs(glm::dot(center - face.corner, face.normal));
            const glm::dvec2 uv = (center - face.corner) * uvAxes(face);
            const bool inside = uv.x >= 0 && uv.y >= 0 && uv.x <= 1 && uv.y <= 1;
            if (std::abs(glm::dot(normal, face.normal)) < 0.95 || !inside || distance > nearest)
                continue;
            nearest = distance;
            wall = &face;
        }
        if (wall)
            wall->openings.push_back(o);
        else
            findings_.push_back({Severity::Warning,
                                 "opening-off-the-walls",
                                 fmt::format("room opening {} lies on no wall (none within {} m "
                                             "and parallel); it is ignored",
                                             o,
                                             kOpeningReachM)});
    }

    // Two triangles a parallelogram, one a triangle.
    for (std::size_t f = 0; f < faces_.size(); ++f) {
        const ProxyFace& face = faces_[f];
        uv_axes_.push_back(uvAxes(face));
        const std::uint32_t first = static_cast<std::uint32_t>(mesh_.positions.size());
        for (const glm::dvec3& p : {face.corner,
                                    face.corner + face.edge_u,
                                    face.corner + face.edge_v,
                                    face.corner + face.edge_u + face.edge_v})
            mesh_.positions.emplace_back(p);
        mesh_.triangles.emplace_back(first, first + 1, first + 2);
        face_of_triangle_.push_back(f);
        if (!face.triangle) {
            mesh_.triangles.emplace_back(first + 1, first + 3, first + 2);
            face_of_triangle_.push_back(f);
        }
    }
    mesh_.material_of.assign(mesh_.triangles.size(), 0);
    const TriangleMesh* meshes[] = {&mesh_};
    rays_ = std::make_unique<RayScene>(meshes);
}

std::optional<ProxyHit> SceneProxy::intersect(glm::dvec3 origin, glm::dvec3 direction) const
{
    // Faces are seen from one side: hits from behind are passed through.
    double passed = 0.0;
    for (int tries = 0; tries < 64; ++tries) {
        const auto hit = rays_->intersect(origin + passed * direction, direction);
        if (!hit) return std::nullopt;
        const std::size_t index = face_of_triangle_[hit->triangle];
        const ProxyFace& face = faces_[index];
        const double facing = glm::dot(face.normal, direction);
        // Rays meet planes exactly; the float hit only says which plane.
        const double distance = facing != 0.0 ? glm::dot(face.corner - origin, face.normal) / facing
                                              : passed + hit->distance_m;
        const double step = 1e-6 * (1.0 + passed + hit->distance_m);
        if ((facing < 0.0 || face.two_sided) && distance > step) {
            ProxyHit result;
            result.distance_m = distance;
            result.face = index;
            result.point = origin + distance * direction;
            result.uv = glm::clamp((result.point - face.corner) * uv_axes_[index], 0.0, 1.0);
            result.normal = facing < 0.0 ? face.normal : -face.normal;
            result.opening = insideOpening(index, result.point);
            return result;
        }
        passed += hit->distance_m + step;
    }
    return std::nullopt;
}

bool SceneProxy::mutuallyVisible(glm::dvec3 a, glm::dvec3 b) const
{
    const glm::dvec3 way = b - a;
    const double length = glm::length(way);
    if (length < 1e-9) return true;
    const auto hit = intersect(a, way / length);
    return !hit || hit->distance_m > length * (1.0 - 1e-5) - 1e-5;
}

glm::dvec3 SceneProxy::pointOn(std::size_t face, glm::dvec2 uv) const
{
    return faces_[face].corner + uv.x * faces_[face].edge_u + uv.y * faces_[face].edge_v;
}

double SceneProxy::area(std::size_t face) const
{
    const double whole = glm::length(glm::cross(faces_[face].edge_u, faces_[face].edge_v));
    return faces_[face].triangle ? 0.5 * whole : whole;
}

bool SceneProxy::insideOpening(std::size_t face, glm::dvec3 point) const
{
    const glm::dvec3 normal = faces_[face].normal;
    for (const std::size_t opening : faces_[face].openings) {
        const std::vector<glm::dvec3>& corners = openings_[opening].corners_m;
        int positive = 0;
        int negative = 0;
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const glm::dvec3 edge = corners[(i + 1) % corners.size()] - corners[i];
            // Same side of every edge, seen along the wall's normal.
            const double side = glm::dot(glm::cross(edge, point - corners[i]), normal);
            (side >= 0.0 ? positive : negative)++;
        }
        if (positive == 0 || negative == 0) return true;
    }
    return false;
}

}  // namespace insitu
