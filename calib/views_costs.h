#pragma once

#include "calib/orientation.h"
#include "core/camera.h"

#include <ceres/rotation.h>

#include <cmath>

/// Internal to calib/: the residuals of calib/views_bundle.h, for automatic differentiation. Pixels
/// are relative to the principal point and straightened. Not installed.
namespace insitu::bundle {

/// Rotations are turns about the start: a camera's block is (turn, position).
inline constexpr int kPoseSize = 6;

/// The camera's frame at the start: columns are the world's axes in it.
inline glm::dmat3 cameraFromWorld(const Camera& camera)
{
    return glm::transpose(glm::dmat3(camera.right, -camera.up, camera.forward));
}

template <typename T>
void inCamera(const glm::dmat3& start, const T* turn, const T world[3], T camera[3])
{
    T rotated[3];
    for (int r = 0; r < 3; ++r)
        rotated[r] =
            T(start[0][r]) * world[0] + T(start[1][r]) * world[1] + T(start[2][r]) * world[2];
    ceres::AngleAxisRotatePoint(turn, rotated, camera);
}

/// Distance of a segment's ends from the line through its middle and its vanishing point, over its
/// standard deviation σ/√2; see calib/orientation.h.
struct SegmentCost {
    glm::dmat3 start;
    int axis;
    glm::dvec2 middle, half;
    double sigma_px;

    template <typename T>
    bool operator()(const T* pose, const T* log_focal, T* residual) const
    {
        using std::exp;
        using std::sqrt;
        const T world[3] = {
            T(axis == 0 ? 1.0 : 0.0), T(axis == 1 ? 1.0 : 0.0), T(axis == 2 ? 1.0 : 0.0)};
        T d[3];
        inCamera(start, pose, world, d);
        const T focal = exp(log_focal[0]);
        const T tx = focal * d[0] - middle.x * d[2];
        const T ty = focal * d[1] - middle.y * d[2];
        const T norm = sqrt(tx * tx + ty * ty + 1e-24 * focal * focal);
        residual[0] = (tx * half.y - ty * half.x) / norm * (std::sqrt(2.0) / sigma_px);
        return true;
    }
};

/// A point's place in a picture; `above` is added to it (a known height over a floor point).
struct PointCost {
    glm::dmat3 start;
    glm::dvec2 seen;
    double sigma_px;
    double above = 0.0;

    template <typename T>
    bool operator()(const T* pose, const T* log_focal, const T* point, T* residual) const
    {
        using std::exp;
        const T world[3] = {point[0] - pose[3], point[1] + above - pose[4], point[2] - pose[5]};
        T d[3];
        inCamera(start, pose, world, d);
        if (!(d[2] > 1e-6)) return false;
        const T focal = exp(log_focal[0]);
        residual[0] = (focal * d[0] / d[2] - seen.x) / sigma_px;
        residual[1] = (focal * d[1] / d[2] - seen.y) / sigma_px;
        return true;
    }
};

struct LengthCost {
    double metres, sigma_m;

    template <typename T>
    bool operator()(const T* a, const T* b, T* residual) const
    {
        using std::sqrt;
        const T x = a[0] - b[0];
        const T y = a[1] - b[1];
        const T z = a[2] - b[2];
        residual[0] = (sqrt(x * x + y * y + z * z + 1e-18) - metres) / sigma_m;
        return true;
    }
};

struct HeightCost {
    double metres, sigma_m;

    template <typename T>
    bool operator()(const T* pose, T* residual) const
    {
        residual[0] = (pose[4] - metres) / sigma_m;
        return true;
    }
};

struct FocalCost {
    FocalPrior prior;

    template <typename T>
    bool operator()(const T* log_focal, T* residual) const
    {
        residual[0] = (log_focal[0] - std::log(prior.focal_px)) / prior.sigma;
        return true;
    }
};

}  // namespace insitu::bundle
