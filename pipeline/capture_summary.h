#pragma once

#include "capture/radiance_capture.h"

#include <vector>

namespace insitu {

/// Share of each frame in a merged value, against level.
struct WeightCurve {
    std::vector<double> radiance;  ///< levels, ascending, a quarter of a stop apart
    /// weight[frame][level], frames as in CapturedRadiance::frames; the sum over frames is 1, or 0
    /// where no frame shows the level.
    std::vector<std::vector<double>> weight;
};

/// The inverse variance of each frame at a level that is neither clipped nor black in it (the
/// longest frame counts down to black), normalised: what mergeBracket() does with a pixel whose
/// level is known. `channel` is the camera's. Nothing without frames.
[[nodiscard]] WeightCurve mergeWeights(const CapturedRadiance& captured, int channel);

/// Relative standard deviation of merged pixels in one step of radiance.
struct DeviationStep {
    double radiance = 0.0;  ///< luminance in the middle of the step
    double low = 0.0;       ///< quantile 0.1 of the pixels' deviation / radiance
    double median = 0.0;
    double high = 0.0;  ///< quantile 0.9
    std::size_t pixels = 0;
};
/// By half stops, of the pixels that are not clipped; steps of fewer than 50 pixels are left out.
[[nodiscard]] std::vector<DeviationStep> mergedDeviations(const MergeResult& merged);

}  // namespace insitu
