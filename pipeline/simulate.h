#pragma once

#include "core/finding.h"
#include "core/progress.h"
#include "pipeline/simulated_lines.h"
#include "pipeline/simulated_room.h"
#include "pipeline/simulated_scene.h"

#include <filesystem>
#include <vector>

namespace insitu {

/// What the renderer made of a simulated room: scene-linear, before the camera.
struct SimulatedTruth {
    Image<Rgb> plate;               ///< the empty place
    Image<Rgb> with;                ///< with the object really in it
    Image<float> coverage;          ///< share of the pixel that the object covers
    std::vector<Image<Rgb>> balls;  ///< the close-ups of the mirror ball, one a view
    Image<Rgb> panorama;            ///< from the ball's centre, mapping of core/environment_map.h
};

/// Path-traces all of it. The ball is not part of the room's light: it sees the empty place, and
/// nothing in the place sees it. Same bytes for every number of threads.
[[nodiscard]] SimulatedTruth renderRoom(const SimulatedRoom& room,
                                        const SimulatedScene& scene,
                                        Progress& progress);

/// One photograph per exposure: name, picture and what the camera writes beside it.
struct SimulatedShot {
    std::string name;
    double seconds = 0.0;
    EncodedImage image;
    std::vector<std::uint8_t> exif;
};

/// Everything `insitu simulate` writes.
struct SimulatedCapture {
    SimulatedTruth truth;
    double sensor_scale = 1.0;
    SimulatedShot plate, with;
    std::vector<std::vector<SimulatedShot>> brackets;  ///< one a view of the ball
    std::vector<LineSegment> edges;
    LineSet lines;
    std::vector<SolidBounds> solids;
    Findings findings;  ///< "simulate-few-lines"
};
[[nodiscard]] SimulatedCapture simulate(const SimulatedRoom& room, Progress& progress);

/// Writes into `folder` what a user would have: plate.jpg, ball_*.jpg (further views: ball2_*.jpg
/// and so on), lines.json, project.json (which names the object's model where it is); and into
/// `folder`/truth what a judge needs (docs/file_format.md). Overwrites.
void writeCapture(const SimulatedCapture& capture,
                  const SimulatedRoom& room,
                  const std::filesystem::path& folder);

}  // namespace insitu
