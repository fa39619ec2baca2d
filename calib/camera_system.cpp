#include "calib/camera_system.h"

#include "calib/camera_evaluation.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu::calibration {

namespace {

constexpr int kMaxSteps = 100;
/// A step shorter than this in standard deviations changes nothing.
constexpr double kStepSigmas = 1e-9;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Reciprocal condition of the scaled information below which a direction is open.
constexpr double kOpen = 1e-13;
/// A lens stronger than this is none of the model's (core/camera.h).
constexpr double kMaxDivision = 0.5;

State moved(const Problem& problem, const State& state, const Vector& step)
{
    State next = state;
    const Eigen::Vector3d turn = step.head<3>();
    const double angle = turn.norm();
    if (angle > 0.0)
        next.camera_from_world = Eigen::AngleAxisd(angle, turn / angle) * state.camera_from_world;
    next.log_focal = std::clamp(state.log_focal + step[kLogFocal],
                                std::log(problem.shortest_focal_px),
                                std::log(problem.longest_focal_px));
    next.principal_px += step.segment<2>(kPrincipal);
    next.division = std::clamp(state.division + step[kDivision], -kMaxDivision, kMaxDivision);
    next.position_m += step.segment<3>(kPosition);
    return next;
}

/// Baarda's test of every constraint; unused ones are predicted.
std::vector<Test> testAll(const Evaluation& at, const Matrix& covariance)
{
    std::vector<Test> tests(at.problem.constraints.size());
    const Matrix finite = covariance.array().isFinite().select(covariance, 0.0);
    std::vector<Block> blocks = at.blocks;
    for (std::size_t i = 0; i < at.problem.constraints.size(); ++i)
        if (const Constraint& one = at.problem.constraints[i]; !one.used) {
            tests[i].predicted = true;
            blocks.push_back({{static_cast<int>(i)}, one.observations, one.rows});
        }
    for (const Block& block : blocks) {
        const auto linear = linearised(at, block);
        if (!linear) continue;
        const Eigen::MatrixXd own = covarianceOf(at, block, *linear);
        const Eigen::MatrixXd camera =
            linear->by_unknowns * finite * linear->by_unknowns.transpose();
        const bool predicted = tests[block.constraints.front()].predicted;
        const Eigen::MatrixXd inverse = own.inverse();
        // Multipliers μ = S⁻¹ g have the covariance S⁻¹ − S⁻¹ A C Aᵀ S⁻¹.
        const Eigen::MatrixXd spread = predicted
                                           ? Eigen::MatrixXd(own + camera)
                                           : Eigen::MatrixXd(inverse - inverse * camera * inverse);
        const Eigen::VectorXd tested =
            predicted ? linear->values : Eigen::VectorXd(inverse * linear->values);
        int row = 0;
        for (const int index : block.constraints)
            for (int k = 0; k < at.problem.constraints[index].rows; ++k, ++row) {
                // A row that alone decides something has no redundancy, hence no test.
                const double floor = predicted ? 0.0 : 1e-6 * inverse(row, row);
                if (!(spread(row, row) > floor)) continue;
                tests[index].statistic = std::max(
                    tests[index].statistic, std::abs(tested[row]) / std::sqrt(spread(row, row)));
            }
    }
    return tests;
}

/// One trial of Levenberg–Marquardt; true when the state moved.
bool tryStep(Evaluation& at, const Normal& normal, double damping, double& length)
{
    Matrix damped = normal.information;
    Vector gradient = normal.gradient;
    for (int i = 0; i < kUnknowns; ++i) {
        if (at.problem.free[i]) {
            damped(i, i) += damping * damped(i, i) + 1e-300;
            continue;
        }
        damped.row(i).setZero();
        damped.col(i).setZero();
        damped(i, i) = 1.0;
        gradient[i] = 0.0;
    }
    const Vector scale = damped.diagonal().cwiseSqrt().cwiseInverse();
    const Matrix scaled = scale.asDiagonal() * damped * scale.asDiagonal();
    const Vector step = -(scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * gradient));
    if (!step.allFinite()) return false;
    length = std::sqrt(std::max(0.0, step.dot(normal.information * step)));
    Evaluation trial{at.problem, at.blocks, moved(at.problem, at.state, step), at.settled, 0.0};
    if (!settle(trial) || !(trial.cost <= at.cost * (1.0 + 1e-12) + 1e-20)) return false;
    at.state = trial.state;
    at.settled = std::move(trial.settled);
    at.cost = trial.cost;
    return true;
}

}  // namespace

int Problem::observe(double value, double sigma)
{
    observations.push_back({value, sigma * sigma});
    return static_cast<int>(observations.size()) - 1;
}

std::optional<Solution> solve(const Problem& problem, const State& start)
{
    const std::vector<Block> blocks = blocksOf(problem);
    Evaluation at{problem, blocks, start, {}, 0.0};
    for (const Observation& observation : problem.observations)
        at.settled.push_back(observation.value);
    if (!settle(at)) return std::nullopt;
    Solution solution;
    double damping = 1e-6;
    auto normal = normalEquations(at);
    for (int i = 0; i < kMaxSteps && normal && !solution.converged; ++i) {
        double length = 0.0;
        if (tryStep(at, *normal, damping, length)) {
            damping = std::max(1e-12, 0.1 * damping);
            normal = normalEquations(at);
        } else {
            if (damping > 1e12) break;
            damping *= 10.0;
        }
        solution.converged = length < kStepSigmas;
    }
    if (!normal) return std::nullopt;
    solution.state = at.state;
    solution.cost = at.cost;
    solution.information = normal->information;
    solution.division_gradient = normal->gradient[kDivision];
    solution.tests = testAll(at, covarianceOf(normal->information, problem.free));
    for (const Block& block : blocks)
        solution.freedom += block.rows;
    solution.freedom -=
        static_cast<double>(std::count(problem.free.begin(), problem.free.end(), true));
    return solution;
}

namespace {

/// Indices of the free unknowns without `held`.
std::vector<int> freeIndices(const std::array<bool, kUnknowns>& free, int held = -1)
{
    std::vector<int> result;
    for (int i = 0; i < kUnknowns; ++i)
        if (free[i] && i != held) result.push_back(i);
    return result;
}

}  // namespace

Matrix covarianceOf(const Matrix& information, const std::array<bool, kUnknowns>& free)
{
    // In units of each unknown's conditional standard deviation eigenvalues are at most a few; the
    // open directions are those without information, and open is what takes part in one.
    const std::vector<int> indices = freeIndices(free);
    const auto count = static_cast<Eigen::Index>(indices.size());
    Matrix result = Matrix::Zero();
    if (count == 0) return result;
    Eigen::MatrixXd small = information(indices, indices);
    Eigen::VectorXd scale(count);
    for (Eigen::Index i = 0; i < count; ++i)
        scale[i] = small(i, i) > 0.0 ? 1.0 / std::sqrt(small(i, i)) : 0.0;
    small = (scale.asDiagonal() * small * scale.asDiagonal()).eval();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(small);
    Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(count, count);
    Eigen::VectorXd open = Eigen::VectorXd::Zero(count);
    for (Eigen::Index k = 0; k < count; ++k) {
        const Eigen::VectorXd v = solver.eigenvectors().col(k);
        if (solver.eigenvalues()[k] > kOpen)
            inverse += v * v.transpose() / solver.eigenvalues()[k];
        else
            open += v.cwiseAbs2();
    }
    inverse = (scale.asDiagonal() * inverse * scale.asDiagonal()).eval();
    result(indices, indices) = inverse;
    for (Eigen::Index i = 0; i < count; ++i)
        if (open[i] > 1e-6 || scale[i] == 0.0) {
            result.row(indices[i]).setZero();
            result.col(indices[i]).setZero();
            result(indices[i], indices[i]) = kInfinite;
        }
    return result;
}

Vector followers(const Matrix& information, const std::array<bool, kUnknowns>& free, int held)
{
    Vector result = Vector::Zero();
    const std::vector<int> rest = freeIndices(free, held);
    if (rest.empty()) return result;
    const Eigen::MatrixXd own = information(rest, rest);
    const Eigen::VectorXd mixed = information(rest, std::vector<int>{held});
    Eigen::VectorXd scale = own.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * own * scale.asDiagonal();
    const Eigen::VectorXd moved =
        scale.asDiagonal() *
        scaled.completeOrthogonalDecomposition().solve(scale.asDiagonal() * mixed);
    for (std::size_t i = 0; i < rest.size(); ++i)
        result[rest[i]] = -moved[i];
    return result;
}

}  // namespace insitu::calibration
