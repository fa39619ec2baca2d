#include "calib/camera_fit.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace insitu::calibration {

namespace {

/// w-statistic of a segment that runs elsewhere: one good segment in 150 000 passes.
constexpr double kOutlierSigmas = 4.5;
/// At the start, errors of this many robust standard deviations are set aside at once.
constexpr double kGrossSigmas = 12.0;
/// Of each axis' segments, one in this many may be an outlier.
constexpr int kOutlierShare = 3;
/// More than this one by one would be noise, or a picture of something else.
constexpr int kMostRemoved = 12;
/// A contradiction of scale counts from this many standard deviations and this share on.
constexpr double kLengthSigmas = 3.0;
constexpr double kLengthShare = 0.02;
/// While lengths are not trusted yet, they count with this share as standard deviation.
constexpr double kLooseLength = 0.1;
/// Normal quantile of the test for consistent errors (one in a thousand).
constexpr double kConsistencyQuantile = 3.09;

/// Largest χ² that n degrees of freedom explain (Wilson–Hilferty).
double chiSquaredLimit(double freedom)
{
    const double spread = 2.0 / (9.0 * freedom);
    return freedom * std::pow(1.0 - spread + kConsistencyQuantile * std::sqrt(spread), 3.0);
}

bool consistent(const Fit& fit)
{
    return fit.freedom < 1.0 || fit.cost <= chiSquaredLimit(fit.freedom);
}

std::optional<Fit> solveAs(const LineSet& lines, const State& start, const Choice& choice)
{
    const Posed posed = pose(lines, choice);
    auto solution = solve(posed.problem, start);
    if (!solution) return std::nullopt;
    Fit fit;
    fit.cost = solution->cost + posed.corner_cost;
    fit.freedom = solution->freedom + posed.corner_freedom;
    fit.solution = std::move(*solution);
    fit.choice = choice;
    fit.free = posed.problem.free;
    return fit;
}

/// With common corners; without them when they contradict the lines: ends that only look like one.
std::optional<Fit> solveOnce(const LineSet& lines, const State& start, Choice choice)
{
    auto together = solveAs(lines, start, choice);
    if (!choice.shared_corners || (together && consistent(*together))) return together;
    choice.shared_corners = false;
    return solveAs(lines, together ? together->solution.state : start, choice);
}

/// How many more segments of a segment's axis may be left out.
bool maySpare(const LineSet& lines, const std::vector<bool>& used, std::size_t segment)
{
    int all = 0;
    int out = 0;
    for (std::size_t i = 0; i < used.size(); ++i) {
        if (lines.segments[i].axis != lines.segments[segment].axis) continue;
        ++all;
        out += used[i] ? 0 : 1;
    }
    return (out + 1) * kOutlierShare <= all;
}

/// Sets aside what is far off at the robust start, so that it bends no solve.
void setGrossAside(const LineSet& lines, const State& start, Choice& choice)
{
    std::vector<double> errors;
    for (std::size_t i = 0; i < lines.segments.size(); ++i)
        errors.push_back(endDistance(lines, i, start));
    std::vector<double> sorted = errors;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    const double scale = std::max(choice.sigma_px, 1.4826 * sorted[sorted.size() / 2]);
    for (;;) {
        std::size_t worst = errors.size();
        for (std::size_t i = 0; i < errors.size(); ++i)
            if (choice.used_segments[i] && errors[i] > kGrossSigmas * scale &&
                (worst == errors.size() || errors[i] > errors[worst]) &&
                maySpare(lines, choice.used_segments, i))
                worst = i;
        if (worst == errors.size()) return;
        choice.used_segments[worst] = false;
    }
}

/// Largest statistic of a segment's equations.
std::vector<double> segmentTests(const LineSet& lines, const Fit& fit)
{
    std::vector<double> tests(lines.segments.size(), 0.0);
    const Posed posed = pose(lines, fit.choice);
    for (std::size_t i = 0; i < posed.problem.constraints.size(); ++i) {
        const Constraint& constraint = posed.problem.constraints[i];
        const bool of_segment =
            constraint.kind == Kind::AlongAxis || constraint.kind == Kind::StraightLine;
        if (!of_segment || constraint.item < 0) continue;
        double& test = tests[constraint.item];
        test = std::max(test, fit.solution.tests[i].statistic);
    }
    return tests;
}

std::optional<Fit> withoutOutliers(const LineSet& lines, const State& start, Choice choice)
{
    setGrossAside(lines, start, choice);
    auto fit = solveOnce(lines, start, choice);
    // Leave out one by one, the worst first.
    for (int removed = 0; removed < kMostRemoved && fit; ++removed) {
        const std::vector<double> tests = segmentTests(lines, *fit);
        std::size_t worst = tests.size();
        for (std::size_t i = 0; i < tests.size(); ++i)
            if (choice.used_segments[i] && tests[i] > kOutlierSigmas &&
                (worst == tests.size() || tests[i] > tests[worst]) &&
                maySpare(lines, choice.used_segments, i))
                worst = i;
        if (worst == tests.size()) break;
        choice.used_segments[worst] = false;
        fit = solveOnce(lines, fit->solution.state, choice);
    }
    if (!fit) return std::nullopt;
    // Judge them by the noise that the others show, and take back what that explains.
    const double noise =
        fit->freedom < 1.0 ? 1.0 : std::max(1.0, std::sqrt(fit->cost / fit->freedom));
    const std::vector<double> tests = segmentTests(lines, *fit);
    std::vector<std::size_t> outliers;
    for (std::size_t i = 0; i < tests.size(); ++i) {
        if (choice.used_segments[i]) continue;
        choice.used_segments[i] = tests[i] < kOutlierSigmas * noise;
        if (!choice.used_segments[i]) outliers.push_back(i);
    }
    if (choice.used_segments != fit->choice.used_segments)
        fit = solveOnce(lines, fit->solution.state, choice);
    if (fit) fit->outliers = std::move(outliers);
    return fit;
}

/// The shares by which lengths come out longer than given.
std::vector<double> lengthsOff(const LineSet& lines, const State& at)
{
    std::vector<double> off;
    for (const KnownLength& length : lines.lengths) {
        const auto measured = measuredLength(lines, length, at);
        off.push_back(measured ? *measured / length.metres - 1.0 : 0.0);
    }
    return off;
}

/// Lengths at full weight, but for those that contradict the rest.
std::optional<Fit> withLengths(const LineSet& lines, Fit loose)
{
    const std::vector<double> off = lengthsOff(lines, loose.solution.state);
    Choice choice = loose.choice;
    for (std::size_t i = 0; i < lines.lengths.size(); ++i)
        choice.length_sigmas_m[i] = lines.lengths[i].sigma_m;
    auto tight = solveOnce(lines, loose.solution.state, choice);
    if (!tight) return std::nullopt;
    std::vector<std::size_t> contradicting;
    const Posed posed = pose(lines, tight->choice);
    for (std::size_t i = 0; i < posed.problem.constraints.size(); ++i) {
        const Constraint& one = posed.problem.constraints[i];
        if (one.kind != Kind::FloorLength && one.kind != Kind::UprightLength) continue;
        const double share = std::abs(off[one.item]);
        if (tight->solution.tests[i].statistic < kLengthSigmas || share < kLengthShare) continue;
        contradicting.push_back(static_cast<std::size_t>(one.item));
        choice.length_sigmas_m[one.item] =
            std::max(kLooseLength, share) * lines.lengths[one.item].metres;
    }
    auto result =
        contradicting.empty() ? std::move(tight) : solveOnce(lines, loose.solution.state, choice);
    if (!result) return std::nullopt;
    result->outliers = loose.outliers;
    result->contradicting_lengths = std::move(contradicting);
    return result;
}

}  // namespace

View<double> viewAt(const LineSet& lines, const State& at)
{
    View<double> view;
    view.camera_from_world = at.camera_from_world;
    view.log_focal = at.log_focal;
    view.focal = std::exp(at.log_focal);
    view.principal = at.principal_px;
    view.division = at.division;
    view.square_half_diagonal = 0.25 * (static_cast<double>(lines.width) * lines.width +
                                        static_cast<double>(lines.height) * lines.height);
    view.position = at.position_m;
    return view;
}

double endDistance(const LineSet& lines, std::size_t index, const State& at)
{
    const LineSegment& segment = lines.segments[index];
    const double x[4] = {segment.from_px.x, segment.from_px.y, segment.to_px.x, segment.to_px.y};
    double error = 0.0;
    if (!alongAxis(viewAt(lines, at), static_cast<int>(segment.axis), x, &error)) return 0.0;
    // The error is that of both ends together, √2 times that of each.
    return std::abs(error) / std::sqrt(2.0);
}

std::optional<double> measuredLength(const LineSet& lines,
                                     const KnownLength& length,
                                     const State& at)
{
    const double x[4] = {length.from_px.x, length.from_px.y, length.to_px.x, length.to_px.y};
    const View<double> view = viewAt(lines, at);
    double per_height = 0.0;
    const bool seen = length.on == KnownLength::On::Floor ? floorLength(view, x, per_height)
                                                          : uprightLength(view, x, per_height);
    if (!seen || !std::isfinite(per_height)) return std::nullopt;
    return per_height * at.position_m[1];
}

double divisionScore(const Fit& fit)
{
    std::array<bool, kUnknowns> free = fit.free;
    free[kDivision] = true;
    const double variance = covarianceOf(fit.solution.information, free)(kDivision, kDivision);
    if (!std::isfinite(variance)) return 0.0;
    // The others' gradient is zero at the solution, so that the step is −C g of λ alone.
    return std::abs(fit.solution.division_gradient) * std::sqrt(variance);
}

std::optional<Fit> fit(const LineSet& lines, const State& start, Choice choice)
{
    choice.used_segments.assign(lines.segments.size(), true);
    choice.length_sigmas_m.clear();
    for (const KnownLength& length : lines.lengths)
        choice.length_sigmas_m.push_back(std::max(length.sigma_m, kLooseLength * length.metres));
    auto result = withoutOutliers(lines, start, choice);
    if (result && !lines.lengths.empty()) result = withLengths(lines, std::move(*result));
    if (!result) return std::nullopt;
    if (!consistent(*result)) {
        Choice larger = result->choice;
        larger.sigma_px *= std::sqrt(result->cost / result->freedom);
        larger.shared_corners = false;
        auto again = solveAs(lines, result->solution.state, larger);
        if (!again) return std::nullopt;
        again->inconsistent = true;
        again->outliers = result->outliers;
        again->contradicting_lengths = result->contradicting_lengths;
        result = std::move(again);
    }
    result->lengths_off = lengthsOff(lines, result->solution.state);
    return result;
}

}  // namespace insitu::calibration
