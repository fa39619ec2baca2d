#pragma once

#include "calib/camera_solve.h"

#include <glm/glm.hpp>

#include <array>
#include <functional>
#include <vector>

namespace insitu {

/// How a camera's errors reach what is measured with it.

/// A small change of a camera's numbers, in the order of CameraUnknown.
using CameraStep = std::array<double, static_cast<std::size_t>(CameraUnknown::Count)>;

/// The camera after a step: the turn is applied last, in the camera's frame.
[[nodiscard]] Camera stepped(const Camera& camera, const CameraStep& step);

/// Independent directions of the camera's error, each one standard deviation long: Σ s sᵀ is its
/// covariance. Where that is not known (a camera file without it), the stated deviations as if
/// independent. Empty for a camera that counts as exact.
[[nodiscard]] std::vector<CameraStep> errorSteps(const CameraEstimate& estimate);

/// The estimate's camera after each of these steps.
[[nodiscard]] std::vector<Camera> errorCameras(const CameraEstimate& estimate);

/// Covariance that the camera's errors give a point measured with it, to first order: central
/// differences of a hundredth of each error direction. A direction along which `measure` throws
/// NoAnswerError has no say.
[[nodiscard]] glm::dmat3 covarianceFromCamera(
    const CameraEstimate& estimate, const std::function<glm::dvec3(const Camera&)>& measure);

/// The camera's errors are this covariance: it and all standard deviations that follow from it.
void setCovariance(const CameraCovariance& covariance, CameraEstimate& estimate);

/// What the turns (rad) and ln focal are doubtful by, in that order.
using OrientationCovariance = std::array<std::array<double, 4>, 4>;

/// Widens the errors where another way to judge them finds more: along every combination of turns
/// and focal length for which `doubt` is the larger of the two, the others following as they do in
/// the estimate's covariance. Nothing shrinks.
void widen(const OrientationCovariance& doubt, CameraEstimate& estimate);

}  // namespace insitu
