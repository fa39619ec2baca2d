#pragma once

#include "pipeline/insert.h"
#include "reconstruct/scene_proxy.h"

namespace insitu {

/// What the photograph shows of its camera, into `result.match`, and the rendered layers with it,
/// into `result.layers`. Of `options`, what the project says of its photograph is taken instead.
/// `radiance` is photographedRadiance.
void matchPhoto(const Project& project,
                const SceneProxy& proxy,
                const Image<Rgb>& radiance,
                const CameraMatchOptions& options,
                InsertResult& result);

}  // namespace insitu
