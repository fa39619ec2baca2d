#pragma once

#include "render/fiv/fiv_scene.h"

#include <glm/glm.hpp>

namespace insitu {

/// Which directions of a lobe are drawn: points of one pixel continue a sequence, pixels begin it
/// elsewhere.
struct LobeDraw {
    int point = 0;
    glm::dvec2 shift{0.5};

    /// Neighbouring pixels are shifted evenly.
    [[nodiscard]] static LobeDraw of(glm::ivec2 pixel, int point)
    {
        return {point,
                {0.5 + 0.8191725133961645 * pixel.x + 0.6710436067037893 * pixel.y,
                 0.5 + 0.5497004779019703 * pixel.x + 0.2360679774997897 * pixel.y}};
    }
};

/// Radiance towards a viewer by the part of a material's reflection that depends on where it is.
struct Gloss {
    Rgb reflectance{0.0f};  ///< of the lobe, for what it gathers; 0 for mirrors
    Rgb gathered{0.0f};     ///< radiance by a few directions: to be smoothed (gloss_filter.h)
    Rgb sharp{0.0f};        ///< radiance of mirrors, and by spots
};

/// A few directions are drawn from the lobe and followed. Where one meets an object it brings what
/// that reflects evenly, and, where that is glossy too, what lies ahead of it there; else the
/// room's radiance. The light of spots comes one by one. Mirrors follow one direction, spots and
/// all.
/// `spots_received`: irradiance of spots at the point, what is hidden of it taken off.
[[nodiscard]] Gloss glossyRadiance(const FivScene& scene,
                                   const SurfacePoint& point,
                                   glm::dvec3 wo,
                                   Rgb spots_received,
                                   const LobeDraw& draw);

/// The glossy lobe of a material: that of a metal, times a factor.
struct GlossyLobe {
    SurfaceMaterial metal;
    float scale = 0.0f;
};
[[nodiscard]] GlossyLobe glossyLobe(const SurfaceMaterial& material);

}  // namespace insitu
