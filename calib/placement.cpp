#include "calib/camera_constraints.h"
#include "calib/camera_solve.h"

#include <cmath>

namespace insitu {

namespace {

constexpr int kCount = static_cast<int>(CameraUnknown::Count);
using Jet = ceres::Jet<double, kCount>;
using Row = Eigen::Matrix<double, 1, kCount>;

/// The estimate's camera with derivatives by the rows of its covariance.
calibration::View<Jet> viewOf(const Camera& camera)
{
    calibration::View<Jet> view;
    const glm::dvec3 rows[3] = {camera.right, -camera.up, camera.forward};
    for (int column = 0; column < 3; ++column) {
        const Eigen::Vector3d d(rows[0][column], rows[1][column], rows[2][column]);
        for (int row = 0; row < 3; ++row) {
            Jet value(d[row]);
            for (int turn = 0; turn < 3; ++turn)
                value.v[turn] = Eigen::Vector3d::Unit(turn).cross(d)[row];
            view.camera_from_world(row, column) = value;
        }
    }
    const auto moving = [](double value, CameraUnknown first, int offset) {
        return Jet(value, static_cast<int>(first) + offset);
    };
    view.log_focal = moving(std::log(camera.focal_px.x), CameraUnknown::LogFocal, 0);
    view.focal = exp(view.log_focal);
    for (int i = 0; i < 2; ++i)
        view.principal[i] = moving(camera.principal_px[i], CameraUnknown::Principal, i);
    view.division = moving(camera.division, CameraUnknown::Division, 0);
    view.square_half_diagonal = 0.25 * (static_cast<double>(camera.width) * camera.width +
                                        static_cast<double>(camera.height) * camera.height);
    for (int i = 0; i < 3; ++i)
        view.position[i] = moving(camera.position_m[i], CameraUnknown::Position, i);
    return view;
}

double sigmaOf(const Row& by, const CameraCovariance& covariance)
{
    double variance = 0.0;
    for (int i = 0; i < kCount; ++i)
        for (int j = 0; j < kCount; ++j)
            if (by[i] != 0.0 && by[j] != 0.0) variance += by[i] * by[j] * covariance[i][j];
    return std::sqrt(std::max(variance, 0.0));
}

bool known(const CameraCovariance& covariance)
{
    bool any = false;
    for (const auto& row : covariance)
        for (const double value : row) {
            if (!std::isfinite(value)) return false;
            any = any || value != 0.0;
        }
    return any;
}

}  // namespace

std::optional<PlacementSigma> placementSigma(const CameraEstimate& estimate, glm::dvec3 point_m)
{
    const Camera& camera = estimate.camera;
    const auto foot = camera.project(point_m);
    const auto top = camera.project(point_m + glm::dvec3(0.0, 1.0, 0.0));
    if (!foot || !top || !known(estimate.covariance)) return std::nullopt;
    // The plane through the point is the floor of a camera that much lower.
    calibration::View<Jet> view = viewOf(camera);
    view.position[1] -= point_m.y;
    const Jet x[4] = {Jet(foot->x), Jet(foot->y), Jet(top->x), Jet(top->y)};
    calibration::Vec3<Jet> seen;
    Jet per_height;
    if (!onFloor(view, x, seen) || !uprightLength(view, x, per_height)) return std::nullopt;
    const calibration::Vec3<Jet> at = view.position + seen * view.position[1];
    const Jet height = per_height * view.position[1];

    const glm::dvec2 away(point_m.x - camera.position_m.x, point_m.z - camera.position_m.z);
    const double distance = glm::length(away);
    if (!(distance > 0.0)) return std::nullopt;
    const glm::dvec2 along = away / distance;
    const Row by_x = at[0].v.transpose();
    const Row by_z = at[2].v.transpose();
    PlacementSigma sigma;
    sigma.along_m = sigmaOf(along.x * by_x + along.y * by_z, estimate.covariance);
    sigma.across_m = sigmaOf(along.x * by_z - along.y * by_x, estimate.covariance);
    sigma.height_m = sigmaOf(height.v.transpose(), estimate.covariance);
    return sigma;
}

}  // namespace insitu
