#pragma once

#include "capture/outline_fit.h"
#include "capture/outline_picture.h"

#include <vector>

namespace insitu::detail {

/// The place of a mirror's rim on each of `rays` rays, to a fraction of a pixel, within `reach`
/// pixels of the outline; no more than one a ray. Weights fall from 1 as the place gets uncertain.
///
/// Along a ray, with s the distance inwards from the rim, a profile is modelled as
///   outside  a + b |s|        (background)
///   inside   c + d sqrt(s)    (a normal at 1 - s/R of the outline's radius turns the ray
///                              2 sqrt(2 s/R) away from straight on)
/// blurred by a Gaussian. For every place the four numbers are linear; the place whose residual is
/// the least is the rim. The blur is the one of few that fits most rays best.
[[nodiscard]] std::vector<RimRay> locateRim(const OutlinePicture& picture,
                                            const Outline& outline,
                                            int rays,
                                            double reach);

}  // namespace insitu::detail
