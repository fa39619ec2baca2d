#pragma once

#include "core/image.h"

#include <cstdint>

namespace insitu {

/// What a picture's pixels gathered along the few directions of their glossy lobes.
struct GlossPixels {
    Image<Rgb> gathered;     ///< radiance, of the share of the pixel that objects cover
    Image<Rgb> reflectance;  ///< of the lobe, likewise; 0: nothing was gathered
    Image<glm::vec3> normal;
    Image<float> roughness;
    Image<float> depth_m;
    Image<std::uint32_t> object;

    GlossPixels(int width, int height);
};

/// Adds the lobes' radiance to a picture, each pixel's with what its neighbours gathered per
/// reflectance: those on the same object, at about its depth, whose normals differ by little of the
/// lobe's width. Neighbouring pixels draw different directions (LobeDraw), so that together they
/// see much more of the lobe.
void addSmoothedGloss(const GlossPixels& gloss, Image<Rgb>& picture);

}  // namespace insitu
