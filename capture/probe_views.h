#pragma once

#include "capture/light_probe.h"
#include "capture/probe_inpaint.h"

#include <glm/glm.hpp>

#include <functional>
#include <vector>

namespace insitu {

/// One picture of the ball, and what is not to be used of it.
struct ProbeView {
    Image<Rgb> radiance;
    MirrorBall ball;
    Camera camera;
    glm::dvec2 crop_origin_px{0.0};  ///< pixel of the full frame that is pixel (0,0) of `radiance`
    /// Of the same size as `radiance`, or empty: non-zero on the photographer, the tripod, a
    /// scratch.
    ProbeMask mask;
    /// As UnwrapOptions::clipped, or empty.
    Image<Rgb> clipped = {};
};

struct MergeViewsOptions {
    int width = 0;  ///< of the map; 0: chosen from the largest ball
    /// As in UnwrapOptions; views from different places need it to agree about things nearby.
    std::function<double(glm::dvec3 origin, glm::dvec3 direction)> distance_to_room;
    /// Scales every view to the first one by the median ratio of what both see.
    bool match_exposure = false;
};

struct MergedProbe {
    LightProbe probe;
    /// By view and channel: median of (this view / the first view) over directions that both see
    /// well; 1 for the first and where there are none.
    std::vector<glm::dvec3> exposure_ratios;
};

/// One environment from pictures of the same ball, at the same place, from several sides.
///
/// Every view is unwrapped as by unwrapMirrorBall and weighted by direction: a far ball shows every
/// solid angle in equally many pixels, but ever more stretched away from the camera, R cos(psi/2)/2
/// pixels per radian along; the weight is the fourth power of that, less its value at the rim,
/// hence 0 there and in the blind spot, and falls smoothly to 0 over 5 % of the radius beside a
/// mask. So each place is taken from the view that shows it sharpest, without a seam, and
/// photographer and blind spot vanish where another view sees behind them.
///
/// What no view shows takes the rim's radiance ("probe-blind-spot", share of the sphere) or, when
/// it is masked, is painted in ("probe-inpainted"). "probe-views-disagree": two views differ by
/// more than 10 % in the median, or half of what both see by more than 25 % after that. One view is
/// allowed. InputError: no view, a ball at different places, unusable view or mask; NoAnswerError:
/// masks cover all.
[[nodiscard]] MergedProbe mergeProbeViews(const std::vector<ProbeView>& views,
                                          const MergeViewsOptions& options = {});

}  // namespace insitu
