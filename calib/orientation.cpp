#include "calib/orientation.h"

#include "calib/vanishing_points.h"

#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace insitu {

namespace {

/// Focal lengths beyond these multiples of the picture's long side are no lens (170° and 2°).
constexpr double kShortestFocal = 0.05;
constexpr double kLongestFocal = 30.0;
/// Starts for the focal length, in long sides: fish-eye to long tele.
constexpr double kFocalStarts[] = {0.4, 0.6, 0.85, 1.2, 1.8, 3.0, 6.0};
constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// A segment relative to the principal point.
struct CentredSegment {
    int axis;
    glm::dvec2 middle;
    glm::dvec2 half;
};

/// Signed distance of the segment's ends from the line through its middle and the vanishing point
/// of the axis' direction (in the camera's frame).
template <typename T>
T endDistance(const CentredSegment& segment, const T* direction, const T& focal)
{
    const T tx = focal * direction[0] - segment.middle.x * direction[2];
    const T ty = focal * direction[1] - segment.middle.y * direction[2];
    // Only a vanishing point in the very middle of its own segment makes t zero; the tiny term
    // keeps the derivative finite there.
    const T norm = sqrt(tx * tx + ty * ty + 1e-24 * focal * focal);
    return (tx * segment.half.y - ty * segment.half.x) / norm;
}

/// Normalised residual of one segment over (rotation vector, ln focal).
struct SegmentCost {
    CentredSegment segment;
    glm::dvec3 direction;  ///< the axis at the current rotation
    double sigma_px;

    template <typename T>
    bool operator()(const T* const parameters, T* residual) const
    {
        using std::exp;
        using std::sqrt;
        const T start[3] = {T(direction.x), T(direction.y), T(direction.z)};
        T turned[3];
        ceres::AngleAxisRotatePoint(parameters, start, turned);
        residual[0] =
            endDistance(segment, turned, T(exp(parameters[3]))) * (std::numbers::sqrt2 / sigma_px);
        return true;
    }
};

struct PriorCost {
    FocalPrior prior;

    template <typename T>
    bool operator()(const T* const parameters, T* residual) const
    {
        residual[0] = (parameters[3] - std::log(prior.focal_px)) / prior.sigma;
        return true;
    }
};

struct Task {
    std::vector<CentredSegment> segments;
    double sigma_px;
    std::optional<FocalPrior> prior;
    double long_side;
};

struct Start {
    glm::dmat3 camera_from_world{1.0};
    double focal_px = 0.0;
};

glm::dmat3 rotationFrom(const double* rotation_vector)
{
    double m[9];
    ceres::AngleAxisToRotationMatrix(rotation_vector, m);  // column-major, as GLM
    return glm::dmat3(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]);
}

void addResiduals(const Task& task,
                  const glm::dmat3& camera_from_world,
                  double* parameters,
                  bool with_prior,
                  ceres::Problem& problem)
{
    for (const CentredSegment& segment : task.segments)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SegmentCost, 1, 4>(new SegmentCost{
                                     segment, camera_from_world[segment.axis], task.sigma_px}),
                                 nullptr,
                                 parameters);
    if (with_prior && task.prior)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PriorCost, 1, 4>(new PriorCost{*task.prior}),
            nullptr,
            parameters);
}

/// Half the sum of squared residuals at a start.
double costAt(const Task& task, const Start& start)
{
    double sum = 0.0;
    for (const CentredSegment& segment : task.segments) {
        const glm::dvec3 d = start.camera_from_world[segment.axis];
        const double direction[3] = {d.x, d.y, d.z};
        const double distance = endDistance(segment, direction, start.focal_px);
        sum += 2.0 * distance * distance / (task.sigma_px * task.sigma_px);
    }
    if (task.prior) {
        const double r = std::log(start.focal_px / task.prior->focal_px) / task.prior->sigma;
        sum += r * r;
    }
    return 0.5 * sum;
}

struct Refined {
    Start at;
    double cost = kInfinite;
};

std::optional<Refined> refine(const Task& task, const Start& start)
{
    double parameters[4] = {0.0, 0.0, 0.0, std::log(start.focal_px)};
    ceres::Problem problem;
    addResiduals(task, start.camera_from_world, parameters, true, problem);
    problem.SetParameterLowerBound(parameters, 3, std::log(kShortestFocal * task.long_side));
    problem.SetParameterUpperBound(parameters, 3, std::log(kLongestFocal * task.long_side));
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-16;
    options.gradient_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable() || !std::isfinite(summary.final_cost)) return std::nullopt;
    return Refined{{rotationFrom(parameters) * start.camera_from_world, std::exp(parameters[3])},
                   summary.final_cost};
}

/// JᵀJ of the segments alone at the solution.
Eigen::Matrix4d linesInformation(const Task& task, const Start& at)
{
    double parameters[4] = {0.0, 0.0, 0.0, std::log(at.focal_px)};
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
    for (const CentredSegment& segment : task.segments) {
        const ceres::AutoDiffCostFunction<SegmentCost, 1, 4> cost(
            new SegmentCost{segment, at.camera_from_world[segment.axis], task.sigma_px});
        const double* blocks[] = {parameters};
        double residual = 0.0;
        Eigen::Vector4d gradient;
        double* jacobians[] = {gradient.data()};
        cost.Evaluate(blocks, &residual, jacobians);
        information += gradient * gradient.transpose();
    }
    return information;
}

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
    const Eigen::Matrix4d covariance =
        known ? Eigen::Matrix4d(solver.solve(Eigen::Matrix4d::Identity()))
              : Eigen::Matrix4d(kInfinite * Eigen::Vector4d::Ones().asDiagonal());
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

/// The best start at one focal length over all ordered pairs of axes.
std::optional<Start> bestStart(const Task& task,
                               const std::array<AxisLines, 3>& axes,
                               glm::dvec2 principal_px,
                               double focal_px)
{
    std::optional<Start> best;
    double best_cost = kInfinite;
    for (int first = 0; first < 3; ++first) {
        if (!axes[first].vanishing) continue;
        const glm::dvec3 a = axes[first].vanishing->direction(focal_px);
        for (int second = 0; second < 3; ++second) {
            if (second == first || axes[second].segments.empty()) continue;
            glm::dvec3 b(0.0);
            if (axes[second].vanishing) {
                b = axes[second].vanishing->direction(focal_px);
            } else {
                // One segment: its direction lies in its plane and is perpendicular to the first.
                const LineSegment& only = axes[second].segments.front();
                const glm::dvec3 normal =
                    glm::cross(glm::dvec3((only.from_px - principal_px) / focal_px, 1.0),
                               glm::dvec3((only.to_px - principal_px) / focal_px, 1.0));
                b = glm::cross(normal, a);
                if (glm::length(b) < 1e-9) continue;
                b = glm::normalize(b);
            }
            const auto rotation = rotationFromTwo(first, a, second, b);
            if (!rotation) continue;
            const Start start{*rotation, focal_px};
            const double cost = costAt(task, start);
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
    const double shortest = 1.01 * kShortestFocal * task.long_side;
    const double longest = 0.99 * kLongestFocal * task.long_side;
    for (double& focal : focals)
        focal = std::clamp(focal, shortest, longest);
    return focals;
}

OrientationEstimate describe(const Task& task, const Refined& refined)
{
    OrientationEstimate estimate;
    estimate.camera_from_world = refined.at.camera_from_world;
    estimate.focal_px = refined.at.focal_px;
    for (const CentredSegment& segment : task.segments) {
        const glm::dvec3 d = estimate.camera_from_world[segment.axis];
        const double direction[3] = {d.x, d.y, d.z};
        const double distance = std::abs(endDistance(segment, direction, estimate.focal_px));
        estimate.distances_px.push_back(distance);
        estimate.chi_squared += 2.0 * distance * distance / (task.sigma_px * task.sigma_px);
    }
    const double relative = estimate.focal_px / task.long_side;
    estimate.focal_at_limit = relative < 1.02 * kShortestFocal || relative > 0.98 * kLongestFocal;
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
                                                    const std::optional<FocalPrior>& prior)
{
    Task task{{}, sigma_px, prior, static_cast<double>(std::max(lines.width, lines.height))};
    std::array<AxisLines, 3> axes;
    for (const LineSegment& segment : lines.segments) {
        const int axis = static_cast<int>(segment.axis);
        axes[axis].segments.push_back(segment);
        task.segments.push_back({axis,
                                 0.5 * (segment.from_px + segment.to_px) - principal_px,
                                 0.5 * (segment.to_px - segment.from_px)});
    }
    for (AxisLines& axis : axes)
        axis.vanishing = vanishingPoint(axis.segments, principal_px, task.long_side);

    std::optional<Refined> best;
    for (const double focal_px : focalStarts(task, axes)) {
        const auto start = bestStart(task, axes, principal_px, focal_px);
        if (!start) continue;
        const auto refined = refine(task, *start);
        if (refined && (!best || refined->cost < best->cost)) best = refined;
    }
    if (!best) return std::nullopt;
    return describe(task, *best);
}

}  // namespace insitu
