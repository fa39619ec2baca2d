#pragma once

#include <glm/glm.hpp>

namespace insitu::detail {

/// Where a mirror ball shows a direction to a camera at finite distance.
///
/// Camera, ball's centre, target and the reflecting point lie in one plane, so the point is one
/// angle phi, from the axis (centre to camera) to the ball's normal there. With P = r n(phi), A and
/// B the angles of the directions from P to the camera and to the target, the law of reflection
/// phi - A = B - phi is one monotone equation: Newton inside a bracket, exact for any distance
/// (Alhazen's problem).
class BallReflection {
public:
    /// All in metres, world frame; the camera is outside the ball. `rim` in [0, 1): the outermost
    /// share of the outline's radius that is not used.
    BallReflection(glm::dvec3 center, double radius, glm::dvec3 camera, double rim);

    struct Point {
        glm::dvec3 position{0.0};  ///< on the ball, world
        /// The direction is not seen in the usable part of the ball; `position` is the rim's point
        /// nearest to it.
        bool blind = false;
    };
    /// The point that reflects what lies in unit `direction` from the ball's centre at `distance`
    /// metres (infinity allowed; less than the radius counts as touching the ball).
    [[nodiscard]] Point pointFor(glm::dvec3 direction, double distance) const;

    /// Angle between the axis and the tangent points of the outline, as seen from the centre.
    [[nodiscard]] double tangentAngle() const { return tangent_angle_; }
    /// Angle from the axis of the direction, infinitely far, that the usable part's edge reflects.
    [[nodiscard]] double lastDirection() const;
    /// Point of the ball at `angle` from the axis, towards `side` (a unit vector square to it).
    [[nodiscard]] glm::dvec3 pointAt(double angle, glm::dvec3 side) const;
    /// Unit vector from the centre to the camera.
    [[nodiscard]] glm::dvec3 axis() const { return axis_; }
    /// Two unit vectors square to the axis and to each other.
    [[nodiscard]] glm::dvec3 sideA() const { return side_a_; }
    [[nodiscard]] glm::dvec3 sideB() const { return side_b_; }

private:
    /// Angle of incidence minus angle of reflection at phi, and its derivative.
    struct Mismatch {
        double value;
        double slope;
    };
    [[nodiscard]] Mismatch mismatch(double phi, double psi, double distance) const;

    glm::dvec3 center_;
    double radius_;
    double camera_distance_;
    glm::dvec3 axis_;
    glm::dvec3 side_a_;
    glm::dvec3 side_b_;
    double tangent_angle_;
    double last_angle_;  ///< largest usable phi
};

}  // namespace insitu::detail
