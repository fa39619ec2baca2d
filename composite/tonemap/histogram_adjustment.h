#pragma once

#include "composite/tonemap/ashikhmin.h"
#include "composite/tonemap/operator.h"

#include <memory>

namespace insitu {

/// Parameters of histogram adjustment.
struct HistogramAdjustmentOptions {
    ViewingOptions viewing;
    /// Luminance of the display's black in the room where it stands, cd/m², above 0 and below its
    /// white.
    double display_black_cd_m2 = 1.0;
    /// Horizontal field of view of the picture, degrees, in (0, 170].
    double field_of_view_deg = 60.0;
    bool veil = true;    ///< light that scatters in the eye
    bool acuity = true;  ///< detail that dim light hides
    bool color = true;   ///< colour that dim light takes away

    /// Every problem at once: those of `viewing`, "tonemap-display-black", "tonemap-field-of-view".
    [[nodiscard]] Findings validate() const;
};

/// Ward's histogram adjustment: what an observer, adapted to the scene, could see of it.
///
/// A foveal image of one degree a pixel; veiling luminance, 8.7 % of the light; at each place the
/// acuity of its adaptation luminance, blurred for through a pyramid; between 0.0056 and 5.6 cd/m²
/// colour fades to scotopic grey; the histogram of adaptation luminances, cut so that no contrast
/// is more visible on the display than in the scene, becomes the curve; the exposure matches the
/// just noticeable differences. A static observer: no time course. `statistics` gives the scale
/// only, so a set does not share a curve. Throws InputError when the options are invalid. Source:
/// [Ward97]; [Mollis04] chapter 5, equations 5.1 to 5.10.
[[nodiscard]] std::unique_ptr<ToneMapOperator> makeHistogramAdjustment(
    const HistogramAdjustmentOptions& options = {});

}  // namespace insitu
