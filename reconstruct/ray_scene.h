#pragma once

#include "core/mesh.h"

#include <glm/glm.hpp>

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>

namespace insitu {

/// Closest hit of a ray with a RayScene.
struct RayHit {
    double distance_m = 0.0;
    std::uint32_t mesh = 0;      ///< index into the meshes given at construction
    std::uint32_t triangle = 0;  ///< index into that mesh's triangles
    /// Barycentric weights of the triangle's second and third vertex.
    glm::vec2 barycentric{0.0f};
    /// Unit geometric normal, towards the counter-clockwise side (not flipped to the ray).
    glm::dvec3 normal{0.0};
};

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Ray queries on triangles, in metres, by Embree (hidden from this interface).
///
/// Vertices are stored relative to the centre of the scene's bounding box, so that a scene far
/// from the origin keeps float precision. Queries are thread-safe; hits are deterministic.
class RayScene {
public:
    /// Called for every candidate hit of a mesh with cut-outs; false lets the ray pass.
    using HitFilter =
        std::function<bool(std::uint32_t mesh, std::uint32_t triangle, glm::vec2 barycentric)>;

    /// The meshes are copied into the acceleration structure; the filter (optional) is kept and is
    /// asked only for meshes whose flag in `filtered` is set; it must not throw. Triangles without
    /// area or with non-finite vertices are never hit. An index out of range is a LogicError.
    explicit RayScene(std::span<const TriangleMesh* const> meshes,
                      std::span<const bool> filtered = {},
                      HitFilter filter = nullptr);
    ~RayScene();
    RayScene(RayScene&&) noexcept;
    RayScene& operator=(RayScene&&) noexcept;

    /// Closest hit with distance in (0, max_distance_m). `direction` is a unit vector. Callers
    /// offset the origin themselves (offsetOrigin).
    [[nodiscard]] std::optional<RayHit> intersect(glm::dvec3 origin,
                                                  glm::dvec3 direction,
                                                  double max_distance_m = kInfinity) const;
    [[nodiscard]] bool occluded(glm::dvec3 origin,
                                glm::dvec3 direction,
                                double max_distance_m = kInfinity) const;
    [[nodiscard]] bool empty() const;

    /// The point moved off its surface, along the normal to the side of `direction`, far enough
    /// that a ray from it does not hit the surface again, by this scene's own numerical error:
    /// scales with the scene's size and does not grow with its distance from the world's origin.
    [[nodiscard]] glm::dvec3 offsetOrigin(glm::dvec3 point,
                                          glm::dvec3 unit_normal,
                                          glm::dvec3 direction) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// The same for callers that do not know the scene: by the magnitude of the coordinates, for
/// scenes in metres that are no larger than a few tens of metres around the world's origin.
/// Prefer RayScene::offsetOrigin.
/// Source: [WacBin19], Waechter & Binder, "A fast and robust method for avoiding
/// self-intersection".
[[nodiscard]] glm::dvec3 offsetOrigin(glm::dvec3 point,
                                      glm::dvec3 unit_normal,
                                      glm::dvec3 direction);

}  // namespace insitu
