#pragma once

#include "capture/ball_outline.h"
#include "capture/outline_picture.h"

#include <optional>

namespace insitu::detail {

/// The ball in the whole picture: circles that the reduced picture's edges vote for, judged there
/// by what long arcs show, the best of them in full resolution. Nothing when no circle shows
/// anything.
[[nodiscard]] std::optional<BallOutline> searchPicture(const OutlinePicture& picture,
                                                       const BallOutlineOptions& options);

}  // namespace insitu::detail
