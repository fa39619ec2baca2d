#pragma once

#include "capture/light_probe.h"
#include "core/finding.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <string>

namespace insitu {

/// Looks for a mirror ball in its picture (capture/ball_outline.h) and, when it is there, sets the
/// ball's `center_px` and `radius_px`.
///
/// crop_origin_px   pixel of the full frame that is pixel (0,0) of `radiance`
/// False, and the ball as it was, when there is no outline or one that is uncertain by more than
/// 5 % of its radius. Findings: "probe-outline-found" (Info: the numbers) and those of
/// findBallOutline about an outline that is found.
[[nodiscard]] bool findProbeOutline(const Image<Rgb>& radiance,
                                    glm::dvec2 crop_origin_px,
                                    MirrorBall& ball,
                                    Findings& findings);

/// "centre (300.0, 299.5), radius 260.9 px", of the full frame.
[[nodiscard]] std::string outlineText(const MirrorBall& ball);

}  // namespace insitu
