#pragma once

#include "calib/manhattan_search.h"

#include <optional>

/// Internal to calib/: rooms with more than three directions (Atlanta worlds). Not installed.
namespace insitu::manhattan {

/// A second pair of horizontal directions at right angles, turned about the upright axis.
struct SecondFrame {
    double turn = 0.0;  ///< from the first, counter-clockwise seen from above; radians, (0, π/2)
    double evidence = 0.0;  ///< logarithm, what it explains of the rest
    int segments = 0;       ///< that run along it and along no axis of the first
};

/// Looks among the segments that follow no axis of `frame` (its columns x, y up, z) for a second
/// pair of horizontal directions: all turns are tried, the evidence is that of a mixture with the
/// two directions more, their number of trials taken off. Nothing below `least_evidence`.
///
/// A furnished room is a Manhattan world only as far as its furniture stands along its walls.
/// Source: [SchDel04], the Atlanta world.
[[nodiscard]] std::optional<SecondFrame> secondFrame(const Task& task,
                                                     const Frame& frame,
                                                     double least_evidence);

}  // namespace insitu::manhattan
