#pragma once

#include "core/image.h"

namespace insitu {

/// How the eye of a young observer works at an adaptation luminance. What changes with age
/// (threshold times 3.51, glare times 2.8, [Mollis04] 7.5) and with time since the light changed
/// ([Mollis04] 6) is to be added here.

/// Just noticeable difference of luminance at adaptation `luminance`, both cd/m²; rods and cones.
/// Source: [Ward97] 4.3.1, the fit to [Ferwerda96].
[[nodiscard]] double justNoticeableDifference(double luminance);

/// Finest grating that is resolved, cycles per degree. Source: [Mollis04] equation 5.2, from
/// [Ward97] 4.6. Never below 1: the fit leaves the data there.
[[nodiscard]] double acuity(double luminance);

/// Scotopic luminance of a colour in Rec. 709 primaries, same unit. Source: [Mollis04]
/// equation 5.5; never below 0. Grey keeps its luminance times 1.33·(1 + (Y + Z) / X) - 1.68, 2.57
/// for D65.
[[nodiscard]] double scotopicLuminance(const Rgb& color);

/// Share of the cones in what is seen: 0 below 0.0056, 1 above 5.6 cd/m², linear between.
/// Source: [Mollis04] equation 5.10.
[[nodiscard]] double coneShare(double luminance);

}  // namespace insitu
