#pragma once

#include <glm/glm.hpp>

#include <optional>

namespace insitu {

/// A camera in the world: a pinhole behind a lens that may bend straight lines.
///
/// World: right-handed, Y up, metres. Camera frame: x right, y down, z forward. Pixels: (0,0) is
/// the corner of the top-left pixel, centres at +0.5.
///   x_in_camera = (right·d, −up·d, forward·d) with d = x_in_world − position
///   straight pixel  u = fx·x/z + cx,  v = fy·y/z + cy
/// right, up and forward are orthonormal and right × up = −forward.
///
/// Lens: one-parameter division model about the principal point c. What is seen at the pixel p, a
/// lens without distortion would show at the straight pixel c + (p − c) / (1 + λ |p − c|²/R²), R
/// half the picture's diagonal, λ = division; negative is a barrel, 0 bends nothing. Both ways are
/// closed forms, and λ stays the same when the picture is resized. To first order it is −k1 of the
/// polynomial from distorted to straight, and k1 of the one from straight to distorted.
/// Source: [Fitzgibbon01] section 2.
struct Camera {
    int width = 0;
    int height = 0;
    glm::dvec2 focal_px{0.0};
    glm::dvec2 principal_px{0.0};
    glm::dvec3 position_m{0.0};
    glm::dvec3 right{1.0, 0.0, 0.0};
    glm::dvec3 up{0.0, 1.0, 0.0};
    glm::dvec3 forward{0.0, 0.0, -1.0};
    double division = 0.0;  ///< λ of the lens, within ±0.5

    /// Where a lens without distortion would show what is seen at `pixel`.
    [[nodiscard]] glm::dvec2 straightened(glm::dvec2 pixel) const;
    /// The inverse: where this lens shows it. Nothing when that is beyond the edge of what a lens
    /// of λ > 0 can see.
    [[nodiscard]] std::optional<glm::dvec2> distorted(glm::dvec2 straight_px) const;

    /// Pixel of a world point; nothing when the point is not in front of the camera, or beyond the
    /// edge of what the lens sees.
    [[nodiscard]] std::optional<glm::dvec2> project(glm::dvec3 x_in_world) const;
    /// Unit direction in the world of the ray through a pixel.
    [[nodiscard]] glm::dvec3 rayDirection(glm::dvec2 pixel) const;

    /// A camera at `position_m` that looks at `target_m` with world Y up and square pixels.
    /// The principal point is the image's centre. Looking straight up or down is an error.
    [[nodiscard]] static Camera lookAt(
        glm::dvec3 position_m, glm::dvec3 target_m, double focal_px, int width, int height);
};

}  // namespace insitu
