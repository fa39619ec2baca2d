#pragma once

#include "core/mesh.h"
#include "lighting/hidden_light.h"

#include <glm/glm.hpp>

#include <memory>
#include <span>

namespace insitu {

/// An object that stands in the world, with what it hides.
struct StagedObject {
    const TriangleMesh* mesh = nullptr;  ///< outlives the stage, as the atlas
    const VisibilityAtlas* atlas = nullptr;
    Placement placement;
};

/// Several objects before one light, whose directions are the world's: what at least one of them
/// hides counts once.
///
/// A direction of the light is answered by the nearest direction of an object's atlas, sheared so
/// that the plane through the object's centre is right: exact for objects that are not turned, else
/// off by at most half a cell's angle times the depth of the object. Concentrated light has
/// silhouettes of its own for each object and is exact for any.
class ObjectStage {
public:
    /// `light` is split in world axes, for cells of any size. LogicError without objects.
    ObjectStage(std::span<const StagedObject> objects,
                CellLight light,
                DirectionCells cells,
                const FineSilhouetteOptions& options,
                Progress& progress);
    ~ObjectStage();
    ObjectStage(ObjectStage&&) noexcept;
    ObjectStage& operator=(ObjectStage&&) noexcept;

    /// Common rules of hidden_light.h, but places and normals are in the world.
    void hiddenVectors(std::span<const glm::dvec3> places_m,
                       std::span<IrradianceVector> hidden,
                       float bias_texels = 0.0f) const;
    void hiddenIrradiance(std::span<const glm::dvec3> places_m,
                          std::span<const glm::vec3> unit_normals,
                          std::span<Rgb> hidden,
                          float bias_texels = 0.0f) const;
    void hiddenIrradiance(std::span<const glm::dvec3> places_m,
                          glm::vec3 unit_normal,
                          std::span<Rgb> hidden,
                          float bias_texels = 0.0f) const;

    [[nodiscard]] const CellLight& light() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace insitu
