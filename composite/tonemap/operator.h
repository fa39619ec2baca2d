#pragma once

#include "core/photo.h"
#include "core/progress.h"

namespace insitu {

/// A tone mapping operator: scene-linear radiance to what a display can show, for *viewing* HDR
/// pictures. The composite itself never passes one; it returns through the photograph's own
/// response.
///
/// Global operators are one curve for all pixels, local ones look at a pixel's surroundings; both
/// fit, since an operator sees the whole image. Calls are thread-safe and deterministic.
class ToneMapOperator {
public:
    virtual ~ToneMapOperator() = default;

    /// scene     finite and >= 0, any unit; InputError otherwise, naming the pixel
    /// Returns display-linear colour in [0, 1], same size; 1 is the display's white.
    [[nodiscard]] virtual Image<Rgb> map(const Image<Rgb>& scene, Progress& progress) const = 0;
};

/// Display-linear colour through the sRGB curve, rounded to the nearest code; values outside [0, 1]
/// are clamped. `max_code` is 255 or 65535.
[[nodiscard]] EncodedImage encodeSrgb(const Image<Rgb>& display, int max_code = 255);

}  // namespace insitu
