#include "calib/orientation.h"

#include "calib/camera_constraints.h"
#include "calib/vanishing_points.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace insitu {

namespace {

/// Starts for the focal length, in long sides: fish-eye to long tele.
constexpr double kFocalStarts[] = {0.4, 0.6, 0.85, 1.2, 1.8, 3.0, 6.0};
/// Errors up to here count fully: multiples of σ, and share of the long side for the first look.
constexpr double kLossSigmas = 3.0;
constexpr double kLossShare = 0.005;
/// Pairs of segments whose vanishing points are tried, an axis.
constexpr std::size_t kMostPairs = 60;
constexpr std::size_t kRefined = 4;
constexpr int kSteps = 40;

using Jet = ceres::Jet<double, 4>;

/// A segment relative to the principal point.
struct Chord {
    int axis = 0;
    glm::dvec2 from{0.0};
    glm::dvec2 to{0.0};
};

struct Lines {
    std::vector<Chord> chords;
    double loss_px = 1.0;
    std::optional<FocalPrior> prior;
    double long_side = 0.0;
};

double cauchy(double error, double scale)
{
    return std::log1p(error * error / (scale * scale));
}

/// The ends' distance from the line through the homogeneous vanishing point v (alongAxis).
double distance(const Chord& chord, glm::dvec3 v)
{
    const glm::dvec2 a = chord.from;
    const glm::dvec2 b = chord.to;
    const glm::dvec2 far(v);
    const auto cross = [](glm::dvec2 p, glm::dvec2 q) { return p.x * q.y - p.y * q.x; };
    const double q = cross(far, a - b) + v.z * cross(a, b);
    const glm::dvec2 from_a = far - a * v.z;
    const glm::dvec2 from_b = far - b * v.z;
    return q / std::sqrt(glm::dot(from_a, from_a) + glm::dot(from_b, from_b) + 1e-300);
}

double lossAt(const Lines& lines, const Orientation& at)
{
    double sum = 0.0;
    for (const Chord& chord : lines.chords) {
        const glm::dvec3 d = at.camera_from_world[chord.axis];
        const glm::dvec3 v(at.focal_px * d.x, at.focal_px * d.y, d.z);
        sum += cauchy(distance(chord, v), lines.loss_px);
    }
    if (lines.prior) {
        const double off = std::log(at.focal_px / lines.prior->focal_px) / lines.prior->sigma;
        sum += off * off / (kLossSigmas * kLossSigmas);
    }
    return sum;
}

/// Error of a chord with derivatives by a turn in the camera's frame and ln f.
Jet errorOf(const Chord& chord, const Orientation& at)
{
    calibration::View<Jet> view;
    const glm::dvec3 d = at.camera_from_world[chord.axis];
    const Jet d_jet[3] = {{d.x, Eigen::Vector4d(0.0, d.z, -d.y, 0.0)},
                          {d.y, Eigen::Vector4d(-d.z, 0.0, d.x, 0.0)},
                          {d.z, Eigen::Vector4d(d.y, -d.x, 0.0, 0.0)}};
    view.camera_from_world.setZero();
    for (int row = 0; row < 3; ++row)
        view.camera_from_world(row, chord.axis) = d_jet[row];
    view.focal = Jet(at.focal_px, Eigen::Vector4d(0.0, 0.0, 0.0, at.focal_px));
    view.principal.setZero();
    view.division = Jet(0.0);
    const Jet x[4] = {Jet(chord.from.x), Jet(chord.from.y), Jet(chord.to.x), Jet(chord.to.y)};
    Jet out(0.0);
    alongAxis(view, chord.axis, x, &out);
    return out;
}

glm::dmat3 turned(const glm::dmat3& axes, const Eigen::Vector3d& turn)
{
    const double angle = turn.norm();
    if (!(angle > 0.0)) return axes;
    const Eigen::Matrix3d m = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    glm::dmat3 rotation;
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            rotation[column][row] = m(row, column);
    return rotation * axes;
}

Orientation stepped(const Lines& lines, const Orientation& at, const Eigen::Vector4d& step)
{
    Orientation next;
    next.camera_from_world = turned(at.camera_from_world, step.head<3>());
    next.focal_px = std::clamp(at.focal_px * std::exp(std::clamp(step[3], -1.0, 1.0)),
                               kShortestFocal * lines.long_side,
                               kLongestFocal * lines.long_side);
    next.loss = lossAt(lines, next);
    return next;
}

/// Iteratively re-weighted least squares with Levenberg–Marquardt's damping.
Orientation refined(const Lines& lines, Orientation at)
{
    at.loss = lossAt(lines, at);
    double damping = 1e-3;
    const double square = lines.loss_px * lines.loss_px;
    for (int i = 0; i < kSteps && damping < 1e9; ++i) {
        Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
        Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
        for (const Chord& chord : lines.chords) {
            const Jet error = errorOf(chord, at);
            const double weight = 1.0 / (square + error.a * error.a);
            information += weight * error.v * error.v.transpose();
            gradient += weight * error.a * error.v;
        }
        if (lines.prior) {
            const double sigma = kLossSigmas * lines.prior->sigma;
            information(3, 3) += 1.0 / (sigma * sigma);
            gradient[3] += std::log(at.focal_px / lines.prior->focal_px) / (sigma * sigma);
        }
        bool better = false;
        Eigen::Vector4d step;
        while (!better && damping < 1e9) {
            Eigen::Matrix4d damped = information;
            damped.diagonal() *= 1.0 + damping;
            damped.diagonal().array() += 1e-12 * information.trace() + 1e-300;
            step = -damped.ldlt().solve(gradient);
            const Orientation next = step.allFinite() ? stepped(lines, at, step) : at;
            better = next.loss < at.loss;
            damping *= better ? 0.1 : 10.0;
            if (better) at = next;
        }
        if (better && step.norm() < 1e-8) break;
    }
    return at;
}

/// Standard deviations from the segments' information, outliers counting little.
void describe(const Lines& lines, double sigma_px, Orientation& at)
{
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
    const double square = lines.loss_px * lines.loss_px;
    for (const Chord& chord : lines.chords) {
        const Jet error = errorOf(chord, at);
        const double weight = square / (square + error.a * error.a) / (sigma_px * sigma_px);
        information += weight * error.v * error.v.transpose();
    }
    if (lines.prior) information(3, 3) += 1.0 / (lines.prior->sigma * lines.prior->sigma);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(information);
    const bool open = !(solver.eigenvalues()[0] > 1e-12 * solver.eigenvalues()[3]);
    const Eigen::Matrix4d covariance = information.inverse();
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    at.rotation_sigma = open ? kInfinite : std::sqrt(covariance.diagonal().head<3>().sum());
    at.focal_sigma = open ? kInfinite : std::sqrt(covariance(3, 3));
    const double relative = at.focal_px / lines.long_side;
    at.focal_at_limit = relative < 1.02 * kShortestFocal || relative > 0.98 * kLongestFocal;
}

/// The vanishing point that most of an axis' segments agree on, homogeneous.
std::optional<glm::dvec3> agreedPoint(const std::vector<Chord>& chords, double loss_px)
{
    const auto line = [](const Chord& chord) {
        return glm::cross(glm::dvec3(chord.from, 1.0), glm::dvec3(chord.to, 1.0));
    };
    const std::size_t pairs = chords.size() * (chords.size() - 1) / 2;
    const std::size_t stride = std::max<std::size_t>(1, pairs / kMostPairs);
    std::optional<glm::dvec3> best;
    double best_loss = 0.0;
    std::size_t number = 0;
    for (std::size_t i = 0; i < chords.size(); ++i)
        for (std::size_t j = i + 1; j < chords.size(); ++j) {
            if (number++ % stride != 0) continue;
            const glm::dvec3 v = glm::cross(line(chords[i]), line(chords[j]));
            const double size = glm::length(v);
            if (!(size > 0.0) || !std::isfinite(size)) continue;
            double loss = 0.0;
            for (const Chord& chord : chords)
                loss += cauchy(distance(chord, v / size), loss_px);
            if (best && loss >= best_loss) continue;
            best = v / size;
            best_loss = loss;
        }
    return best;
}

/// Right-handed rotation from two directions for axes `first` and `second`: the first is kept.
std::optional<glm::dmat3> rotationFromTwo(int first, glm::dvec3 a, int second, glm::dvec3 b)
{
    const glm::dvec3 across = b - glm::dot(a, b) * a;
    if (!(glm::length(across) > 1e-6)) return std::nullopt;
    glm::dmat3 result(0.0);
    result[first] = a;
    result[second] = glm::normalize(across);
    const int third = 3 - first - second;
    const bool cyclic = (first + 1) % 3 == second;
    result[third] = cyclic ? glm::cross(result[first], result[second])
                           : glm::cross(result[second], result[first]);
    return result;
}

struct AxisLines {
    std::vector<Chord> chords;
    std::optional<glm::dvec3> vanishing;
};

glm::dvec3 directionTo(glm::dvec3 vanishing, double focal_px)
{
    return glm::normalize(glm::dvec3(vanishing.x, vanishing.y, vanishing.z * focal_px));
}

/// Direction of an axis at a focal length, `other` being that of an axis at right angles.
std::optional<glm::dvec3> directionBeside(const AxisLines& axis, glm::dvec3 other, double focal_px)
{
    if (axis.vanishing) return directionTo(*axis.vanishing, focal_px);
    if (axis.chords.empty()) return std::nullopt;
    // One segment: the direction lies in its plane and is perpendicular to the other.
    const Chord& only = axis.chords.front();
    const glm::dvec3 normal =
        glm::cross(glm::dvec3(only.from / focal_px, 1.0), glm::dvec3(only.to / focal_px, 1.0));
    const glm::dvec3 direction = glm::cross(normal, other);
    if (!(glm::length(direction) > 1e-9)) return std::nullopt;
    return glm::normalize(direction);
}

std::vector<double> focalStarts(const Lines& lines, const std::array<AxisLines, 3>& axes)
{
    std::vector<double> focals;
    if (lines.prior) focals.push_back(lines.prior->focal_px);
    for (int a = 0; a < 3; ++a)
        for (int b = a + 1; b < 3; ++b)
            if (axes[a].vanishing && axes[b].vanishing)
                if (const auto f =
                        focalFromOrthogonalPair({*axes[a].vanishing}, {*axes[b].vanishing}))
                    focals.push_back(*f);
    for (const double factor : kFocalStarts)
        focals.push_back(factor * lines.long_side);
    for (double& focal : focals)
        focal = std::clamp(
            focal, 1.01 * kShortestFocal * lines.long_side, 0.99 * kLongestFocal * lines.long_side);
    return focals;
}

/// Every ordered pair of axes at every focal length, best first.
std::vector<Orientation> starts(const Lines& lines, const std::array<AxisLines, 3>& axes)
{
    std::vector<Orientation> found;
    for (const double focal_px : focalStarts(lines, axes)) {
        for (int first = 0; first < 3; ++first) {
            if (!axes[first].vanishing) continue;
            const glm::dvec3 a = directionTo(*axes[first].vanishing, focal_px);
            for (int second = 0; second < 3; ++second) {
                if (second == first) continue;
                const auto b = directionBeside(axes[second], a, focal_px);
                const auto rotation = b ? rotationFromTwo(first, a, second, *b) : std::nullopt;
                if (!rotation) continue;
                found.push_back({*rotation, focal_px});
                found.back().loss = lossAt(lines, found.back());
            }
        }
    }
    std::stable_sort(found.begin(), found.end(), [](const Orientation& p, const Orientation& q) {
        return p.loss < q.loss;
    });
    return found;
}

}  // namespace

std::optional<Orientation> findOrientation(const LineSet& straight,
                                           glm::dvec2 principal_px,
                                           double sigma_px,
                                           const std::optional<FocalPrior>& prior)
{
    Lines lines;
    lines.prior = prior;
    lines.long_side = std::max(straight.width, straight.height);
    std::array<AxisLines, 3> axes;
    for (const LineSegment& segment : straight.segments) {
        const Chord chord{static_cast<int>(segment.axis),
                          segment.from_px - principal_px,
                          segment.to_px - principal_px};
        lines.chords.push_back(chord);
        axes[static_cast<std::size_t>(segment.axis)].chords.push_back(chord);
    }
    lines.loss_px = std::max(kLossSigmas * sigma_px, kLossShare * lines.long_side);
    for (AxisLines& axis : axes)
        if (axis.chords.size() > 1) axis.vanishing = agreedPoint(axis.chords, lines.loss_px);

    const std::vector<Orientation> from = starts(lines, axes);
    std::optional<Orientation> best;
    for (std::size_t i = 0; i < std::min(kRefined, from.size()); ++i) {
        lines.loss_px = std::max(kLossSigmas * sigma_px, kLossShare * lines.long_side);
        const Orientation roughly = refined(lines, from[i]);
        lines.loss_px = kLossSigmas * sigma_px;
        const Orientation finely = refined(lines, roughly);
        if (!best || finely.loss < best->loss) best = finely;
    }
    if (best) describe(lines, sigma_px, *best);
    return best;
}

}  // namespace insitu
