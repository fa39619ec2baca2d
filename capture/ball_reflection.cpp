#include "capture/ball_reflection.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu::detail {

using std::numbers::pi;

namespace {

/// Newton and bisection stop when phi is known to this. Radians.
constexpr double kAngleTolerance = 1e-12;
constexpr int kMaxSteps = 60;

}  // namespace

BallReflection::BallReflection(glm::dvec3 center, double radius, glm::dvec3 camera, double rim)
    : center_(center),
      radius_(radius),
      camera_distance_(glm::length(camera - center)),
      axis_((camera - center) / camera_distance_)
{
    INSITU_CHECK(radius > 0.0 && camera_distance_ > radius,
                 "ball of {} m, camera at {} m",
                 radius,
                 camera_distance_);
    const glm::dvec3 other =
        std::abs(axis_.y) < 0.9 ? glm::dvec3(0.0, 1.0, 0.0) : glm::dvec3(1.0, 0.0, 0.0);
    side_a_ = glm::normalize(glm::cross(other, axis_));
    side_b_ = glm::cross(axis_, side_a_);
    tangent_angle_ = std::acos(radius_ / camera_distance_);

    // The outline has radius tan(asin(r / D)) at unit focal length; a normal at phi is seen at
    // r sin(phi) / (D - r cos(phi)).
    const double sine = radius_ / camera_distance_;
    const double limit = (1.0 - rim) * sine / std::sqrt(1.0 - sine * sine);
    double low = 0.0;
    double high = tangent_angle_;
    while (high - low > kAngleTolerance) {
        const double middle = 0.5 * (low + high);
        const double seen =
            radius_ * std::sin(middle) / (camera_distance_ - radius_ * std::cos(middle));
        (seen < limit ? low : high) = middle;
    }
    last_angle_ = low;
}

BallReflection::Mismatch BallReflection::mismatch(double phi, double psi, double distance) const
{
    const double c = std::cos(phi);
    const double s = std::sin(phi);
    const double r = radius_;
    const double to_camera_x = camera_distance_ - r * c;
    const double to_camera_y = -r * s;
    const double a = std::atan2(to_camera_y, to_camera_x);
    const double a_slope = (r * r - camera_distance_ * r * c) /
                           (to_camera_x * to_camera_x + to_camera_y * to_camera_y);
    double b = psi;
    double b_slope = 0.0;
    if (std::isfinite(distance)) {
        const double to_target_x = distance * std::cos(psi) - r * c;
        const double to_target_y = distance * std::sin(psi) - r * s;
        b = std::atan2(to_target_y, to_target_x);
        if (b < -0.5 * pi) b += 2.0 * pi;
        b_slope = (r * r - distance * r * std::cos(psi - phi)) /
                  (to_target_x * to_target_x + to_target_y * to_target_y);
    }
    return {2.0 * phi - a - b, 2.0 - a_slope - b_slope};
}

double BallReflection::lastDirection() const
{
    const double to_camera_x = camera_distance_ - radius_ * std::cos(last_angle_);
    const double to_camera_y = -radius_ * std::sin(last_angle_);
    return 2.0 * last_angle_ - std::atan2(to_camera_y, to_camera_x);
}

glm::dvec3 BallReflection::pointAt(double angle, glm::dvec3 side) const
{
    return center_ + radius_ * (std::cos(angle) * axis_ + std::sin(angle) * side);
}

BallReflection::Point BallReflection::pointFor(glm::dvec3 direction, double distance) const
{
    const double along = glm::dot(direction, axis_);
    const glm::dvec3 across = direction - along * axis_;
    const double across_length = glm::length(across);
    const glm::dvec3 side = across_length > 1e-12 ? across / across_length : side_a_;
    const double psi = std::atan2(across_length, along);
    const double d = std::max(distance, 1.001 * radius_);

    if (mismatch(last_angle_, psi, d).value < 0.0) return {pointAt(last_angle_, side), true};
    double low = 0.0;
    double high = last_angle_;
    double phi = std::min(0.5 * psi, high);
    for (int step = 0; step < kMaxSteps; ++step) {
        const Mismatch m = mismatch(phi, psi, d);
        (m.value < 0.0 ? low : high) = phi;
        double next = phi - m.value / m.slope;
        if (!(next > low && next < high)) next = 0.5 * (low + high);
        const double change = std::abs(next - phi);
        phi = next;
        if (change < kAngleTolerance) break;
    }
    return {pointAt(phi, side), false};
}

}  // namespace insitu::detail
