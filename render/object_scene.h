#pragma once

#include "core/mesh.h"
#include "reconstruct/ray_scene.h"
#include "render/bsdf/bsdf.h"

#include <memory>
#include <vector>

namespace insitu {

/// A point on an object, ready to be shaded.
struct SurfacePoint {
    double distance_m = 0.0;
    glm::dvec3 position{0.0};
    glm::dvec3 geometric_normal{0.0};  ///< unit, on the side the ray came from
    /// Unit, interpolated, same side as the geometric one. For glossy materials bent, if need be,
    /// just above the horizon seen from the ray's origin; Lambert needs no bending, and gets none.
    glm::dvec3 shading_normal{0.0};
    SurfaceMaterial material;
    std::size_t object = 0;
};

/// The placed objects: what scatters light. Holds triangles in world space and their textures.
class ObjectScene {
public:
    using Object = PlacedModel;
    /// Models are valid as core/mesh.h says (LogicError otherwise); one without triangles is
    /// allowed.
    explicit ObjectScene(std::vector<Object> objects);
    ~ObjectScene();
    ObjectScene(ObjectScene&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] const std::vector<Object>& objects() const;
    /// The mesh of each object, in the world.
    [[nodiscard]] const std::vector<TriangleMesh>& meshes() const;
    /// Axis-aligned bounds of one object, for bounding cones.
    [[nodiscard]] const std::vector<BoundingBox>& bounds() const;
    /// Alpha-masked texels let rays pass; a single-sided back face is shaded like a front face.
    [[nodiscard]] std::optional<SurfacePoint> intersect(glm::dvec3 origin,
                                                        glm::dvec3 direction,
                                                        double max_distance_m = kInfinity) const;
    [[nodiscard]] bool occluded(glm::dvec3 origin,
                                glm::dvec3 direction,
                                double max_distance_m = kInfinity) const;
    /// Where a ray in `direction` starts so that it does not hit its own surface again.
    [[nodiscard]] glm::dvec3 leave(const SurfacePoint& point, glm::dvec3 direction) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace insitu
