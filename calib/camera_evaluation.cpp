#include "calib/camera_evaluation.h"

#include "calib/camera_constraints.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace insitu::calibration {

namespace {

/// Inner passes that move the observations onto the equations; quadratic, and started warm.
constexpr int kInnerPasses = 3;

using ObservationJet = ceres::Jet<double, kMostObservations>;
using UnknownJet = ceres::Jet<double, kUnknowns>;

template <typename T>
View<T> viewOf(const Problem& problem, const State& state)
{
    View<T> view;
    view.camera_from_world = state.camera_from_world.cast<T>();
    view.log_focal = T(state.log_focal);
    view.focal = T(std::exp(state.log_focal));
    view.principal = state.principal_px.cast<T>();
    view.division = T(state.division);
    view.square_half_diagonal = problem.half_diagonal_px * problem.half_diagonal_px;
    view.position = state.position_m.cast<T>();
    return view;
}

/// The view with derivatives by the unknowns, at a turn of zero.
View<UnknownJet> movingView(const Problem& problem, const State& state)
{
    View<UnknownJet> view = viewOf<UnknownJet>(problem, state);
    for (int column = 0; column < 3; ++column)
        for (int turn = 0; turn < 3; ++turn) {
            // d(e × r) for a turn about the axis e.
            const Eigen::Vector3d moved =
                Eigen::Vector3d::Unit(turn).cross(state.camera_from_world.col(column));
            for (int row = 0; row < 3; ++row)
                view.camera_from_world(row, column).v[kTurn + turn] = moved[row];
        }
    view.log_focal.v[kLogFocal] = 1.0;
    view.focal.v[kLogFocal] = view.focal.a;
    view.division.v[kDivision] = 1.0;
    for (int i = 0; i < 2; ++i)
        view.principal[i].v[kPrincipal + i] = 1.0;
    for (int i = 0; i < 3; ++i)
        view.position[i].v[kPosition + i] = 1.0;
    return view;
}

template <typename T>
T numberOf(const View<T>& view, int unknown)
{
    if (unknown == kLogFocal) return view.log_focal;
    if (unknown == kDivision) return view.division;
    if (unknown >= kPosition) return view.position[unknown - kPosition];
    return view.principal[unknown - kPrincipal];
}

template <typename T>
bool evaluate(const Constraint& constraint, const View<T>& view, const T* x, T* out)
{
    switch (constraint.kind) {
        case Kind::AlongAxis:
            return alongAxis(view, constraint.index, x, out);
        case Kind::StraightLine:
            return straightLine(view, x, out);
        case Kind::WorldPoint:
            return worldPoint(view, x, out);
        case Kind::FloorLength:
            return knownLength(view, false, x, out);
        case Kind::UprightLength:
            return knownLength(view, true, x, out);
        case Kind::FloorRightAngle:
            return floorRightAngle(view, x, out);
        case Kind::Rectangle:
            return rectangle(view, constraint.ratio, false, x, out);
        case Kind::FloorRectangle:
            return rectangle(view, constraint.ratio, true, x, out);
        case Kind::Gravity:
            for (int row = 0; row < 2; ++row)
                out[row] =
                    view.camera_from_world.col(1).dot(constraint.across[row].template cast<T>()) -
                    x[row];
            return true;
        case Kind::Number:
            out[0] = numberOf(view, constraint.index) - x[0];
            return true;
    }
    return false;
}

bool byObservations(const Evaluation& at,
                    const Block& block,
                    const View<ObservationJet>& view,
                    Linear& linear)
{
    linear.values.resize(block.rows);
    linear.by_observed.setZero(block.rows, static_cast<Eigen::Index>(block.observations.size()));
    int row = 0;
    for (const int index : block.constraints) {
        const Constraint& constraint = at.problem.constraints[index];
        ObservationJet x[kMostObservations];
        ObservationJet out[kMostRows];
        const auto count = constraint.observations.size();
        for (std::size_t i = 0; i < count; ++i)
            x[i] = ObservationJet(at.settled[constraint.observations[i]], static_cast<int>(i));
        if (!evaluate(constraint, view, x, out)) return false;
        for (int k = 0; k < constraint.rows; ++k, ++row) {
            linear.values[row] = out[k].a;
            for (std::size_t i = 0; i < count; ++i) {
                const int one = constraint.observations[i];
                const auto column =
                    std::find(block.observations.begin(), block.observations.end(), one) -
                    block.observations.begin();
                linear.by_observed(row, column) += out[k].v[i];
                linear.values[row] +=
                    out[k].v[i] * (at.problem.observations[one].value - at.settled[one]);
            }
        }
    }
    return linear.values.allFinite() && linear.by_observed.allFinite();
}

/// A at x̂.
bool byUnknowns(const Evaluation& at,
                const Block& block,
                const View<UnknownJet>& view,
                Eigen::MatrixXd& result)
{
    result.setZero(block.rows, kUnknowns);
    int row = 0;
    for (const int index : block.constraints) {
        const Constraint& constraint = at.problem.constraints[index];
        UnknownJet x[kMostObservations];
        UnknownJet out[kMostRows];
        for (std::size_t i = 0; i < constraint.observations.size(); ++i)
            x[i] = UnknownJet(at.settled[constraint.observations[i]]);
        if (!evaluate(constraint, view, x, out)) return false;
        for (int k = 0; k < constraint.rows; ++k, ++row)
            for (int j = 0; j < kUnknowns; ++j)
                result(row, j) = out[k].v[j];
    }
    return result.allFinite();
}

Eigen::VectorXd variancesOf(const Problem& problem, const Block& block)
{
    Eigen::VectorXd variances(static_cast<Eigen::Index>(block.observations.size()));
    for (Eigen::Index i = 0; i < variances.size(); ++i)
        variances[i] = problem.observations[block.observations[i]].variance;
    return variances;
}

/// A block with derivatives by observations and unknowns.
std::optional<Linear> linearisedAs(const Evaluation& at,
                                   const Block& block,
                                   const View<ObservationJet>& still,
                                   const View<UnknownJet>& moving)
{
    Linear linear;
    if (!byObservations(at, block, still, linear)) return std::nullopt;
    if (!byUnknowns(at, block, moving, linear.by_unknowns)) return std::nullopt;
    return linear;
}

}  // namespace

std::vector<Block> blocksOf(const Problem& problem)
{
    std::vector<int> parent(problem.observations.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int i) {
        while (parent[i] != i)
            i = parent[i] = parent[parent[i]];
        return i;
    };
    for (const Constraint& constraint : problem.constraints)
        if (constraint.used)
            for (const int other : constraint.observations)
                parent[root(other)] = root(constraint.observations.front());
    std::vector<Block> blocks;
    std::vector<int> block_of(problem.observations.size(), -1);
    for (std::size_t i = 0; i < problem.constraints.size(); ++i) {
        const Constraint& constraint = problem.constraints[i];
        if (!constraint.used) continue;
        int& at = block_of[root(constraint.observations.front())];
        if (at < 0) {
            at = static_cast<int>(blocks.size());
            blocks.emplace_back();
        }
        blocks[at].constraints.push_back(static_cast<int>(i));
        blocks[at].rows += constraint.rows;
        for (const int one : constraint.observations) {
            auto& known = blocks[at].observations;
            if (std::find(known.begin(), known.end(), one) == known.end()) known.push_back(one);
        }
    }
    return blocks;
}

bool settle(Evaluation& at)
{
    const View<ObservationJet> view = viewOf<ObservationJet>(at.problem, at.state);
    at.cost = 0.0;
    Linear linear;
    for (const Block& block : at.blocks) {
        const Eigen::VectorXd variances = variancesOf(at.problem, block);
        double cost = 0.0;
        for (int pass = 0; pass < kInnerPasses; ++pass) {
            if (!byObservations(at, block, view, linear)) return false;
            const Eigen::MatrixXd spread = variances.asDiagonal() * linear.by_observed.transpose();
            const Eigen::LLT<Eigen::MatrixXd> factor(linear.by_observed * spread);
            if (factor.info() != Eigen::Success) return false;
            const Eigen::VectorXd multipliers = factor.solve(linear.values);
            cost = linear.values.dot(multipliers);
            const Eigen::VectorXd shift = spread * multipliers;
            for (std::size_t i = 0; i < block.observations.size(); ++i)
                at.settled[block.observations[i]] =
                    at.problem.observations[block.observations[i]].value - shift[i];
        }
        at.cost += cost;
    }
    return std::isfinite(at.cost);
}

std::optional<Linear> linearised(const Evaluation& at, const Block& block)
{
    return linearisedAs(
        at, block, viewOf<ObservationJet>(at.problem, at.state), movingView(at.problem, at.state));
}

Eigen::MatrixXd covarianceOf(const Evaluation& at, const Block& block, const Linear& linear)
{
    return linear.by_observed * variancesOf(at.problem, block).asDiagonal() *
           linear.by_observed.transpose();
}

std::optional<Normal> normalEquations(const Evaluation& at)
{
    const View<ObservationJet> still = viewOf<ObservationJet>(at.problem, at.state);
    const View<UnknownJet> moving = movingView(at.problem, at.state);
    Normal normal;
    for (const Block& block : at.blocks) {
        const auto linear = linearisedAs(at, block, still, moving);
        if (!linear) return std::nullopt;
        const Eigen::LLT<Eigen::MatrixXd> factor(covarianceOf(at, block, *linear));
        if (factor.info() != Eigen::Success) return std::nullopt;
        const Eigen::MatrixXd whitened = factor.matrixL().solve(linear->by_unknowns);
        const Eigen::VectorXd values = factor.matrixL().solve(linear->values);
        normal.information += whitened.transpose() * whitened;
        normal.gradient += whitened.transpose() * values;
    }
    return normal;
}

}  // namespace insitu::calibration
