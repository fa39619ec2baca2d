#pragma once

#include "calib/room_views.h"

#include <optional>
#include <string>
#include <vector>

/// Internal to calib/: the joint least squares behind joinViews. Not installed.
namespace insitu::bundle {

struct State {
    std::vector<Camera> cameras;
    /// Quarters by which each view's own x and z are turned about the upright axis in the world.
    std::vector<int> quarters;
    std::vector<glm::dvec3> points_m;
};

struct Solved {
    std::vector<CameraEstimate> cameras;
    std::vector<glm::dvec3> points_m;
    double chi_squared = 0.0;
    double freedom = 0.0;
    std::string worst;  ///< the observation that fits worst
    double worst_sigmas = 0.0;
};

/// From a start that is right to a few degrees and decimetres. Nothing when it does not converge or
/// the information matrix is singular.
[[nodiscard]] std::optional<Solved> solve(const RoomViews& room,
                                          double sigma_px,
                                          const State& start);

}  // namespace insitu::bundle
