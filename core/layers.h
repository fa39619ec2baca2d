#pragma once

#include "core/image.h"

namespace insitu {

/// What a renderer hands to the compositor: same size and camera as the photograph.
///
/// A receiver is the real surface (floor, wall, box) behind a pixel. Its two irradiances come from
/// common random numbers, so their ratio and difference are far quieter than either.
struct RenderLayers {
    /// Premultiplied radiance of the objects, averaged over the pixel.
    Image<Rgb> object;
    /// Coverage of the pixel by objects, [0, 1].
    Image<float> alpha;
    /// Irradiance of the receiver without and with the objects, averaged over the part of the
    /// pixel that no object covers. Both 0 where a pixel has no receiver (opening, background).
    Image<Rgb> irradiance_without;
    Image<Rgb> irradiance_with;
    /// Distance from the camera in metres of the nearest object, 0 where there is none.
    Image<float> depth_m;
    /// Estimated variance of the mean: of `object` (luminance) and of with/without (luminance of
    /// the ratio).
    Image<float> object_variance;
    Image<float> ratio_variance;
    /// Radiance of the receiver as the light probe saw it, 0 where the probe did not see it:
    /// bounds clipped pixels of the photograph.
    Image<Rgb> probe_radiance;
};

}  // namespace insitu
