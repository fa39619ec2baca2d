#include "reconstruct/scene_linear.h"
#include "reconstruct/scene_solve_state.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Components of an open direction above this share name an unknown.
constexpr double kNamed = 0.1;
/// A direction of an observation that the others control by less than this is not tested.
constexpr double kUncontrolled = 1e-6;
/// Probability that a scene without contradictions is accused of one.
constexpr double kFalseAlarm = 0.01;
constexpr int kMaxConflicts = 10;
/// Share of the worst test value from which another constraint may be meant instead.
constexpr double kAlike = 0.8;

/// The value that the square of a normal variable, or the sum of two, exceeds with probability p.
double chiSquareQuantile(int degrees, double p)
{
    if (degrees == 2) return -2.0 * std::log(p);
    double low = 0.0;
    double high = 40.0;
    for (int i = 0; i < 80; ++i) {
        const double z = 0.5 * (low + high);
        (std::erfc(z / std::sqrt(2.0)) > p ? low : high) = z;
    }
    return low * low;
}

/// The same for many degrees of freedom, probability 0.01 [WilHil31].
double manyChiSquareQuantile(int degrees)
{
    constexpr double kNormal99 = 2.3263478740408408;
    const double k = degrees;
    const double cube = 1.0 - 2.0 / (9.0 * k) + kNormal99 * std::sqrt(2.0 / (9.0 * k));
    return k * cube * cube * cube;
}

/// Test of one equation against all others.
struct Test {
    double value = 0.0;  ///< χ² distributed when there is no contradiction
    int degrees = 0;     ///< 0: cannot be tested
    double redundancy = 0.0;
};

Test testEquation(const LinearSystem& system,
                  const Eigen::VectorXd& residuals,
                  const Determined& determined,
                  std::size_t equation,
                  int size)
{
    const auto rows = system.jacobian.middleRows(system.first_row[equation], size);
    const Eigen::MatrixXd rest =
        Eigen::MatrixXd::Identity(size, size) - rows * determined.covariance * rows.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(rest);
    const Eigen::VectorXd along =
        solver.eigenvectors().transpose() * residuals.segment(system.first_row[equation], size);
    Test test;
    for (int k = 0; k < size; ++k) {
        const double share = solver.eigenvalues()[k];
        test.redundancy += std::clamp(share, 0.0, 1.0) / size;
        if (share < kUncontrolled) continue;
        test.value += along[k] * along[k] / share;
        ++test.degrees;
    }
    return test;
}

/// Finds contradictions one by one: the worst is left out and the rest tested again.
class ConflictSearch {
public:
    ConflictSearch(const SceneState& state, LinearSystem system)
        : state_(state), system_(std::move(system)), active_(state.equations.size(), true)
    {
    }

    /// What is left when all contradictions are out.
    [[nodiscard]] double squares() const { return squares_; }
    [[nodiscard]] int taken() const { return taken_; }

    std::vector<Finding> run(const std::vector<Test>& first)
    {
        squares_ = system_.residuals.squaredNorm();
        std::vector<Finding> findings;
        std::vector<Test> tests = first;
        for (int round = 0; round < kMaxConflicts; ++round) {
            const std::size_t worst = worstOf(tests);
            if (worst == tests.size()) break;
            active_[worst] = false;
            const std::vector<Test> without = testRest(worst);
            std::string others;
            for (std::size_t e = 0; e < tests.size(); ++e)
                if (active_[e] && significant(tests[e]) && !significant(without[e]) &&
                    tests[e].value > kAlike * tests[worst].value)
                    others += fmt::format("{}\"{}\"", others.empty() ? "" : ", ", nameOf(e));
            const SceneEquation& equation = *state_.equations[worst];
            const double rms =
                system_.residuals.segment(system_.first_row[worst], equation.size).norm() /
                std::sqrt(static_cast<double>(equation.size));
            findings.push_back(
                {Severity::Warning,
                 "reconstruct-conflict",
                 fmt::format("\"{}\" contradicts the other constraints: it is {:.1f} standard "
                             "deviations off although the others give way to it{}",
                             nameOf(worst),
                             rms,
                             others.empty()
                                 ? std::string()
                                 : "; it could as well be " + others + " that is wrong")});
            tests = without;
        }
        return findings;
    }

private:
    [[nodiscard]] const std::string& nameOf(std::size_t equation) const
    {
        return state_.equations[equation]->name;
    }
    [[nodiscard]] bool significant(const Test& test) const
    {
        const double p = kFalseAlarm / static_cast<double>(state_.equations.size());
        return test.degrees > 0 && test.value > chiSquareQuantile(test.degrees, p);
    }
    [[nodiscard]] std::size_t worstOf(const std::vector<Test>& tests) const
    {
        std::size_t worst = tests.size();
        for (std::size_t e = 0; e < tests.size(); ++e)
            if (active_[e] && significant(tests[e]) &&
                (worst == tests.size() || tests[e].value > tests[worst].value))
                worst = e;
        return worst;
    }
    /// Takes an equation out, solves the rest linearly and tests it.
    std::vector<Test> testRest(std::size_t taken)
    {
        const int size = state_.equations[taken]->size;
        system_.jacobian.middleRows(system_.first_row[taken], size).setZero();
        Eigen::VectorXd kept = system_.residuals;
        for (std::size_t e = 0; e < active_.size(); ++e)
            if (!active_[e])
                kept.segment(system_.first_row[e], state_.equations[e]->size).setZero();
        const Determined determined(system_.jacobian);
        kept -= system_.jacobian * (determined.covariance * (system_.jacobian.transpose() * kept));
        squares_ = kept.squaredNorm();
        taken_ += size;
        std::vector<Test> tests(active_.size());
        for (std::size_t e = 0; e < active_.size(); ++e)
            if (active_[e])
                tests[e] = testEquation(system_, kept, determined, e, state_.equations[e]->size);
        return tests;
    }

    const SceneState& state_;
    LinearSystem system_;
    std::vector<bool> active_;
    double squares_ = 0.0;
    int taken_ = 0;
};

std::string listed(const std::vector<std::string>& names)
{
    constexpr std::size_t kListed = 12;
    std::string list;
    for (std::size_t i = 0; i < std::min(kListed, names.size()); ++i)
        list += fmt::format("{}{}", i ? ", " : "", names[i]);
    if (names.size() > kListed) list += fmt::format(" and {} more", names.size() - kListed);
    return list;
}

void findUndetermined(const SceneState& state, const Determined& determined, Findings& findings)
{
    std::vector<std::string> names;
    for (std::size_t u = 0; u < state.values.size(); ++u)
        if (determined.open.cols() > 0 &&
            determined.open.row(static_cast<Eigen::Index>(u)).norm() > kNamed)
            names.push_back(state.layout->unknowns()[u].label);
    if (determined.open.cols() > 0)
        findings.push_back(
            {Severity::Warning,
             "reconstruct-undetermined",
             fmt::format("{} number{} more than the constraints determine; left open: {}",
                         determined.open.cols(),
                         determined.open.cols() == 1 ? "" : "s",
                         listed(names))});
}

/// Standard deviations of all numbers, from those of the unknowns.
void fillSigmas(const SceneState& state, const Determined& determined, SceneEstimate& estimate)
{
    const Eigen::Index n = static_cast<Eigen::Index>(state.values.size());
    for (std::size_t i = 0; i < estimate.primitives.size(); ++i) {
        SolvedPrimitive& solved = estimate.primitives[i];
        const auto chain = state.layout->chain(i);
        const auto sigmaOf = [&](const ChainNumber& number) {
            Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
            for (std::size_t c = 0; c < chain.size(); ++c)
                gradient[static_cast<Eigen::Index>(chain[c])] =
                    number.gradient[static_cast<Eigen::Index>(c)];
            return determined.sigma(gradient);
        };
        for (std::size_t axis = 0; axis < 3; ++axis)
            solved.position_m[axis].sigma = sigmaOf(state.poses[i].position[axis]);
        solved.rotation_y_rad.sigma = sigmaOf(state.poses[i].turn);
        for (SolvedNumber& number : solved.parameters)
            number.sigma = 0.0;
        for (std::size_t u = 0; u < state.layout->unknownCount(i); ++u) {
            const std::size_t unknown = state.layout->firstUnknown(i) + u;
            const auto parameter = state.layout->unknowns()[unknown].parameter;
            if (!parameter) continue;
            Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
            gradient[static_cast<Eigen::Index>(unknown)] = 1.0;
            solved.parameters[*parameter].sigma = determined.sigma(gradient);
        }
    }
}

void findDoubtfulSizes(const SceneState& state, const SceneEstimate& estimate, Findings& findings)
{
    std::vector<std::string> weak;
    std::vector<std::string> at_bound;
    for (std::size_t u = 0; u < state.values.size(); ++u) {
        const SceneUnknown& unknown = state.layout->unknowns()[u];
        if (!unknown.parameter) continue;
        const SolvedNumber& number =
            estimate.primitives[unknown.primitive].parameters[*unknown.parameter];
        if (number.sigma && *number.sigma > 0.5 * std::abs(number.value))
            weak.push_back(
                fmt::format("{} = {:.3g} +- {:.2g}", unknown.label, number.value, *number.sigma));
        if (number.value <= unknown.minimum || number.value >= unknown.maximum)
            at_bound.push_back(fmt::format("{} = {:.3g}", unknown.label, number.value));
    }
    if (!weak.empty())
        findings.push_back({Severity::Warning,
                            "reconstruct-weak",
                            "sizes less certain than half of themselves: " + listed(weak)});
    if (!at_bound.empty())
        findings.push_back(
            {Severity::Warning,
             "reconstruct-at-bound",
             "sizes at their least or greatest value, where the constraints would drive them "
             "further: " +
                 listed(at_bound)});
}

}  // namespace

SceneEstimate analyseScene(const SceneState& state, std::span<const Camera> camera_errors)
{
    SceneEstimate estimate;
    estimate.solution = state.solution;
    if (!state.solution.converged)
        estimate.findings.push_back({Severity::Warning,
                                     "reconstruct-not-converged",
                                     fmt::format("the solution did not settle in {} iterations",
                                                 state.solution.iterations)});
    LinearSystem system = linearise(state);
    Determined determined(system.jacobian);
    determined.shifts = cameraShifts(state, system, determined, camera_errors);
    std::vector<Test> tests;
    for (std::size_t e = 0; e < state.equations.size(); ++e) {
        const SceneEquation& equation = *state.equations[e];
        tests.push_back(testEquation(system, system.residuals, determined, e, equation.size));
        const double rms = system.residuals.segment(system.first_row[e], equation.size).norm() /
                           std::sqrt(static_cast<double>(equation.size));
        estimate.constraints.push_back(
            {equation.name, rms * equation.sigma, rms, tests.back().redundancy});
    }
    estimate.unknowns = static_cast<int>(state.values.size());
    estimate.redundancy = static_cast<int>(system.residuals.size()) - estimate.unknowns +
                          static_cast<int>(determined.open.cols());
    const double squares = system.residuals.squaredNorm();
    if (estimate.redundancy > 0) estimate.variance_factor = squares / estimate.redundancy;

    for (const ScenePose& pose : state.poses) {
        SolvedPrimitive primitive;
        for (const double value : pose.parameters)
            primitive.parameters.push_back({value, {}});
        for (std::size_t axis = 0; axis < 3; ++axis)
            primitive.position_m[axis].value = pose.position[axis].value;
        primitive.rotation_y_rad.value = pose.turn.value;
        estimate.primitives.push_back(std::move(primitive));
    }
    fillSigmas(state, determined, estimate);
    findUndetermined(state, determined, estimate.findings);
    findDoubtfulSizes(state, estimate, estimate.findings);
    ConflictSearch search(state, std::move(system));
    const Findings conflicts = search.run(tests);
    const int rest = estimate.redundancy - search.taken();
    if (rest > 0 && search.squares() > manyChiSquareQuantile(rest))
        estimate.findings.push_back(
            {Severity::Warning,
             "reconstruct-residuals-large",
             fmt::format("the constraints are met {:.1f} times worse than their standard "
                         "deviations say, {}: the camera, a shape or sigma_px does not fit the "
                         "picture",
                         std::sqrt(search.squares() / rest),
                         conflicts.empty() ? "none of them alone"
                                           : "also without those that contradict the others")});
    append(estimate.findings, conflicts);
    return estimate;
}

}  // namespace insitu
