#pragma once

#include "core/camera.h"
#include "core/environment_map.h"
#include "core/finding.h"
#include "core/image.h"
#include "core/layers.h"
#include "pipeline/project.h"
#include "reconstruct/scene_proxy.h"

#include <cstddef>

namespace insitu {

/// Exposure and white balance of the photograph against the light probe, from surfaces that both
/// see.
struct PhotoBalance {
    /// Photographed radiance over the probe's, per channel and in luminance: medians over pixels.
    /// 1 where `pixels` is 0.
    glm::dvec3 measured{1.0};
    double luminance = 1.0;
    /// Half the interquartile range of the logarithm over pixels, the same.
    glm::dvec3 spread{0.0};
    double luminance_spread = 0.0;
    /// Standard deviation of the colour, measured over its green, as a logarithm: how much the
    /// surfaces, each by itself, disagree.
    glm::dvec3 color_sigma{0.0};
    std::size_t pixels = 0;  ///< that were compared; 0 when fewer than 100 could be
    /// What the photograph's radiance is taken to be of the probe's.
    glm::dvec3 used{1.0};
    Findings findings;
};

/// Compares every pixel (of large photographs some) that shows a surface of the room, not a solid
/// box, which the probe sees too: unclipped in both, not nearly black. `radiance` is the
/// photograph's by its exposure and response, `clip` the luminance-free limit per channel above
/// which it is clipped.
[[nodiscard]] PhotoBalance measurePhotoBalance(const Image<Rgb>& radiance,
                                               glm::dvec3 clip,
                                               const Camera& camera,
                                               const SceneProxy& proxy,
                                               const EnvironmentMap& probe,
                                               glm::dvec3 probe_center_m);

/// Decides what is used. None: 1, or, when photograph and probe share no known unit (`unit_known`
/// false), what was measured in luminance. Given: the numbers. Solved: all that was measured. Auto:
/// all that was measured when the colour (over green, which cameras hardly amplify) is off by more
/// than 5 % and by more than three of its standard deviations: then EXIF does not tell how much
/// light each channel got. Else as None.
///
/// Findings: "light-scale-from-photograph" and, where no surface tells it, "light-scale-assumed"
/// (no known unit), "light-photo-mismatch" (luminance
/// off by more than 25 % though exposures are known, and not solved), "photo-white-balance-solved"
/// (gains, residual), "photo-white-balance-doubtful" (off, but the surfaces disagree by too much to
/// solve it, or nothing is seen by both though it was asked for).
void choosePhotoBalance(const ProjectWhiteBalance& wanted, bool unit_known, PhotoBalance& balance);

/// Multiplies all light in the layers, per channel: from the probe's balance to the photograph's.
void scaleLight(RenderLayers& layers, glm::dvec3 gains);

}  // namespace insitu
