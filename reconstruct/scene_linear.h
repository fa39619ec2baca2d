#pragma once

#include "reconstruct/scene_solve_state.h"

#include <Eigen/Core>

#include <optional>
#include <span>
#include <vector>

namespace insitu {

/// The equations of a scene about its solution, to first order. Private to this module.

/// All equations at the state: rows of each, residuals and derivatives in standard deviations.
struct LinearSystem {
    Eigen::MatrixXd jacobian;
    Eigen::VectorXd residuals;
    std::vector<Eigen::Index> first_row;  ///< of each equation
};

[[nodiscard]] LinearSystem linearise(const SceneState& state);

/// What a set of equations determines: covariance on what it does, basis of what it leaves open.
struct Determined {
    Eigen::VectorXd scale;       ///< of each unknown, so that all weigh alike
    Eigen::MatrixXd covariance;  ///< pseudo-inverse of the normal equations
    Eigen::MatrixXd open;        ///< columns: open directions, in scaled unknowns
    Eigen::MatrixXd shifts;      ///< columns: what independent errors of the camera move by 1 sigma

    explicit Determined(const Eigen::MatrixXd& jacobian);

    /// Standard deviation of gradient · unknowns; nothing when it is left open.
    [[nodiscard]] std::optional<double> sigma(const Eigen::VectorXd& gradient) const;
};

/// How the unknowns follow when the camera is another one: a column for each. A camera before which
/// a vertex would not stand has no say.
[[nodiscard]] Eigen::MatrixXd cameraShifts(const SceneState& state,
                                           const LinearSystem& system,
                                           const Determined& determined,
                                           std::span<const Camera> cameras);

}  // namespace insitu
