#pragma once

#include "calib/line_segments.h"
#include "pipeline/simulated_scene.h"

#include <vector>

namespace insitu {

/// The segments a careful user would mark: visible pieces, inside the picture, of the edges of the
/// room, its windows and its axis-aligned solids; the longest few of each axis. Without noise.
[[nodiscard]] std::vector<LineSegment> trueEdges(const SimulatedRoom& room,
                                                 const SimulatedScene& scene);

/// A line set made of them: end points and origin with Gaussian noise of room.line_noise_px (each
/// coordinate), the camera's true height as the scale.
[[nodiscard]] LineSet markedLines(const SimulatedRoom& room, const std::vector<LineSegment>& edges);

}  // namespace insitu
