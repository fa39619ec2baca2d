#pragma once

#include "composite/tonemap/separable.h"
#include "core/finding.h"

#include <memory>
#include <optional>

namespace insitu {

/// Parameters of Reinhard's global operator.
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

}  // namespace insitu
