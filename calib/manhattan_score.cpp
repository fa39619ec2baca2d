#include "calib/manhattan_search.h"

#include <Eigen/Dense>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu::manhattan {

namespace {

/// Shares of the segments that are clutter and of each axis, before looking. In furnished rooms a
/// third to a half of the edges follow no axis.
constexpr double kClutter = 0.4;
constexpr double kAxis = 0.2;
/// Segments of this share of the long side and more count fully.
constexpr double kFullLength = 0.12;
constexpr double kLeastWeight = 0.2;
/// Limits of the slack: lens distortion and edges that are not quite parallel.
constexpr double kLeastSlack = glm::radians(0.12);
constexpr double kMostSlack = glm::radians(0.5);

/// Before looking: photographs of rooms are taken upright, with 14 to 54 mm (36 mm film), about
/// level. Wide, and used to choose between candidates only, never in the estimate.
constexpr double kUsualFocal = 0.75;  ///< of the long side
constexpr double kFocalSpread = 0.35;
constexpr double kRollSpread = glm::radians(5.0);
constexpr double kPitchSpread = glm::radians(15.0);

/// Logarithm of a Student-like density with heavy tails, 0 at its middle.
double heavyTailed(double u)
{
    return -2.0 * std::log1p(u * u / 4.0);
}

double beforehand(const Task& task, const Frame& frame)
{
    // The upright axis is the one most along the picture's y.
    int up = 0;
    for (int k = 1; k < 3; ++k)
        if (std::abs(frame.axes[k].y) > std::abs(frame.axes[up].y)) up = k;
    const glm::dvec3 d = frame.axes[up];
    double sum = 0.0;
    if (task.up) {
        const double off =
            std::acos(std::min(1.0, std::abs(glm::dot(d, glm::normalize(task.up->up)))));
        sum = heavyTailed(off / task.up->sigma_rad);
    } else {
        const double roll = std::atan2(d.x, std::abs(d.y)) * (d.y < 0.0 ? -1.0 : 1.0);
        const double pitch = std::asin(std::clamp(d.z, -1.0, 1.0));
        sum = heavyTailed(roll / kRollSpread) + heavyTailed(pitch / kPitchSpread);
    }
    const FocalPrior usual{kUsualFocal * task.long_side, kFocalSpread};
    const FocalPrior& prior = task.prior ? *task.prior : usual;
    const double u = std::log(frame.focal_px / prior.focal_px) / prior.sigma;
    return sum - 0.5 * u * u;
}

/// Densities of the angle under each axis over that of any direction, times the shares.
std::array<double, 3> ratios(const Observation& segment, const Frame& frame)
{
    const double sigma = std::hypot(segment.sigma, frame.slack);
    std::array<double, 3> values{};
    for (int k = 0; k < 3; ++k) {
        const double u = missAngle(segment, frame.axes[k], frame.focal_px) / sigma;
        // π N(ε): the uniform density over directions is 1/π.
        values[static_cast<std::size_t>(k)] =
            kAxis * std::sqrt(0.5 * glm::pi<double>()) / sigma * std::exp(-0.5 * u * u);
    }
    return values;
}

Frame turned(const Frame& frame, const Eigen::Vector4d& step)
{
    const glm::dvec3 turn(step(0), step(1), step(2));
    const double angle = glm::length(turn);
    Frame moved = frame;
    if (angle > 0.0) moved.axes = glm::mat3_cast(glm::angleAxis(angle, turn / angle)) * frame.axes;
    moved.focal_px = frame.focal_px * std::exp(step(3));
    return moved;
}

using Shares = std::vector<std::array<double, 3>>;

Shares sharesOf(const Task& task, const Frame& frame)
{
    Shares shares(task.observations.size());
    for (std::size_t i = 0; i < shares.size(); ++i)
        shares[i] = memberships(task.observations[i], frame);
    return shares;
}

/// Normal equations of the expected squared angles, by turns and ln f.
struct Normal {
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
    Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
};

Normal normalEquations(const Task& task, const Frame& frame, const Shares& shares)
{
    constexpr double kDifference = 1e-6;
    Normal normal;
    std::array<Frame, 8> moved;
    for (int p = 0; p < 4; ++p)
        for (int sign = 0; sign < 2; ++sign) {
            Eigen::Vector4d step = Eigen::Vector4d::Zero();
            step(p) = sign == 0 ? kDifference : -kDifference;
            moved[static_cast<std::size_t>(2 * p + sign)] = turned(frame, step);
        }
    for (std::size_t i = 0; i < task.observations.size(); ++i) {
        const Observation& segment = task.observations[i];
        const double sigma = std::hypot(segment.sigma, frame.slack);
        for (int k = 0; k < 3; ++k) {
            const double weight =
                segment.weight * shares[i][static_cast<std::size_t>(k)] / (sigma * sigma);
            if (weight * sigma * sigma < 1e-4) continue;
            Eigen::Vector4d derivative;
            for (std::size_t p = 0; p < 4; ++p)
                derivative(static_cast<Eigen::Index>(p)) =
                    (missAngle(segment, moved[2 * p].axes[k], moved[2 * p].focal_px) -
                     missAngle(segment, moved[2 * p + 1].axes[k], moved[2 * p + 1].focal_px)) /
                    (2.0 * kDifference);
            normal.information += weight * derivative * derivative.transpose();
            normal.gradient +=
                weight * derivative * missAngle(segment, frame.axes[k], frame.focal_px);
        }
    }
    return normal;
}

/// One Gauss–Newton step.
Eigen::Vector4d newtonStep(const Task& task, const Frame& frame, const Shares& shares)
{
    Normal normal = normalEquations(task, frame, shares);
    normal.information += Eigen::Matrix4d::Identity() * 1e-3;
    if (task.prior) {
        const double precision = 1.0 / (task.prior->sigma * task.prior->sigma);
        normal.information(3, 3) += precision;
        normal.gradient(3) += precision * std::log(frame.focal_px / task.prior->focal_px);
    } else {
        // Keeps an open focal length where it is.
        normal.information(3, 3) += 25.0;
    }
    Eigen::Vector4d step = -normal.information.ldlt().solve(normal.gradient);
    const double size = step.norm();
    if (size > 0.1) step *= 0.1 / size;
    return step;
}

double slackOf(const Task& task, const Frame& frame, const Shares& shares)
{
    double sum = 0.0;
    double count = 1e-9;
    for (std::size_t i = 0; i < task.observations.size(); ++i)
        for (int k = 0; k < 3; ++k) {
            const Observation& segment = task.observations[i];
            const double weight = segment.weight * shares[i][static_cast<std::size_t>(k)];
            const double miss = missAngle(segment, frame.axes[k], frame.focal_px);
            sum += weight * std::max(0.0, miss * miss - segment.sigma * segment.sigma);
            count += weight;
        }
    return std::clamp(std::sqrt(sum / count), kLeastSlack, kMostSlack);
}

}  // namespace

Task makeTask(const std::vector<DetectedSegment>& segments,
              int width,
              int height,
              const std::optional<FocalPrior>& prior)
{
    Task task;
    task.long_side = std::max(width, height);
    task.prior = prior;
    const glm::dvec2 center(0.5 * width, 0.5 * height);
    for (const DetectedSegment& segment : segments) {
        Observation one;
        one.middle = 0.5 * (segment.from_px + segment.to_px) - center;
        one.length = segment.length();
        one.along = (segment.to_px - segment.from_px) / one.length;
        one.sigma = std::sqrt(2.0) * segment.sigma_px / one.length;
        one.weight = std::clamp(one.length / (kFullLength * task.long_side), kLeastWeight, 1.0);
        task.observations.push_back(one);
    }
    return task;
}

double missAngle(const Observation& segment, glm::dvec3 direction, double focal_px)
{
    const glm::dvec2 toward = focal_px * glm::dvec2(direction) - segment.middle * direction.z;
    const double norm = std::sqrt(glm::dot(toward, toward) + 1e-18 * focal_px * focal_px);
    // The sign does not depend on which of the two ways the vanishing point lies.
    const double cross = toward.x * segment.along.y - toward.y * segment.along.x;
    const double dot = glm::dot(toward, segment.along);
    return (dot < 0.0 ? -cross : cross) / norm;
}

std::array<double, 3> memberships(const Observation& segment, const Frame& frame)
{
    std::array<double, 3> values = ratios(segment, frame);
    const double sum = kClutter + values[0] + values[1] + values[2];
    for (double& value : values)
        value /= sum;
    return values;
}

double evidence(const Task& task, const Frame& frame)
{
    double sum = beforehand(task, frame);
    for (const Observation& segment : task.observations) {
        const auto values = ratios(segment, frame);
        sum += segment.weight * std::log(kClutter + values[0] + values[1] + values[2]);
    }
    return sum;
}

Frame refined(const Task& task, Frame start)
{
    Frame frame = start;
    for (int round = 0; round < 25; ++round) {
        const Shares shares = sharesOf(task, frame);
        const Eigen::Vector4d step = newtonStep(task, frame, shares);
        frame = turned(frame, step);
        frame.focal_px = std::clamp(
            frame.focal_px, kShortestLens * task.long_side, kLongestLens * task.long_side);
        frame.slack = std::max(slackOf(task, frame, shares), 0.8 * frame.slack);
        if (step.norm() < 1e-7) break;
    }
    frame.score = evidence(task, frame);
    return frame;
}

double focalSigma(const Task& task, const Frame& frame)
{
    const Normal normal = normalEquations(task, frame, sharesOf(task, frame));
    const Eigen::Matrix4d& all = normal.information;
    // What is left of its own information when the turns adapt.
    const Eigen::Vector3d mixed = all.block<3, 1>(0, 3);
    const Eigen::Matrix3d turns =
        all.topLeftCorner<3, 3>() + 1e-9 * all.trace() * Eigen::Matrix3d::Identity();
    const double left = all(3, 3) - mixed.dot(turns.ldlt().solve(mixed));
    return left > 0.0 ? 1.0 / std::sqrt(left) : std::numeric_limits<double>::infinity();
}

double axesApart(const Frame& a, const Frame& b)
{
    double least = 1.0;
    for (int i = 0; i < 3; ++i) {
        double best = 0.0;
        for (int k = 0; k < 3; ++k)
            best = std::max(best, std::abs(glm::dot(a.axes[i], b.axes[k])));
        least = std::min(least, best);
    }
    return std::acos(std::min(1.0, least));
}

}  // namespace insitu::manhattan
