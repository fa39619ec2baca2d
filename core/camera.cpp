#include "core/camera.h"

#include "core/check.h"

namespace insitu {

std::optional<glm::dvec2> Camera::project(glm::dvec3 x_in_world) const
{
    const glm::dvec3 d = x_in_world - position_m;
    const double z = glm::dot(forward, d);
    if (!(z > 0.0)) return std::nullopt;
    return glm::dvec2(focal_px.x * glm::dot(right, d) / z + principal_px.x,
                      -focal_px.y * glm::dot(up, d) / z + principal_px.y);
}

glm::dvec3 Camera::rayDirection(glm::dvec2 pixel) const
{
    const double x = (pixel.x - principal_px.x) / focal_px.x;
    const double y = (pixel.y - principal_px.y) / focal_px.y;
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
