#pragma once

#include "lighting/hidden_light.h"
#include "lighting/light_spots.h"
#include "lighting/place_light.h"
#include "lighting/visibility_atlas.h"
#include "render/object_scene.h"
#include "render/renderer.h"

#include <vector>

namespace insitu {

/// What technique `fiv` knows of a room and its objects. All objects share one atlas, so that what
/// several of them hide together is exact.
struct FivScene {
    const RoomLight& room;
    const ObjectScene& objects;
    VisibilityAtlas atlas;   ///< many directions: what receivers lose
    VisibilityAtlas coarse;  ///< fewer: light on the objects themselves, and on the room's cells
    std::shared_ptr<const CellGeometry> cells;         ///< of `atlas`
    std::shared_ptr<const CellGeometry> coarse_cells;  ///< of `coarse`
    LightSpots spots;
    FivLight light = FivLight::Room;
    FaceGrid<Rgb> room_change;  ///< ΔL of the room's surfaces, on its cell grid
    /// Mean radiance of the objects' surfaces that are seen along a direction: a value for each
    /// cell of `coarse`, number 2·pair + side as in PlaceLight. What hides light sends this
    /// instead.
    std::vector<Rgb> glow;

    [[nodiscard]] const LocalFrame& frame() const { return coarse.silhouettes.local; }
    [[nodiscard]] Rgb glowAlong(glm::dvec3 direction) const
    {
        const DirectedPair cell = coarse.cells().cellAt(direction);
        return glow[2 * cell.pair + static_cast<std::size_t>(cell.side)];
    }
    /// False when nothing on the ray can be an object.
    [[nodiscard]] bool mayMeetObjects(glm::dvec3 origin, glm::dvec3 direction) const
    {
        const glm::dvec3 way = frame().center - origin;
        const double along = glm::dot(way, direction);
        const double r2 = frame().radius * frame().radius;
        return glm::dot(way, way) - along * along <= r2 &&
               (along > 0.0 || glm::dot(way, way) <= r2);
    }
};

/// The light at a place less the objects' own, as light that objects can hide: what they take from
/// a surface when they hide it. Where they are brighter than what they hide, it is in `gained`.
struct HideableLight {
    ObjectLight lost;
    ObjectLight gained;
    bool gains = false;
};
/// `light` has the cells of `atlas`, which is one of the scene's.
[[nodiscard]] HideableLight hideableLight(const FivScene& scene,
                                          const VisibilityAtlas& atlas,
                                          const PlaceLight& light);

/// What the objects change of the room's own radiance: ρ/π times the change of irradiance that
/// they cause directly, on the room's cell grid. One round; uses scene.glow.
[[nodiscard]] FaceGrid<Rgb> roomChange(const FivScene& scene);

}  // namespace insitu
