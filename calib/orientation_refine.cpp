#include "calib/orientation_refine.h"

#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

namespace insitu::orientation {

namespace {

/// Two marks of one point differ by less than this many σ in 99 of 100 cases (Rayleigh, σ√2).
constexpr double kCornerSigmas = 4.3;
/// Re-weightings of the full problem; the weights hardly change after the first.
constexpr int kReweightings = 4;

template <typename T>
T distanceFromLine(const T from[2], const T to[2], const T* direction, const T& focal)
{
    const T half_x = 0.5 * (to[0] - from[0]);
    const T half_y = 0.5 * (to[1] - from[1]);
    const T tx = focal * direction[0] - 0.5 * (from[0] + to[0]) * direction[2];
    const T ty = focal * direction[1] - 0.5 * (from[1] + to[1]) * direction[2];
    // Only a vanishing point in the very middle of its own segment makes t zero; the tiny term
    // keeps the derivative finite there.
    const T norm = sqrt(tx * tx + ty * ty + 1e-24 * focal * focal);
    return (tx * half_y - ty * half_x) / norm;
}

/// Whitened distances of all edges over (rotation vector, ln focal).
struct EdgesCost {
    const Task& task;
    const Pose& at;
    const Eigen::MatrixXd& whitening;  ///< lower triangular

    template <typename T>
    bool operator()(T const* const* parameters, T* residuals) const
    {
        using std::exp;
        const T focal = exp(parameters[0][3]);
        std::vector<T> distances;
        for (const Edge& edge : task.edges) {
            const glm::dvec3 d = at.camera_from_world[edge.axis];
            const T start[3] = {T(d.x), T(d.y), T(d.z)};
            T turned[3];
            ceres::AngleAxisRotatePoint(parameters[0], start, turned);
            const glm::dvec2 a = task.points[edge.from].place;
            const glm::dvec2 b = task.points[edge.to].place;
            const T from[2] = {T(a.x), T(a.y)};
            const T to[2] = {T(b.x), T(b.y)};
            distances.push_back(distanceFromLine(from, to, turned, focal));
        }
        for (std::size_t row = 0; row < distances.size(); ++row) {
            residuals[row] = T(0.0);
            for (std::size_t column = 0; column <= row; ++column)
                residuals[row] += whitening(row, column) * distances[column];
        }
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

/// Inverse of the distances' standard deviation σ/√2, every edge on its own.
Eigen::MatrixXd roughWhitening(const Task& task)
{
    const auto count = static_cast<Eigen::Index>(task.edges.size());
    return Eigen::MatrixXd::Identity(count, count) * (std::sqrt(2.0) / task.sigma_px);
}

/// L⁻¹ with L Lᵀ = B Σ Bᵀ, B the derivative of the distances by the end points (automatic
/// differentiation) and Σ the end points' covariance σ²/ends.
Eigen::MatrixXd fullWhitening(const Task& task, const Pose& at)
{
    using Jet = ceres::Jet<double, 4>;
    const auto edges = static_cast<Eigen::Index>(task.edges.size());
    Eigen::MatrixXd by_points =
        Eigen::MatrixXd::Zero(edges, 2 * static_cast<Eigen::Index>(task.points.size()));
    for (Eigen::Index row = 0; row < edges; ++row) {
        const Edge& edge = task.edges[static_cast<std::size_t>(row)];
        const EndPoint& a = task.points[edge.from];
        const EndPoint& b = task.points[edge.to];
        const glm::dvec3 d = at.camera_from_world[edge.axis];
        const Jet from[2] = {Jet(a.place.x, 0), Jet(a.place.y, 1)};
        const Jet to[2] = {Jet(b.place.x, 2), Jet(b.place.y, 3)};
        const Jet direction[3] = {Jet(d.x), Jet(d.y), Jet(d.z)};
        const Jet distance = distanceFromLine(from, to, direction, Jet(at.focal_px));
        for (int k = 0; k < 2; ++k) {
            by_points(row, 2 * edge.from + k) += distance.v[k] / std::sqrt(a.ends);
            by_points(row, 2 * edge.to + k) += distance.v[2 + k] / std::sqrt(b.ends);
        }
    }
    const Eigen::MatrixXd covariance =
        by_points * by_points.transpose() * (task.sigma_px * task.sigma_px);
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    if (factor.info() != Eigen::Success) return roughWhitening(task);
    return factor.matrixL().solve(Eigen::MatrixXd::Identity(edges, edges));
}

std::unique_ptr<ceres::CostFunction> edgesCost(const Task& task,
                                               const Pose& at,
                                               const Eigen::MatrixXd& whitening)
{
    auto cost = std::make_unique<ceres::DynamicAutoDiffCostFunction<EdgesCost, 4>>(
        new EdgesCost{task, at, whitening});
    cost->AddParameterBlock(4);
    cost->SetNumResiduals(static_cast<int>(task.edges.size()));
    return cost;
}

std::optional<Refined> refine(const Task& task, const Pose& start, const Eigen::MatrixXd& whitening)
{
    double parameters[4] = {0.0, 0.0, 0.0, std::log(start.focal_px)};
    ceres::Problem problem;
    problem.AddResidualBlock(edgesCost(task, start, whitening).release(), nullptr, parameters);
    if (task.prior)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PriorCost, 1, 4>(new PriorCost{*task.prior}),
            nullptr,
            parameters);
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
    double m[9];
    ceres::AngleAxisToRotationMatrix(parameters, m);  // column-major, as GLM
    const glm::dmat3 turn(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]);
    return Refined{{turn * start.camera_from_world, std::exp(parameters[3])}, summary.final_cost};
}

struct End {
    std::size_t edge;
    bool is_to;
    glm::dvec2 place;
};

/// Indices of ends that were marked at one point: at most one of each axis, near each other.
std::vector<std::vector<std::size_t>> cornersOf(const Task& task,
                                                const std::vector<End>& ends,
                                                double radius)
{
    struct Pair {
        double distance;
        std::size_t a, b;
    };
    std::vector<Pair> pairs;
    for (std::size_t a = 0; a < ends.size(); ++a)
        for (std::size_t b = a + 1; b < ends.size(); ++b)
            if (const double d = glm::length(ends[a].place - ends[b].place); d < radius)
                pairs.push_back({d, a, b});
    std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& p, const Pair& q) {
        return p.distance < q.distance;
    });

    std::vector<std::vector<std::size_t>> groups(ends.size());
    std::vector<std::size_t> group_of(ends.size());
    for (std::size_t i = 0; i < ends.size(); ++i) {
        groups[i] = {i};
        group_of[i] = i;
    }
    const auto axis = [&](std::size_t end) { return task.edges[ends[end].edge].axis; };
    for (const Pair& pair : pairs) {
        auto& into = groups[group_of[pair.a]];
        auto& from = groups[group_of[pair.b]];
        const bool distinct = std::none_of(into.begin(), into.end(), [&](std::size_t i) {
            return std::any_of(
                from.begin(), from.end(), [&](std::size_t j) { return axis(i) == axis(j); });
        });
        if (!distinct) continue;
        for (const std::size_t moved : from) {
            into.push_back(moved);
            group_of[moved] = group_of[pair.a];
        }
        from.clear();
    }
    return groups;
}

}  // namespace

Task makeTask(const LineSet& lines,
              glm::dvec2 principal_px,
              double sigma_px,
              const std::optional<FocalPrior>& prior,
              Corners corners)
{
    Task task;
    task.sigma_px = sigma_px;
    task.prior = prior;
    task.long_side = std::max(lines.width, lines.height);
    std::vector<End> ends;
    for (const LineSegment& segment : lines.segments) {
        ends.push_back({task.edges.size(), false, segment.from_px - principal_px});
        ends.push_back({task.edges.size(), true, segment.to_px - principal_px});
        task.edges.push_back({static_cast<int>(segment.axis), 0, 0});
    }
    const double radius = corners == Corners::Shared ? kCornerSigmas * sigma_px : 0.0;
    for (const auto& group : cornersOf(task, ends, radius)) {
        if (group.empty()) continue;
        EndPoint point{glm::dvec2(0.0), static_cast<int>(group.size())};
        for (const std::size_t end : group)
            point.place += ends[end].place / static_cast<double>(group.size());
        for (const std::size_t end : group) {
            const glm::dvec2 off = ends[end].place - point.place;
            task.spread += glm::dot(off, off) / (sigma_px * sigma_px);
            Edge& edge = task.edges[ends[end].edge];
            (ends[end].is_to ? edge.to : edge.from) = static_cast<int>(task.points.size());
        }
        task.points.push_back(point);
    }
    return task;
}

double endDistance(const Task& task, const Edge& edge, const Pose& at)
{
    const glm::dvec2 a = task.points[edge.from].place;
    const glm::dvec2 b = task.points[edge.to].place;
    const glm::dvec3 d = at.camera_from_world[edge.axis];
    const double from[2] = {a.x, a.y};
    const double to[2] = {b.x, b.y};
    const double direction[3] = {d.x, d.y, d.z};
    return distanceFromLine(from, to, direction, at.focal_px);
}

double roughCost(const Task& task, const Pose& at)
{
    double sum = 0.0;
    for (const Edge& edge : task.edges) {
        const double distance = endDistance(task, edge, at);
        sum += 2.0 * distance * distance / (task.sigma_px * task.sigma_px);
    }
    if (task.prior) {
        const double off = std::log(at.focal_px / task.prior->focal_px) / task.prior->sigma;
        sum += off * off;
    }
    return 0.5 * sum;
}

std::optional<Refined> refineRoughly(const Task& task, const Pose& start)
{
    return refine(task, start, roughWhitening(task));
}

std::optional<Refined> refineFully(const Task& task, const Pose& start)
{
    Pose at = start;
    std::optional<Refined> refined;
    for (int i = 0; i < kReweightings; ++i) {
        refined = refine(task, at, fullWhitening(task, at));
        if (!refined) return std::nullopt;
        at = refined->at;
    }
    return refined;
}

Eigen::Matrix4d linesInformation(const Task& task, const Pose& at)
{
    const Eigen::MatrixXd whitening = fullWhitening(task, at);
    const auto cost = edgesCost(task, at, whitening);
    const double parameters[4] = {0.0, 0.0, 0.0, std::log(at.focal_px)};
    const double* blocks[] = {parameters};
    const auto edges = static_cast<Eigen::Index>(task.edges.size());
    Eigen::VectorXd residuals(edges);
    Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor> jacobian(edges, 4);
    double* jacobians[] = {jacobian.data()};
    cost->Evaluate(blocks, residuals.data(), jacobians);
    return jacobian.transpose() * jacobian;
}

}  // namespace insitu::orientation
