#include "pipeline/photo_match.h"

#include "core/parallel.h"

namespace insitu {

Image<float> proxyDistance(const SceneProxy& proxy, const Camera& camera)
{
    Image<float> distance_m(camera.width, camera.height);
    parallelFor(0, camera.height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < camera.width; ++x) {
            const glm::dvec3 direction = camera.rayDirection({x + 0.5, y + 0.5});
            const auto hit = proxy.intersect(camera.position_m, direction);
            if (hit && !hit->opening) distance_m(x, y) = static_cast<float>(hit->distance_m);
        }
    });
    return distance_m;
}

double aperturePxM(const PhotoMetadata& metadata, const Camera& camera)
{
    if (!metadata.focal_mm || !metadata.exposure.f_number) return 0.0;
    return camera.focal_px.x * *metadata.focal_mm * 1e-3 / *metadata.exposure.f_number;
}

}  // namespace insitu
