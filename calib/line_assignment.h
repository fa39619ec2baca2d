#pragma once

#include "calib/line_segments.h"
#include "calib/manhattan_search.h"

#include <vector>

/// Internal to calib/: which detected segments run along which axis of a frame. Not installed.
namespace insitu::manhattan {

struct Assigned {
    std::vector<LineSegment> segments;  ///< ends cut off a little, see the source
    double sigma_px = 1.0;   ///< of an end, as the segments' distances from the frame show
    double explained = 0.0;  ///< share of all segments, by weight, that follows an axis
};

/// segments   those that `task` was made from, in its order
/// frame      its columns are x, y, z
[[nodiscard]] Assigned assignAxes(const std::vector<DetectedSegment>& segments,
                                  const Task& task,
                                  const Frame& frame,
                                  int most_per_axis);

}  // namespace insitu::manhattan
