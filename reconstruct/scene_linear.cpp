#include "reconstruct/scene_linear.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Directions of this share of the greatest eigenvalue, columns scaled alike, count as left open.
constexpr double kOpen = 1e-10;

/// Residuals of an equation whose marks were seen by another camera; false when a vertex would lie
/// behind it.
bool residualsBefore(const SceneState& state,
                     const SceneEquation& equation,
                     const Camera& camera,
                     double* residuals)
{
    SceneEquation other = equation;
    for (glm::dvec2* mark : {&other.at, &other.at_b}) {
        const auto seen = state.camera.distorted(*mark);
        if (!seen) return false;
        *mark = idealPixel(camera, *seen);
    }
    return evaluateEquation(
        other, camera, *state.layout, state.values, state.poses, residuals, nullptr);
}

}  // namespace

LinearSystem linearise(const SceneState& state)
{
    LinearSystem system;
    Eigen::Index rows = 0;
    for (const auto& equation : state.equations) {
        system.first_row.push_back(rows);
        rows += equation->size;
    }
    system.jacobian.setZero(rows, static_cast<Eigen::Index>(state.values.size()));
    system.residuals.setZero(rows);
    EquationJacobian part;
    for (std::size_t e = 0; e < state.equations.size(); ++e) {
        const SceneEquation& equation = *state.equations[e];
        double residuals[2] = {0.0, 0.0};
        if (!evaluateEquation(
                equation, state.camera, *state.layout, state.values, state.poses, residuals, &part))
            continue;
        for (int r = 0; r < equation.size; ++r) {
            const Eigen::Index row = system.first_row[e] + r;
            system.residuals[row] = residuals[r];
            for (std::size_t u = 0; u < equation.unknowns.size(); ++u)
                system.jacobian(row, static_cast<Eigen::Index>(equation.unknowns[u])) =
                    part(r, static_cast<Eigen::Index>(u));
        }
    }
    return system;
}

Determined::Determined(const Eigen::MatrixXd& jacobian)
{
    const Eigen::Index n = jacobian.cols();
    scale.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const double norm = jacobian.col(i).norm();
        scale[i] = norm > 0.0 ? 1.0 / norm : 1.0;
    }
    const Eigen::MatrixXd scaled = jacobian * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled.transpose() * scaled);
    const Eigen::VectorXd& values = solver.eigenvalues();
    const double limit = kOpen * std::max(values.size() > 0 ? values[n - 1] : 0.0, 1e-300);
    Eigen::Index count = 0;
    while (count < n && !(values[count] > limit))
        ++count;
    open = solver.eigenvectors().leftCols(count);
    const Eigen::MatrixXd basis = scale.asDiagonal() * solver.eigenvectors().rightCols(n - count);
    covariance = basis * values.tail(n - count).cwiseInverse().asDiagonal() * basis.transpose();
}

std::optional<double> Determined::sigma(const Eigen::VectorXd& gradient) const
{
    const Eigen::VectorXd scaled = scale.cwiseProduct(gradient);
    if (open.cols() > 0 &&
        (open.transpose() * scaled).norm() > 1e-5 * std::max(scaled.norm(), 1e-300))
        return std::nullopt;
    double variance = std::max(0.0, gradient.dot(covariance * gradient));
    if (shifts.cols() > 0) variance += (shifts.transpose() * gradient).squaredNorm();
    return std::sqrt(variance);
}

Eigen::MatrixXd cameraShifts(const SceneState& state,
                             const LinearSystem& system,
                             const Determined& determined,
                             std::span<const Camera> cameras)
{
    Eigen::MatrixXd shifts = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(state.values.size()),
                                                   static_cast<Eigen::Index>(cameras.size()));
    for (std::size_t k = 0; k < cameras.size(); ++k) {
        Eigen::VectorXd change = Eigen::VectorXd::Zero(system.residuals.size());
        bool seen = true;
        for (std::size_t e = 0; e < state.equations.size() && seen; ++e) {
            const SceneEquation& equation = *state.equations[e];
            const bool marked = equation.kind == SceneEquation::Kind::Vertex ||
                                equation.kind == SceneEquation::Kind::Edge;
            if (!marked) continue;
            double residuals[2] = {0.0, 0.0};
            seen = residualsBefore(state, equation, cameras[k], residuals);
            for (int r = 0; r < equation.size; ++r)
                change[system.first_row[e] + r] =
                    residuals[r] - system.residuals[system.first_row[e] + r];
        }
        if (seen)
            shifts.col(static_cast<Eigen::Index>(k)) =
                -(determined.covariance * (system.jacobian.transpose() * change));
    }
    return shifts;
}

}  // namespace insitu
