#pragma once

#include "core/camera.h"
#include "reconstruct/scene_pose.h"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// The constraints of a scene graph as equations in its unknowns. Private to this module.

/// One constraint. Its residuals are divided by their standard deviation.
struct SceneEquation {
    enum class Kind { Vertex, Edge, Length, Prior };
    Kind kind = Kind::Vertex;
    std::string name;
    int size = 1;  ///< residuals, 1 or 2
    double sigma = 1.0;
    SceneVertex a;                        ///< Vertex, Edge, Length
    SceneVertex b;                        ///< Edge, Length
    glm::dvec2 at{0.0};                   ///< Vertex, Edge: a mark, as an ideal pinhole sees it
    glm::dvec2 at_b{0.0};                 ///< Edge: the other mark
    double wanted = 0.0;                  ///< Length, Prior
    std::size_t unknown = 0;              ///< Prior
    std::vector<std::size_t> unknowns;    ///< the columns of `jacobian`, ascending
    std::vector<std::size_t> primitives;  ///< whose unknowns these are, ascending
};

using EquationJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;

/// The mark as a camera without distortion would see it, so that lines are straight.
[[nodiscard]] glm::dvec2 idealPixel(const Camera& camera, glm::dvec2 pixel);

/// All constraints: observations in their order (vertices, edges, lengths), then priors.
[[nodiscard]] std::vector<SceneEquation> sceneEquations(const SceneGraph& graph,
                                                        const Camera& camera,
                                                        const SceneLayout& layout);
[[nodiscard]] SceneEquation vertexEquation(const VertexObservation& observation,
                                           const Camera& camera,
                                           const SceneLayout& layout);

/// Residuals, and derivatives (rows of `jacobian`, resized) when asked for. False when a vertex
/// lies behind the camera.
[[nodiscard]] bool evaluateEquation(const SceneEquation& equation,
                                    const Camera& camera,
                                    const SceneLayout& layout,
                                    std::span<const double> state,
                                    const std::vector<ScenePose>& poses,
                                    double* residuals,
                                    EquationJacobian* jacobian);

}  // namespace insitu
