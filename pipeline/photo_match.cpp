#include "pipeline/photo_match.h"

#include "core/io/image_io.h"
#include "core/parallel.h"

namespace insitu {

namespace {

/// Distance from the camera, metres, of the proxy's surface behind every pixel; 0 where there is
/// none, and in openings, beyond which all is far away.
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

/// Focal length in pixels times the aperture's width in metres, by EXIF; 0 when it lacks one.
double aperturePxM(const PhotoMetadata& metadata, const Camera& camera)
{
    if (!metadata.focal_mm || !metadata.exposure.f_number) return 0.0;
    return camera.focal_px.x * *metadata.focal_mm * 1e-3 / *metadata.exposure.f_number;
}

}  // namespace

void matchPhoto(const Project& project,
                const SceneProxy& proxy,
                const Image<Rgb>& radiance,
                const CameraMatchOptions& options,
                InsertResult& result)
{
    CameraMatchOptions match = options;
    if (project.photo_focus_m) match.focus_m = project.photo_focus_m;
    if (project.photo_vignetting) match.vignetting_a = project.photo_vignetting;
    match.estimate_vignetting = match.estimate_vignetting || project.estimate_vignetting;
    const Camera& camera = result.camera.camera;
    const double aperture_px_m = aperturePxM(result.photo.metadata, camera);
    Image<float> distance_m;
    if (match.depth_of_field && aperture_px_m > 0.0) distance_m = proxyDistance(proxy, camera);
    result.match = estimateCameraMatch(result.photo.image,
                                       result.photo_response,
                                       radiance,
                                       distance_m,
                                       {camera.principal_px, aperture_px_m},
                                       match);
    append(result.findings, result.match.findings);
    result.layers = matchLayers(result.render.layers, result.match.match, distance_m);
}

}  // namespace insitu
