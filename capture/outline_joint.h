#pragma once

#include "capture/outline_fit.h"
#include "capture/rim_likelihood.h"

#include <optional>

namespace insitu::detail {

struct JointFit {
    Outline outline;
    double center_sigma = 0.0;  ///< pixels, worse axis
    double radius_sigma = 0.0;  ///< pixels
    double share = 0.0;         ///< of the rays, those that show the rim at the outline
    double cost = 0.0;          ///< tempered and bounded, mean over rays
};

/// The circle, or ellipse, that all rays together find likeliest: the least sum of their costs,
/// each bounded so that a ray across clutter, a hand or a stand has no more say than one that is
/// three standard deviations off. Costs are divided by what makes the rays agree with the answer as
/// well as independent ones would: a model that is not quite right is as sure of itself as one that
/// is. The standard deviation is that of answers from sectors of 10 degrees drawn with replacement
/// [Efron79], each searched anew, so that it holds the distance to a second answer that is almost
/// as likely. Nothing without 12 rays that show something.
///
/// around, reach   those that the costs were computed for
/// draws           of sectors, for the standard deviation; 0: it stays 0
[[nodiscard]] std::optional<JointFit> fitJointly(
    const RimCosts& costs, const Outline& around, bool ellipse, double reach, int draws);

/// Of the rays in the picture, the share that shows the rim at the outline the costs were computed
/// for.
[[nodiscard]] double shareOfRim(const RimCosts& costs, const Outline& outline, double reach);

}  // namespace insitu::detail
