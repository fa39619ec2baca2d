#pragma once

#include "reconstruct/scene_proxy.h"

#include <glm/glm.hpp>

#include <optional>
#include <span>

namespace insitu {

/// How far points reach out of a described room.
///
/// What encloses is a box that is not solid, or a primitive that is not solid, seen from one side,
/// closed and convex: a turned room box, or a room of the user's own library. A point is inside
/// when it is inside one of them; else it is outside by the least that it has crossed a wall by,
/// which is a lower bound of its distance. Metres. Returns the largest over the points, 0 when all
/// are inside; nothing when nothing encloses.
[[nodiscard]] std::optional<double> reachOutside(const RoomDescription& room,
                                                 std::span<const glm::dvec3> points_m);

}  // namespace insitu
