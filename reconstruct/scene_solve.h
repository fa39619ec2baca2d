#pragma once

#include "core/camera.h"
#include "core/finding.h"
#include "reconstruct/scene_graph.h"

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// How one solution went.
struct SceneSolution {
    bool converged = false;
    int iterations = 0;
    double cost = 0.0;  ///< half the sum of squared residuals, each in its standard deviations
};

/// A number with its standard deviation: 0 when held, nothing when the constraints leave it open.
struct SolvedNumber {
    double value = 0.0;
    std::optional<double> sigma;
};
struct SolvedPrimitive {
    std::vector<SolvedNumber> parameters;
    std::array<SolvedNumber, 3> position_m;
    SolvedNumber rotation_y_rad;
};

/// How well one constraint is met.
struct ConstraintFit {
    std::string name;
    double residual = 0.0;  ///< root mean square over its residuals, in its own unit (px or m)
    double sigmas = 0.0;    ///< the same in its standard deviations
    /// Share of the constraint that the others control, 0 to 1: an error of it shows with this
    /// share. 0: it alone decides something.
    double redundancy = 0.0;
};

/// A solved scene with what can be said of it. Standard deviations are those of the marks and of
/// the camera, to first order; constraints are tested as if the camera were exact.
///
/// Findings: "reconstruct-not-converged", "reconstruct-undetermined" (numbers that the constraints
/// leave open: they keep their start as far as they can), "reconstruct-weak" (a size less certain
/// than half of itself), "reconstruct-at-bound" (a size at its least or greatest value),
/// "reconstruct-conflict" (a constraint that the others contradict; those that could be meant
/// instead are named with it), "reconstruct-residuals-large" (no single one, but all together).
/// Source of the test for conflicts: [Baarda68], data snooping.
struct SceneEstimate {
    std::vector<SolvedPrimitive> primitives;
    std::vector<ConstraintFit> constraints;
    int unknowns = 0;
    int redundancy = 0;  ///< residuals less unknowns that are determined
    double variance_factor =
        0.0;  ///< sum of squared residuals / redundancy; about 1 when all is well
    SceneSolution solution;
    Findings findings;
};

/// Solves a scene graph and keeps its state, so that a small change is solved from there.
///
/// The hierarchical constraints hold exactly by parametrisation, the observations in least squares
/// (Levenberg–Marquardt, Ceres). One at a time, from one thread.
class SceneSolver {
public:
    /// A graph with a problem (sceneProblem) is a LogicError: ask before.
    SceneSolver(SceneGraph graph, const Camera& camera);
    ~SceneSolver();
    SceneSolver(SceneSolver&&) noexcept;
    SceneSolver& operator=(SceneSolver&&) noexcept;

    /// From the present state. InputError when an observed vertex stands behind the camera there.
    SceneSolution solve();
    /// Moves the observation of a vertex to this pixel, or makes one, and solves again, to about a
    /// hundredth of a standard deviation: solve() at the end of a drag does the rest.
    SceneSolution drag(SceneVertex vertex, glm::dvec2 pixel, double sigma_px = 1.0);

    /// Where everything stands, without the analysis: quick.
    [[nodiscard]] std::vector<SolvedPrimitive> primitives() const;
    /// The same with all that is known of it: one dense decomposition.
    /// camera_errors   cameras that are one standard deviation off, each along one of the
    ///                 independent directions of the camera's error; none: it counts as exact
    [[nodiscard]] SceneEstimate estimate(std::span<const Camera> camera_errors = {}) const;
    [[nodiscard]] const SceneGraph& graph() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// The faces of a solved primitive in the world.
[[nodiscard]] std::vector<WorldFace> solvedFaces(const ScenePrimitive& primitive,
                                                 const SolvedPrimitive& solved);

}  // namespace insitu
