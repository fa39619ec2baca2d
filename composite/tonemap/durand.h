#pragma once

#include "composite/tonemap/operator.h"
#include "core/finding.h"

#include <memory>

namespace insitu {

/// Parameters of Durand's and Dorsey's operator.
struct DurandOptions {
    /// Brightest over darkest luminance of the large-scale part as it is shown, > 1.
    double base_contrast = 50.0;
    /// Deviations of the bilateral filter: in space as a share of the picture's longer side, in
    /// (0, 0.5], and in decimal logarithms of luminance, > 0.
    double spatial_sigma = 0.02;
    double range_sigma = 0.4;

    /// Every problem at once: "tonemap-base-contrast", "tonemap-spatial-sigma",
    /// "tonemap-range-sigma".
    [[nodiscard]] Findings validate() const;
};

/// Durand's and Dorsey's operator: the logarithm of luminance is split by a bilateral filter into
/// base and detail; the base is compressed to `base_contrast`, the detail kept, the base's
/// brightest becomes white. A scene whose base has less contrast is not stretched.
///
/// The filter runs on a grid of cells one deviation large [CheParDur07], to within 0.01 of the
/// logarithm (rms) of the direct sum. The curve is made from the picture alone: statistics only
/// tell black scenes. Throws InputError when the options are invalid.
/// Source: [DurDor02] sections 3 to 5.
[[nodiscard]] std::unique_ptr<ToneMapOperator> makeDurand(const DurandOptions& options = {});

}  // namespace insitu
