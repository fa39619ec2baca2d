#pragma once

#include "calib/orientation.h"

#include <Eigen/Core>

#include <optional>
#include <vector>

/// Internal to calib/: the least-squares problem behind solveOrientation. Not installed.
namespace insitu::orientation {

/// A point of the picture at which one or more segments end, relative to the principal point.
struct EndPoint {
    glm::dvec2 place{0.0};  ///< mean of the marked ends
    int ends = 1;           ///< how many were marked there
};

/// A segment between two end points.
struct Edge {
    int axis = 0;
    int from = 0;
    int to = 0;
};

struct Task {
    std::vector<EndPoint> points;
    std::vector<Edge> edges;
    double sigma_px = 1.0;
    std::optional<FocalPrior> prior;
    double long_side = 0.0;
    /// Σ |marked end − its point|²/σ²: the part of χ² that corners cost whatever the camera is.
    double spread = 0.0;
};

struct Pose {
    glm::dmat3 camera_from_world{1.0};
    double focal_px = 0.0;
};

struct Refined {
    Pose at;
    double cost = 0.0;  ///< half the sum of squared residuals, the prior's included
};

/// Focal lengths beyond these multiples of the picture's long side are no lens (170° and 2°).
inline constexpr double kShortestFocal = 0.05;
inline constexpr double kLongestFocal = 30.0;

/// The segments as a task. With `Corners::Shared`, ends of different axes that lie within the
/// marking error of each other become one point.
[[nodiscard]] Task makeTask(const LineSet& lines,
                            glm::dvec2 principal_px,
                            double sigma_px,
                            const std::optional<FocalPrior>& prior,
                            Corners corners);

/// Signed distance of an edge's end from the line through its middle and its vanishing point, px.
[[nodiscard]] double endDistance(const Task& task, const Edge& edge, const Pose& at);

/// Half the sum of squares with every segment on its own.
[[nodiscard]] double roughCost(const Task& task, const Pose& at);
/// Levenberg–Marquardt from a start with every segment on its own. Nothing when it fails.
[[nodiscard]] std::optional<Refined> refineRoughly(const Task& task, const Pose& start);
/// The same with the full covariance of the distances, which edges with a common corner share.
[[nodiscard]] std::optional<Refined> refineFully(const Task& task, const Pose& start);
/// JᵀJ of the segments over (rotation vector, ln focal), with the full covariance.
[[nodiscard]] Eigen::Matrix4d linesInformation(const Task& task, const Pose& at);

}  // namespace insitu::orientation
