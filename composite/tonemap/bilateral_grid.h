#pragma once

#include "core/image.h"

namespace insitu::tonemap {

/// Bilateral filter of finite values with Gaussians of deviation `spatial_sigma` pixels, > 0, and
/// `range_sigma`, > 0, in the values' unit; outside the picture there is nothing. By a grid whose
/// cells are so large that spreading, blurring and looking up have these deviations together.
/// Independent of the number of threads. Source: [CheParDur07]. Private to this module.
[[nodiscard]] Image<float> bilateralFilter(const Image<float>& values,
                                           double spatial_sigma,
                                           double range_sigma);

}  // namespace insitu::tonemap
