#pragma once

#include "composite/tonemap/separable.h"
#include "core/finding.h"

#include <memory>

namespace insitu {

/// Where the local part of a separable operator is spent.
struct SelectiveOptions {
    /// A pixel is important when the Sobel gradient (kernel 1 2 1, not normalised: 8 times the
    /// slope per pixel) of the *natural logarithm of luminance* is above this, > 0. 0.1 is a step
    /// of 2.5 % between two pixels, about half of what the eye can just see. The logarithm, unlike
    /// the HDR values of [Michael10] 4.4.2.2, gives the same answer in every unit and in shadows.
    double importance_threshold = 0.1;
    /// Pixels that count whatever the gradient, as weights in [0, 1], of the scene's size; empty:
    /// none. For `insert` the object and its shadow.
    Image<float> always;
    /// In place of the gradient: a map in [0, 1] of the scene's size, e.g. a saliency map;
    /// important where it is above `importance_threshold`. Empty: the gradient.
    Image<float> importance;

    /// Every problem at once: "tonemap-importance-threshold", "tonemap-importance-map" for values
    /// outside [0, 1].
    [[nodiscard]] Findings validate() const;
};

/// Any separable operator, its local part evaluated where it matters and each other pixel adapting
/// to itself.
///
/// Importance is gathered in cells of 4x4 pixels, spread by 12 pixels (a neighbourhood that reaches
/// an edge belongs to it) and faded over the next 12, so that the two parts meet without a seam;
/// the local part is then evaluated in whole blocks of 64x16 pixels. Both are places of the
/// picture, not of the tiles it is cut into. Throws InputError when options are invalid, or, in
/// map, when a map has not the scene's size. Source: [Michael10] 4.4.
[[nodiscard]] std::unique_ptr<ToneMapOperator> makeSelective(
    std::shared_ptr<const SeparableOperator> tone_map, SelectiveOptions options = {});

/// Share of a scene's pixels whose block `makeSelective` would evaluate locally, [0, 1].
[[nodiscard]] double selectedShare(const SeparableOperator& tone_map,
                                   const SelectiveOptions& options,
                                   const Image<Rgb>& scene);

}  // namespace insitu
