#pragma once

#include "core/image.h"

#include <cstdint>

namespace insitu {

/// Smooths a noisy quantity of the room's surfaces (irradiance, or its change) over neighbouring
/// pixels of the same surface, no farther than its own noise justifies.
///
/// Irradiance carries no texture, so it may be smoothed where the photograph may not; edges of
/// shadows stay because a neighbour counts only when it differs by no more than the noise. An
/// edge-avoiding à-trous wavelet [Dammertz10] whose range weight follows the per-pixel variance
/// [Schied17], 5x5 B3 spline, `levels` scales.
struct IrradianceFilterOptions {
    int levels = 4;             ///< reach 2^(levels+1) pixels; 0: no filter
    double range_sigmas = 3.0;  ///< how many standard deviations a neighbour may differ, > 0
};

/// values     per pixel; `variance` is that of the luminance of each, >= 0
/// surface    which surface a pixel shows; pixels of different surfaces do not mix; -1: none
/// Both images are replaced by the filtered ones (variance: of the weighted mean, neighbours
/// taken as independent). Same bytes for every number of threads.
void filterIrradiance(Image<Rgb>& values,
                      Image<float>& variance,
                      const Image<std::int32_t>& surface,
                      const IrradianceFilterOptions& options);

}  // namespace insitu
