#pragma once

#include <glm/glm.hpp>

#include <optional>

namespace insitu {

/// A pinhole camera in the world.
///
/// World: right-handed, Y up, metres. Camera frame: x right, y down, z forward. Pixels: (0,0) is
/// the corner of the top-left pixel, centres at +0.5. No lens distortion.
///   x_in_camera = (right·d, −up·d, forward·d) with d = x_in_world − position
///   u = fx·x/z + cx,  v = fy·y/z + cy
/// right, up and forward are orthonormal and right × up = −forward.
struct Camera {
    int width = 0;
    int height = 0;
    glm::dvec2 focal_px{0.0};
    glm::dvec2 principal_px{0.0};
    glm::dvec3 position_m{0.0};
    glm::dvec3 right{1.0, 0.0, 0.0};
    glm::dvec3 up{0.0, 1.0, 0.0};
    glm::dvec3 forward{0.0, 0.0, -1.0};

    /// Pixel of a world point; nothing when the point is not in front of the camera.
    [[nodiscard]] std::optional<glm::dvec2> project(glm::dvec3 x_in_world) const;
    /// Unit direction in the world of the ray through a pixel.
    [[nodiscard]] glm::dvec3 rayDirection(glm::dvec2 pixel) const;

    /// A camera at `position_m` that looks at `target_m` with world Y up and square pixels.
    /// The principal point is the image's centre. Looking straight up or down is an error.
    [[nodiscard]] static Camera lookAt(
        glm::dvec3 position_m, glm::dvec3 target_m, double focal_px, int width, int height);
};

}  // namespace insitu
