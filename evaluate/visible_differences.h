#pragma once

#include "core/finding.h"
#include "core/image.h"
#include "core/progress.h"

namespace insitu {

/// How two pictures are looked at.
struct ViewingConditions {
    /// Pixels per degree of visual angle, > 0: 30 is a 0.25 mm display at 43 cm.
    double pixels_per_degree = 30.0;
    double distance_m = 0.5;  ///< > 0
    /// Luminance of display values 1 and 0, cd/m²; 0 < black < white.
    double white_cd_m2 = 100.0;
    double black_cd_m2 = 1.0;

    /// Every problem at once: "viewing-conditions".
    [[nodiscard]] Findings validate() const;
};

/// Probability above which a difference counts as seen.
constexpr double kSeenProbability = 0.75;

/// Where an observer sees a difference between two pictures.
struct VisibleDifferences {
    Image<float> probability;      ///< that the difference at the pixel is seen, [0, 1]
    double percent_seen = 0.0;     ///< pixels with a probability above kSeenProbability: "VDP %"
    double percent_certain = 0.0;  ///< above 0.95
};

/// The visible differences predictor: amplitude non-linearity, contrast sensitivity, cortex
/// transform into 31 bands, masking in each (mutual: the lesser of both pictures'), psychometric
/// function, probability summation.
///
/// reference, picture   same size, not empty; display-*linear* luminance, [0, 1]
/// Contrast is the band over the mean response, divided by the non-linearity's slope there, so that
/// a grating whose contrast is the inverse of the sensitivity is seen with probability 0.5: the
/// predictor's calibration. The mean level itself is not judged. Pictures are mirrored at their
/// borders. Memory: 24 bytes a pixel and the result. Throws InputError for sizes and values,
/// CancelledError.
/// Source: [Daly93].
[[nodiscard]] VisibleDifferences visibleDifferences(const Image<float>& reference,
                                                    const Image<float>& picture,
                                                    const ViewingConditions& viewing,
                                                    Progress& progress);

/// Sensitivity, 1 / threshold contrast, to a grating.
///
/// cycles_per_degree   > 0
/// orientation         radians, of the wave vector from horizontal
/// luminance           adaptation, cd/m²
/// area_deg2           of the picture, square degrees
/// Source: [Daly93] section III.B, peak sensitivity 250.
[[nodiscard]] double contrastSensitivity(double cycles_per_degree,
                                         double orientation,
                                         double luminance,
                                         double area_deg2,
                                         double distance_m);

/// How many times its threshold a contrast has to be, to be seen before a mask of contrast `mask`
/// (in units of the mask's own threshold). Source: [Daly93] section III.D, slope 0.7.
[[nodiscard]] double thresholdElevation(double mask);

}  // namespace insitu
