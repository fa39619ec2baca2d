#pragma once

#include "calib/camera_system.h"

#include <Eigen/Core>

#include <optional>
#include <vector>

/// Internal to calib/: equations and their derivatives, block by block. Not installed.
namespace insitu::calibration {

/// Equations that share observations, solved together.
struct Block {
    std::vector<int> constraints;
    std::vector<int> observations;
    int rows = 0;
};

/// The equations of a block at one state, linear in observations and unknowns.
struct Linear {
    Eigen::VectorXd values;       ///< g + B (x − x̂)
    Eigen::MatrixXd by_observed;  ///< B
    Eigen::MatrixXd by_unknowns;  ///< A
};

struct Evaluation {
    const Problem& problem;
    const std::vector<Block>& blocks;
    State state;
    std::vector<double> settled;  ///< x̂
    double cost = 0.0;
};

struct Normal {
    Matrix information = Matrix::Zero();  ///< over all unknowns, free or not
    Vector gradient = Vector::Zero();     ///< of half the cost
};

[[nodiscard]] std::vector<Block> blocksOf(const Problem& problem);
/// x̂ and the cost at a state. False where an equation means nothing.
[[nodiscard]] bool settle(Evaluation& at);
/// The block's equations at the state and x̂. Nothing where one means nothing.
[[nodiscard]] std::optional<Linear> linearised(const Evaluation& at, const Block& block);
/// S = B Σ Bᵀ of a block.
[[nodiscard]] Eigen::MatrixXd covarianceOf(const Evaluation& at,
                                           const Block& block,
                                           const Linear& linear);
[[nodiscard]] std::optional<Normal> normalEquations(const Evaluation& at);

}  // namespace insitu::calibration
