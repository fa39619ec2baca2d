#pragma once

#include "reconstruct/scene_equations.h"
#include "reconstruct/scene_solve.h"

#include <span>

namespace insitu {

/// What the solver knows at its present state. Private to this module.
struct SceneState {
    SceneGraph graph;
    Camera camera;
    std::unique_ptr<SceneLayout> layout;
    std::vector<std::unique_ptr<SceneEquation>> equations;  ///< addresses stay
    std::vector<double> values;                             ///< one an unknown
    std::vector<ScenePose> poses;
    SceneSolution solution;
};

/// Standard deviations, redundancies and tests at the state (scene_analysis.cpp).
[[nodiscard]] SceneEstimate analyseScene(const SceneState& state,
                                         std::span<const Camera> camera_errors);

}  // namespace insitu
