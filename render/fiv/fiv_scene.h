#pragma once

#include "lighting/hidden_light.h"
#include "lighting/light_spots.h"
#include "lighting/place_light.h"
#include "lighting/visibility_atlas.h"
#include "render/fiv/sent_light.h"
#include "render/object_scene.h"
#include "render/renderer.h"

#include <vector>

namespace insitu {

/// What technique `fiv` knows of a room and its objects. All objects share one atlas, so that what
/// several of them hide together is exact.
struct FivScene {
    const RoomLight& room;
    const ObjectScene& objects;
    VisibilityAtlas atlas;                             ///< what receivers lose
    std::shared_ptr<const CellGeometry> cells;         ///< of `atlas`
    std::shared_ptr<const CellGeometry> coarse_cells;  ///< fewer, for what nothing hides
    LightSpots spots;
    FivLight light = FivLight::Room;
    FaceGrid<Rgb> room_change;  ///< ΔL of the room's surfaces, on its cell grid
    SentLight sent;             ///< by the objects, to the room, themselves and each other
    bool interreflection = true;

    [[nodiscard]] const LocalFrame& frame() const { return atlas.silhouettes.local; }
    /// The atlas's cells that the objects might hide from any place within `reach_m` of this one.
    [[nodiscard]] LookOptions limitsTowardObjects(glm::dvec3 place, double reach_m) const;
    /// How far the objects' box lies ahead at least, for rays along this unit direction that pass
    /// anywhere through it; negative when it reaches behind the place.
    [[nodiscard]] double distanceToObjects(glm::dvec3 place, glm::dvec3 direction) const
    {
        return glm::dot(frame().center - place, direction) -
               frame().radius * glm::dot(glm::dvec3(frame().half_extent), glm::abs(direction));
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

}  // namespace insitu
