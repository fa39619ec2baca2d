#include "calib/camera_errors.h"

#include "core/check.h"

#include <Eigen/Dense>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kCount = static_cast<int>(CameraUnknown::Count);
constexpr int kOriented = 4;  ///< turns and ln f, the first of the unknowns
constexpr double kStep = 0.01;
using Matrix = Eigen::Matrix<double, kCount, kCount>;
using Oriented = Eigen::Matrix4d;

Matrix matrixOf(const CameraCovariance& covariance)
{
    Matrix m;
    for (int row = 0; row < kCount; ++row)
        for (int column = 0; column < kCount; ++column)
            m(row, column) = covariance[row][column];
    return m;
}

int at(CameraUnknown unknown)
{
    return static_cast<int>(unknown);
}

/// The covariance, or the deviations alone where it is unknown or open.
Matrix knownCovariance(const CameraEstimate& estimate)
{
    const Matrix stated = matrixOf(estimate.covariance);
    if (stated.allFinite() && !stated.isZero(0.0)) return stated;
    Eigen::Matrix<double, kCount, 1> sigma = Eigen::Matrix<double, kCount, 1>::Zero();
    glm::dvec3 turn = estimate.turn_sigma_rad;
    if (turn == glm::dvec3(0.0)) turn = glm::dvec3(estimate.rotation_sigma_rad / std::sqrt(3.0));
    for (int i = 0; i < 3; ++i) {
        sigma[at(CameraUnknown::Turn) + i] = turn[i];
        sigma[at(CameraUnknown::Position) + i] = estimate.position_sigma_m[i];
    }
    sigma[at(CameraUnknown::LogFocal)] = estimate.focal_sigma_px / estimate.camera.focal_px.x;
    for (int i = 0; i < 2; ++i)
        sigma[at(CameraUnknown::Principal) + i] = estimate.principal_sigma_px[i];
    sigma[at(CameraUnknown::Division)] = estimate.division_sigma;
    for (double& one : sigma)
        if (!std::isfinite(one)) one = 0.0;
    return sigma.cwiseAbs2().asDiagonal();
}

}  // namespace

Camera stepped(const Camera& camera, const CameraStep& step)
{
    Camera result = camera;
    const glm::dvec3 turn(step[0], step[1], step[2]);
    const double angle = glm::length(turn);
    if (angle > 0.0) {
        // camera_from_world is turned by it, so that the axes in the world turn the other way.
        const glm::dmat3 world_from_camera(camera.right, -camera.up, camera.forward);
        const glm::dmat3 turned =
            world_from_camera * glm::mat3_cast(glm::angleAxis(-angle, turn / angle));
        result.right = turned[0];
        result.up = -turned[1];
        result.forward = turned[2];
    }
    result.focal_px *= std::exp(step[at(CameraUnknown::LogFocal)]);
    for (int i = 0; i < 2; ++i)
        result.principal_px[i] += step[at(CameraUnknown::Principal) + i];
    result.division += step[at(CameraUnknown::Division)];
    for (int i = 0; i < 3; ++i)
        result.position_m[i] += step[at(CameraUnknown::Position) + i];
    return result;
}

std::vector<CameraStep> errorSteps(const CameraEstimate& estimate)
{
    const Matrix covariance = knownCovariance(estimate);
    // Of the correlations, since the units differ by orders of magnitude.
    const Eigen::Matrix<double, kCount, 1> sigma = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
    Matrix correlation = Matrix::Zero();
    for (int row = 0; row < kCount; ++row)
        for (int column = 0; column < kCount; ++column)
            if (sigma[row] > 0.0 && sigma[column] > 0.0)
                correlation(row, column) = covariance(row, column) / (sigma[row] * sigma[column]);
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(correlation);
    std::vector<CameraStep> steps;
    for (int k = 0; k < kCount; ++k) {
        const double variance = solver.eigenvalues()[k];
        if (!(variance > 1e-14)) continue;
        CameraStep step{};
        for (int i = 0; i < kCount; ++i)
            step[i] = sigma[i] * solver.eigenvectors()(i, k) * std::sqrt(variance);
        steps.push_back(step);
    }
    return steps;
}

std::vector<Camera> errorCameras(const CameraEstimate& estimate)
{
    std::vector<Camera> cameras;
    for (const CameraStep& step : errorSteps(estimate))
        cameras.push_back(stepped(estimate.camera, step));
    return cameras;
}

glm::dmat3 covarianceFromCamera(const CameraEstimate& estimate,
                                const std::function<glm::dvec3(const Camera&)>& measure)
{
    glm::dmat3 sum(0.0);
    for (CameraStep step : errorSteps(estimate)) {
        for (double& part : step)
            part *= kStep;
        CameraStep back = step;
        for (double& part : back)
            part = -part;
        try {
            const glm::dvec3 off = (measure(stepped(estimate.camera, step)) -
                                    measure(stepped(estimate.camera, back))) /
                                   (2.0 * kStep);
            sum += glm::outerProduct(off, off);
        } catch (const NoAnswerError&) {
            continue;
        }
    }
    return sum;
}

void setCovariance(const CameraCovariance& covariance, CameraEstimate& estimate)
{
    estimate.covariance = covariance;
    const auto sigma = [&](CameraUnknown first, int offset) {
        const int i = at(first) + offset;
        return std::sqrt(std::max(0.0, covariance[i][i]));
    };
    estimate.focal_sigma_px = estimate.camera.focal_px.x * sigma(CameraUnknown::LogFocal, 0);
    for (int i = 0; i < 2; ++i)
        estimate.principal_sigma_px[i] = sigma(CameraUnknown::Principal, i);
    estimate.division_sigma = sigma(CameraUnknown::Division, 0);
    for (int i = 0; i < 3; ++i) {
        estimate.turn_sigma_rad[i] = sigma(CameraUnknown::Turn, i);
        estimate.position_sigma_m[i] = sigma(CameraUnknown::Position, i);
    }
    estimate.rotation_sigma_rad = glm::length(estimate.turn_sigma_rad);
}

void widen(const OrientationCovariance& doubt, CameraEstimate& estimate)
{
    const Matrix stated = matrixOf(estimate.covariance);
    const Oriented own = stated.topLeftCorner<kOriented, kOriented>();
    const Eigen::LLT<Oriented> root(own);
    if (!stated.allFinite() || root.info() != Eigen::Success) return;
    Oriented other;
    for (int row = 0; row < kOriented; ++row)
        for (int column = 0; column < kOriented; ++column)
            other(row, column) = doubt[row][column];
    // In units of the estimate's own errors; what is larger than one there is added.
    const Oriented half = root.matrixL().solve(other);
    const Oriented relative = root.matrixL().solve(half.transpose());
    const Eigen::SelfAdjointEigenSolver<Oriented> solver(0.5 * (relative + relative.transpose()));
    const Eigen::Vector4d excess = (solver.eigenvalues().array() - 1.0).max(0.0);
    const Oriented ways = root.matrixL() * solver.eigenvectors();
    const Oriented added = ways * excess.asDiagonal() * ways.transpose();
    // The others follow by regression on the four.
    const Eigen::Matrix<double, kCount, kOriented> follow =
        root.solve(stated.topRows<kOriented>()).transpose();
    const Matrix wide = stated + follow * added * follow.transpose();
    CameraCovariance result;
    for (int row = 0; row < kCount; ++row)
        for (int column = 0; column < kCount; ++column)
            result[row][column] = wide(row, column);
    setCovariance(result, estimate);
}

}  // namespace insitu
