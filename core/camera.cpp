#include "core/camera.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Far outside any picture the model folds over; rays there stay in front of the camera.
constexpr double kSmallestDivisor = 1e-3;

/// |p|²/R² with R half the picture's diagonal.
double relativeSquare(glm::dvec2 off, const Camera& camera)
{
    const double width = camera.width;
    const double height = camera.height;
    return 4.0 * glm::dot(off, off) / (width * width + height * height);
}

}  // namespace

glm::dvec2 Camera::straightened(glm::dvec2 pixel) const
{
    if (division == 0.0) return pixel;
    const glm::dvec2 off = pixel - principal_px;
    const double divisor = 1.0 + division * relativeSquare(off, *this);
    return principal_px + off / std::max(divisor, kSmallestDivisor);
}

// With s the straight and r the seen radius in half diagonals: λ s r² − r + s = 0. The root that
// tends to s for small λ, in the form without cancellation: r = 2 s / (1 + √(1 − 4 λ s²)).
std::optional<glm::dvec2> Camera::distorted(glm::dvec2 straight_px) const
{
    if (division == 0.0) return straight_px;
    const glm::dvec2 off = straight_px - principal_px;
    const double root = 1.0 - 4.0 * division * relativeSquare(off, *this);
    if (!(root >= 0.0)) return std::nullopt;
    return principal_px + off * (2.0 / (1.0 + std::sqrt(root)));
}

std::optional<glm::dvec2> Camera::project(glm::dvec3 x_in_world) const
{
    const glm::dvec3 d = x_in_world - position_m;
    const double z = glm::dot(forward, d);
    if (!(z > 0.0)) return std::nullopt;
    return distorted(glm::dvec2(focal_px.x * glm::dot(right, d) / z + principal_px.x,
                                -focal_px.y * glm::dot(up, d) / z + principal_px.y));
}

glm::dvec3 Camera::rayDirection(glm::dvec2 pixel) const
{
    const glm::dvec2 straight = straightened(pixel);
    const double x = (straight.x - principal_px.x) / focal_px.x;
    const double y = (straight.y - principal_px.y) / focal_px.y;
    return glm::normalize(right * x - up * y + forward);
}

Camera Camera::lookAt(
    glm::dvec3 position_m, glm::dvec3 target_m, double focal_px, int width, int height)
{
    Camera camera;
    camera.width = width;
    camera.height = height;
    camera.focal_px = glm::dvec2(focal_px);
    camera.principal_px = glm::dvec2(width, height) * 0.5;
    camera.position_m = position_m;
    camera.forward = glm::normalize(target_m - position_m);
    const glm::dvec3 side = glm::cross(camera.forward, glm::dvec3(0.0, 1.0, 0.0));
    INSITU_CHECK(glm::length(side) > 1e-9, "lookAt along the vertical has no right direction");
    camera.right = glm::normalize(side);
    camera.up = glm::cross(camera.right, camera.forward);
    return camera;
}

}  // namespace insitu
