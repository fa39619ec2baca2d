#include "calib/right_angle.h"

#include <Eigen/Dense>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace insitu::manhattan {

namespace {

/// Turns about the camera's axes, ln f, the angle, the principal point's offset in long sides.
constexpr int kTurn = 0;
constexpr int kFocal = 3;
constexpr int kAngle = 4;
constexpr int kPrincipal = 5;
constexpr int kCount = 7;
using Vector = Eigen::Matrix<double, kCount, 1>;
using Matrix = Eigen::Matrix<double, kCount, kCount>;

constexpr int kRounds = 12;
constexpr double kDifference = 1e-6;
/// Lenses in use, of the long side, and their spread in ln f.
constexpr double kUsualFocal = 0.75;
constexpr double kFocalSpread = 0.35;

glm::dmat3 turning(glm::dvec3 turn)
{
    const double angle = glm::length(turn);
    return angle > 0.0 ? glm::mat3_cast(glm::angleAxis(angle, turn / angle)) : glm::dmat3(1.0);
}

/// An answer whose x and z need not be at right angles.
struct Open {
    Frame frame;
    double angle = 0.0;
    glm::dvec2 principal{0.0};  ///< in long sides

    [[nodiscard]] Open after(const Vector& step) const
    {
        Open moved = *this;
        // z goes away from x when it turns clockwise about y, seen from above.
        moved.frame.axes[2] = turning(-frame.axes[1] * step(kAngle)) * frame.axes[2];
        moved.frame.axes =
            turning({step(kTurn), step(kTurn + 1), step(kTurn + 2)}) * moved.frame.axes;
        moved.frame.focal_px *= std::exp(step(kFocal));
        moved.angle += step(kAngle);
        moved.principal += glm::dvec2(step(kPrincipal), step(kPrincipal + 1));
        return moved;
    }
    [[nodiscard]] Observation seen(const Observation& segment, double long_side) const
    {
        Observation one = segment;
        one.middle -= principal * long_side;
        return one;
    }
};

struct Normal {
    Matrix information = Matrix::Zero();
    Vector gradient = Vector::Zero();

    void prior(int unknown, double off, double sigma)
    {
        information(unknown, unknown) += 1.0 / (sigma * sigma);
        gradient(unknown) += off / (sigma * sigma);
    }
};

using Shares = std::vector<std::array<double, 3>>;

Normal normalEquations(const Task& task,
                       const Shares& shares,
                       const Open& at,
                       double principal_sigma)
{
    Normal normal;
    std::array<Open, 2 * kCount> moved;
    for (int p = 0; p < kCount; ++p)
        for (const int side : {0, 1}) {
            Vector step = Vector::Zero();
            step(p) = side == 0 ? kDifference : -kDifference;
            moved[static_cast<std::size_t>(2 * p + side)] = at.after(step);
        }
    const auto miss = [&](const Open& open, const Observation& segment, int axis) {
        return missAngle(
            open.seen(segment, task.long_side), open.frame.axes[axis], open.frame.focal_px);
    };
    for (std::size_t i = 0; i < task.observations.size(); ++i) {
        const Observation& segment = task.observations[i];
        const double sigma = std::hypot(segment.sigma, at.frame.slack);
        for (int axis = 0; axis < 3; ++axis) {
            const double share = segment.weight * shares[i][static_cast<std::size_t>(axis)];
            if (share < 1e-4) continue;
            Vector slope;
            for (int p = 0; p < kCount; ++p) {
                const auto k = static_cast<std::size_t>(2 * p);
                slope(p) = (miss(moved[k], segment, axis) - miss(moved[k + 1], segment, axis)) /
                           (2.0 * kDifference);
            }
            const double weight = share / (sigma * sigma);
            normal.information += weight * slope * slope.transpose();
            normal.gradient += weight * slope * miss(at, segment, axis);
        }
    }
    const FocalPrior usual{kUsualFocal * task.long_side, kFocalSpread};
    const FocalPrior& focal = task.prior ? *task.prior : usual;
    normal.prior(kFocal, std::log(at.frame.focal_px / focal.focal_px), focal.sigma);
    const double held = std::max(principal_sigma, 1e-6);
    for (int i = 0; i < 2; ++i)
        normal.prior(kPrincipal + i, at.principal[i], held);
    // Any angle is possible; this only keeps directions of which nothing is seen where they are.
    normal.prior(kAngle, at.angle, 1.0);
    for (int i = 0; i < 3; ++i)
        normal.information(kTurn + i, kTurn + i) += 1e-3;
    return normal;
}

}  // namespace

RightAngle rightAngle(const Task& task, const Frame& frame, double principal_sigma)
{
    Shares shares;
    for (const Observation& segment : task.observations)
        shares.push_back(memberships(segment, frame));
    Open at{frame, 0.0, glm::dvec2(0.0)};
    for (int round = 0; round < kRounds; ++round) {
        const Normal normal = normalEquations(task, shares, at, principal_sigma);
        Vector step = -normal.information.ldlt().solve(normal.gradient);
        const double size = step.norm();
        if (size > 0.1) step *= 0.1 / size;
        at = at.after(step);
        if (size < 1e-7) break;
    }
    const Matrix covariance =
        normalEquations(task, shares, at, principal_sigma).information.inverse();
    return {at.angle,
            std::sqrt(covariance(kAngle, kAngle)),
            at.frame.focal_px,
            std::sqrt(covariance(kFocal, kFocal))};
}

}  // namespace insitu::manhattan
