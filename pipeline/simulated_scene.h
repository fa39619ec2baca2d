#pragma once

#include "lighting/environment_light.h"
#include "pipeline/simulated_room.h"
#include "render/object_scene.h"

#include <string>
#include <vector>

namespace insitu {

/// A solid of the room as the written project names it.
struct SolidBounds {
    std::string name;
    BoundingBox box;
    /// Has it the edges of its bounding box? True for boxes, not for furniture.
    bool has_edges = false;
    bool in_project = true;
};

/// A simulated room, ready to be rendered.
struct SimulatedScene {
    ObjectScene without;  ///< the empty place
    ObjectScene with;     ///< with the object really in it
    EnvironmentLight light;
    std::vector<SolidBounds> solids;
};

/// Loads models and pictures and builds everything. InputError from the readers.
[[nodiscard]] SimulatedScene buildScene(const SimulatedRoom& room);

/// The four corners of a window's hole in the plane of its wall, in order.
[[nodiscard]] std::vector<glm::dvec3> windowCorners(const RoomBox& box,
                                                    const SimulatedWindow& window);

}  // namespace insitu
