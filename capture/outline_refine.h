#pragma once

#include "capture/ball_outline.h"
#include "capture/outline_fit.h"
#include "capture/outline_picture.h"

#include <optional>

namespace insitu::detail {

/// Fewest and most rays that a circle is looked at along; about one a pixel between.
[[nodiscard]] int outlineRays(double radius);

[[nodiscard]] Outline outlineOf(const BallOutline& ball);

/// Edges in a window about the outline, joined by consensus, then fitted. The consensus is of a
/// circle, or of an ellipse of the given outline's shape; an ellipse near a circle is looked for in
/// a band about the circle as wide as it needs.
[[nodiscard]] std::optional<OutlineFit> searchNear(
    const OutlinePicture& picture, const Outline& near, int rays, double window, bool ellipse);

/// The outline with what the picture says about it: both its shares.
[[nodiscard]] BallOutline withShares(const OutlinePicture& picture, BallOutline ball);

/// From an outline that is right within `window` pixels to one that is right within about a pixel:
/// consensus in windows that shrink, then the rim's likelihood. An ellipse keeps the shape of the
/// one it starts from: where a ball is changes it little. Without standard deviations.
[[nodiscard]] std::optional<BallOutline> approachOutline(const OutlinePicture& picture,
                                                         Outline outline,
                                                         double window,
                                                         bool ellipse);

/// From there to a fraction of a pixel; `ellipse`: the shape is looked for as well.
[[nodiscard]] std::optional<BallOutline> refineOutline(const OutlinePicture& picture,
                                                       const BallOutline& near,
                                                       bool ellipse);

}  // namespace insitu::detail
