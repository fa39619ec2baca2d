#include "calib/orientation.h"

#include "calib/orientation_refine.h"
#include "calib/vanishing_points.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu {

namespace {

using orientation::Pose;
using orientation::Refined;
using orientation::Task;

/// Starts for the focal length, in long sides: fish-eye to long tele.
constexpr double kFocalStarts[] = {0.4, 0.6, 0.85, 1.2, 1.8, 3.0, 6.0};
constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Standard deviation of the last parameter, the others free (Schur complement).
double lastSigma(const Eigen::Matrix4d& information)
{
    const Eigen::Matrix3d rotation = information.topLeftCorner<3, 3>();
    const Eigen::Vector3d mixed = information.topRightCorner<3, 1>();
    const Eigen::LDLT<Eigen::Matrix3d> solver(rotation);
    if (solver.info() != Eigen::Success || !(solver.rcond() > 1e-14)) return kInfinite;
    const double left = information(3, 3) - mixed.dot(solver.solve(mixed));
    // Below the rounding error of the difference there is no information.
    return left > 1e-12 * information(3, 3) ? 1.0 / std::sqrt(left) : kInfinite;
}

void fillCovariance(const Task& task, OrientationEstimate& estimate)
{
    Eigen::Matrix4d information =
        linesInformation(task, {estimate.camera_from_world, estimate.focal_px});
    estimate.lines_focal_sigma = lastSigma(information);
    if (task.prior) information(3, 3) += 1.0 / (task.prior->sigma * task.prior->sigma);
    const Eigen::LDLT<Eigen::Matrix4d> solver(information);
    const bool known = solver.info() == Eigen::Success && solver.isPositive() &&
                       solver.rcond() > 1e-14 && std::isfinite(lastSigma(information));
    const Eigen::Matrix4d covariance = solver.solve(Eigen::Matrix4d::Identity());
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column)
            estimate.covariance[row][column] =
                known ? covariance(row, column) : (row == column ? kInfinite : 0.0);
}

/// Right-handed rotation from two directions for axes `first` and `second`: the first is kept.
std::optional<glm::dmat3> rotationFromTwo(int first, glm::dvec3 a, int second, glm::dvec3 b)
{
    const glm::dvec3 across = b - glm::dot(a, b) * a;
    if (glm::length(across) < 1e-6) return std::nullopt;
    glm::dmat3 result(0.0);
    result[first] = a;
    result[second] = glm::normalize(across);
    const int third = 3 - first - second;
    const bool cyclic = (first + 1) % 3 == second;
    result[third] = cyclic ? glm::cross(result[first], result[second])
                           : glm::cross(result[second], result[first]);
    return result;
}

/// What the solver can start from: a vanishing point per axis, and the segments of each.
struct AxisLines {
    std::optional<VanishingPoint> vanishing;
    std::vector<LineSegment> segments;
};

/// Direction of an axis at a focal length, `other` being that of an axis at right angles.
std::optional<glm::dvec3> directionBeside(const AxisLines& axis,
                                          glm::dvec3 other,
                                          glm::dvec2 principal_px,
                                          double focal_px)
{
    if (axis.vanishing) return axis.vanishing->direction(focal_px);
    if (axis.segments.empty()) return std::nullopt;
    // One segment: the direction lies in its plane and is perpendicular to the other.
    const LineSegment& only = axis.segments.front();
    const glm::dvec3 normal = glm::cross(glm::dvec3((only.from_px - principal_px) / focal_px, 1.0),
                                         glm::dvec3((only.to_px - principal_px) / focal_px, 1.0));
    const glm::dvec3 direction = glm::cross(normal, other);
    if (glm::length(direction) < 1e-9) return std::nullopt;
    return glm::normalize(direction);
}

/// The best start at one focal length over all ordered pairs of axes.
std::optional<Pose> bestStart(const Task& task,
                              const std::array<AxisLines, 3>& axes,
                              glm::dvec2 principal_px,
                              double focal_px)
{
    std::optional<Pose> best;
    double best_cost = kInfinite;
    for (int first = 0; first < 3; ++first) {
        if (!axes[first].vanishing) continue;
        const glm::dvec3 a = axes[first].vanishing->direction(focal_px);
        for (int second = 0; second < 3; ++second) {
            if (second == first) continue;
            const auto b = directionBeside(axes[second], a, principal_px, focal_px);
            const auto rotation = b ? rotationFromTwo(first, a, second, *b) : std::nullopt;
            if (!rotation) continue;
            const Pose start{*rotation, focal_px};
            const double cost = roughCost(task, start);
            if (cost < best_cost) {
                best_cost = cost;
                best = start;
            }
        }
    }
    return best;
}

std::vector<double> focalStarts(const Task& task, const std::array<AxisLines, 3>& axes)
{
    std::vector<double> focals;
    if (task.prior) focals.push_back(task.prior->focal_px);
    for (int a = 0; a < 3; ++a)
        for (int b = a + 1; b < 3; ++b)
            if (axes[a].vanishing && axes[b].vanishing)
                if (const auto f = focalFromOrthogonalPair(*axes[a].vanishing, *axes[b].vanishing))
                    focals.push_back(*f);
    for (const double factor : kFocalStarts)
        focals.push_back(factor * task.long_side);
    const double shortest = 1.01 * orientation::kShortestFocal * task.long_side;
    const double longest = 0.99 * orientation::kLongestFocal * task.long_side;
    for (double& focal : focals)
        focal = std::clamp(focal, shortest, longest);
    return focals;
}

OrientationEstimate describe(const Task& task, const Task& separate, const Refined& refined)
{
    OrientationEstimate estimate;
    estimate.camera_from_world = refined.at.camera_from_world;
    estimate.focal_px = refined.at.focal_px;
    for (const orientation::Edge& edge : separate.edges)
        estimate.distances_px.push_back(std::abs(endDistance(separate, edge, refined.at)));
    const double of_prior =
        task.prior ? std::log(estimate.focal_px / task.prior->focal_px) / task.prior->sigma : 0.0;
    estimate.chi_squared = 2.0 * refined.cost - of_prior * of_prior + task.spread;
    const double shared = static_cast<double>(separate.points.size() - task.points.size());
    estimate.freedom =
        static_cast<double>(task.edges.size()) + 2.0 * shared - (task.prior ? 3.0 : 4.0);
    const double relative = estimate.focal_px / task.long_side;
    estimate.focal_at_limit = relative < 1.02 * orientation::kShortestFocal ||
                              relative > 0.98 * orientation::kLongestFocal;
    fillCovariance(task, estimate);
    return estimate;
}

}  // namespace

double OrientationEstimate::focalSigma() const
{
    return std::sqrt(covariance[3][3]);
}

double OrientationEstimate::rotationSigma() const
{
    return std::sqrt(covariance[0][0] + covariance[1][1] + covariance[2][2]);
}

std::optional<OrientationEstimate> solveOrientation(const LineSet& lines,
                                                    glm::dvec2 principal_px,
                                                    double sigma_px,
                                                    const std::optional<FocalPrior>& prior,
                                                    Corners corners)
{
    const Task separate =
        orientation::makeTask(lines, principal_px, sigma_px, prior, Corners::Separate);
    std::array<AxisLines, 3> axes;
    for (const LineSegment& segment : lines.segments)
        axes[static_cast<std::size_t>(segment.axis)].segments.push_back(segment);
    for (AxisLines& axis : axes)
        axis.vanishing = vanishingPoint(axis.segments, principal_px, separate.long_side);

    std::optional<Refined> best;
    for (const double focal_px : focalStarts(separate, axes)) {
        const auto start = bestStart(separate, axes, principal_px, focal_px);
        if (!start) continue;
        const auto refined = refineRoughly(separate, *start);
        if (refined && (!best || refined->cost < best->cost)) best = refined;
    }
    if (!best) return std::nullopt;
    const Task task = corners == Corners::Separate
                          ? separate
                          : orientation::makeTask(lines, principal_px, sigma_px, prior, corners);
    const auto refined = refineFully(task, best->at);
    if (!refined) return std::nullopt;
    return describe(task, separate, *refined);
}

}  // namespace insitu
