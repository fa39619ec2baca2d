#pragma once

#include "core/image.h"

#include <vector>

namespace insitu::tonemap {

/// Tone curve from how often luminances occur. Private to this module.
struct HistogramCurve {
    /// Display luminance in [0, 1] at `log_first` + i · `log_step`, natural logarithms of cd/m².
    std::vector<float> display;
    double log_first = 0.0;
    double log_step = 1.0;
};

/// adaptation    luminances that the eye adapts to, cd/m², > 0 for those that count; 1 or more
/// black, white  of the display, cd/m², 0 < black < white
///
/// The cumulative histogram of brightness ln L, its counts cut so that no contrast is more visible
/// on the display than in the scene (equation 5.7), until what is cut is below 2.5 % of all; then
/// equations 5.8 and 5.9, times the exposure that makes the scene's thresholds the display's. When
/// everything is cut, the scene fits the display: then a straight line at that exposure.
/// Source: [Ward97] 4.3; [Mollis04] 5.6.
[[nodiscard]] HistogramCurve histogramCurve(const std::vector<float>& adaptation,
                                            double black,
                                            double white);

}  // namespace insitu::tonemap
