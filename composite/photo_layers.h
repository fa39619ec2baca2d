#pragma once

#include "core/image.h"
#include "core/layers.h"

namespace insitu {

/// Rendered layers as the photograph's camera shows them (match/camera_match.h): RenderLayers whose
/// lens may cover a pixel differently in each channel.
struct PhotoLayers {
    Image<Rgb> object;  ///< premultiplied
    Image<Rgb> coverage;
    Image<Rgb> irradiance_without;
    Image<Rgb> irradiance_with;
    Image<Rgb> probe_radiance;
    Image<float> object_variance;
    Image<float> depth_m;  ///< of what covers the pixel, 0 where nothing does
};

}  // namespace insitu
