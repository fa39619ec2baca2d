#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "render/object_scene.h"
#include "render/path_tracer.h"

namespace insitu {

struct DenoiseOptions {
    int window_radius = 8;  ///< pixels that are averaged lie this near, >= 1
    int patch_radius = 1;   ///< pixels are compared by the patches around them, >= 0
    /// How unlike two patches may be, in standard deviations of their noise, > 0.
    double strength = 0.6;
    double normal_sigma = 0.15;  ///< of the distance between unit normals, > 0
    double plane_sigma = 0.006;  ///< distance off the tangent plane / distance to the camera, > 0
};

/// Takes the Monte Carlo noise out of a finished picture: non-local means on the light alone.
///
/// The picture is divided by the reflectance of what each pixel shows, so that textures stay sharp;
/// neighbours are weighted by how alike their patches are, measured against the renderer's own
/// variance, and by surface normal and tangent plane; then reflectance is multiplied back. Where
/// the variance is 0 nothing changes. Slightly biased: edges of shadows within the noise soften.
/// Source: [RouKnaZwi12], section 4.1; features as in [RouManZwi13].
[[nodiscard]] Image<Rgb> denoised(const RenderedImage& noisy,
                                  const ObjectScene& scene,
                                  const Camera& camera,
                                  const DenoiseOptions& options = {});

}  // namespace insitu
