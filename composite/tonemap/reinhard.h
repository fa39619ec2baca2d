#pragma once

#include "composite/tonemap/separable.h"
#include "core/finding.h"

#include <memory>
#include <optional>

namespace insitu {

/// Parameters of Reinhard's operators.
struct ReinhardOptions {
    /// Where the scene's log-average luminance lands: 0.18 is middle grey; less for a night scene,
    /// more for snow. Unitless, > 0.
    double key = 0.18;
    /// Smallest luminance that becomes white, in units of the scaled luminance (log average =
    /// key), > 0. Nothing: the brightest pixel, so that nothing burns out.
    std::optional<double> white;

    /// Every problem at once: codes "tonemap-key", "tonemap-white".
    [[nodiscard]] Findings validate() const;
};

/// Reinhard's global operator: scale the log-average luminance to the key, compress with
/// L (1 + L / white²) / (1 + L), keep the ratios of the channels.
/// Throws InputError when the options are invalid.
/// Source: [Reinhard02] equations 1, 2 and 4.
[[nodiscard]] std::unique_ptr<SeparableOperator> makeReinhard(const ReinhardOptions& options);

/// Reinhard's local operator, dodging and burning: L (1 + L / white²) / (1 + V), V the mean of a
/// pixel's surroundings, weighted with a Gaussian as wide as they are alike.
///
/// Gaussians of standard deviation s/4, s = 1, 1.6, … 1.6^8 (0.25 to 10.7 pixels), cut at 32
/// pixels; V is the one of the largest s below 1.6^8 up to which |V(s) − V(1.6 s)| < 0.05 (2^8 key
/// / s² + V(s)) throughout. The picture's border pixels go on outside. Throws InputError when the
/// options are invalid. Source: [Reinhard02] equations 5 to 9.
[[nodiscard]] std::unique_ptr<SeparableOperator> makeReinhardLocal(const ReinhardOptions& options);

}  // namespace insitu
