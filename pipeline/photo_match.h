#pragma once

#include "composite/match/camera_match.h"
#include "core/camera.h"
#include "core/photo.h"
#include "reconstruct/scene_proxy.h"

namespace insitu {

/// Distance from the camera, metres, of the proxy's surface behind every pixel; 0 where there is
/// none, and in openings, beyond which all is far away.
[[nodiscard]] Image<float> proxyDistance(const SceneProxy& proxy, const Camera& camera);

/// Focal length in pixels times the aperture's width in metres, by EXIF; 0 when it lacks one.
[[nodiscard]] double aperturePxM(const PhotoMetadata& metadata, const Camera& camera);

}  // namespace insitu
