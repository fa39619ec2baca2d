#pragma once

#include "composite/tonemap/separable.h"
#include "core/finding.h"

#include <memory>
#include <optional>

namespace insitu {

/// How a scene's numbers stand for light, and the display's: for operators that model the eye.
struct ViewingOptions {
    /// Luminance of scene value 1, cd/m², > 0. Nothing: the log average becomes
    /// `kUnknownLogAverage`, that of a lived-in room by day.
    std::optional<double> scene_white_cd_m2;
    /// Luminance of the display's white, cd/m², > 0: 80 in sRGB's reference conditions, 100 in
    /// common use.
    double display_white_cd_m2 = 100.0;

    /// cd/m². 250 lux on surfaces that reflect a third and more: 30.
    static constexpr double kUnknownLogAverage = 30.0;

    /// What a scene's values are multiplied by to be cd/m²; 1 when it is black.
    [[nodiscard]] double scale(const SceneStatistics& statistics) const;
    /// Codes "tonemap-scene-white", "tonemap-display-white".
    [[nodiscard]] Findings validate() const;
};

/// Parameters of Ashikhmin's operator.
struct AshikhminOptions {
    ViewingOptions viewing;
    /// Local contrast at which a neighbourhood is no longer uniform. Unitless, in (0, 1): 0.5 in
    /// the paper.
    double contrast_threshold = 0.5;

    /// Every problem at once: those of `viewing`, "tonemap-contrast-threshold".
    [[nodiscard]] Findings validate() const;
};

/// Ashikhmin's operator, with a local part (`local()`) and the perceptual capacity curve.
///
/// Local part. The adaptation luminance La of a pixel is G_s, the mean of its surroundings weighted
/// with a Gaussian of standard deviation s/2 pixels, at the scale s in [0, 10] where the local
/// contrast |G_s - G_2s| / G_s first reaches the threshold; contrast and G_s are linear between
/// whole s, G_0 is the pixel itself and its contrast 0. The picture's border pixels go on outside.
///
/// Global part. With the threshold t(L) of just visible differences and the capacity C = ∫ dL / t,
///     TM(La) = white (C(La) - C(Lmin)) / (C(Lmax) - C(Lmin)),
///     Ld = TM(La) + t(TM(La)) / t(La) (L - La), cut to [0, white].
/// A scene of one luminance has no range: it becomes middle grey, 18 % of the white.
///
/// The paper leaves the weights of "a filter of size s" open; this width is that of [Pharr04] 8.5.
/// Throws InputError when the options are invalid.
/// Source: [Ashikhmin02] sections 3.1 to 3.3; [Michael10] 4.3.
[[nodiscard]] std::unique_ptr<SeparableOperator> makeAshikhmin(
    const AshikhminOptions& options = {});

/// Threshold of visible differences at adaptation luminance L >= 0, cd/m², piecewise power laws,
/// and its integral C, in just visible steps from black, with the paper's constants: C rises by
/// 0.02 at 0.0034 cd/m², where these are rounded. Source: [Ashikhmin02] section 3.1.
[[nodiscard]] double visibleThreshold(double luminance);
[[nodiscard]] double perceptualCapacity(double luminance);

}  // namespace insitu
