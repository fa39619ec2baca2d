#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "core/progress.h"
#include "core/random.h"
#include "lighting/light_source.h"
#include "render/object_scene.h"

#include <cstdint>

namespace insitu {

struct PathOptions {
    /// Scattering events on objects along one path, >= 1.
    int max_bounces = 16;
    /// Bounces before Russian roulette starts, >= 0.
    int roulette_start = 4;
};

/// Radiance leaving `point` towards `wo` (unit, away from the surface), one sample: emission plus
/// light reflected over any number of bounces between objects. Next-event estimation on `light`
/// and BSDF sampling joined by the balance heuristic [Veach97, 9.2].
[[nodiscard]] Rgb tracePath(const ObjectScene& objects,
                            const LightSource& light,
                            const SurfacePoint& point,
                            glm::dvec3 wo,
                            const PathOptions& options,
                            RandomStream& random);

struct RenderOptions {
    int samples_per_pixel = 64;  ///< > 0
    std::uint64_t seed = 1;
    PathOptions path{};
    /// Stop after this many seconds at a whole sample pass; 0 = no limit. With a limit the result
    /// depends on the machine's speed.
    double max_seconds = 0.0;
};

struct RenderedImage {
    Image<Rgb> radiance;
    /// Variance of the mean's luminance, per pixel, from the samples; 0 when there is only one.
    Image<float> variance;
    int samples_per_pixel = 0;  ///< reached
    bool stopped_by_time = false;
};

/// A complete picture of objects under a light: for simulated captures and tests. Box-filtered
/// pixels; same bytes for every number of threads. Where no object is in the way the light itself
/// is seen. Progress stage "rendering", one report a sample pass; throws CancelledError.
[[nodiscard]] RenderedImage renderScene(const ObjectScene& objects,
                                        const LightSource& light,
                                        const Camera& camera,
                                        const RenderOptions& options,
                                        Progress& progress);

}  // namespace insitu
