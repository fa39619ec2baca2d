#pragma once

#include "calib/segment_detection.h"
#include "core/image.h"

#include <optional>

/// Internal to calib/: a straight edge fitted to a grey picture. Not installed.
namespace insitu::edges {

/// The segment moved onto the edge beside it, to parts of a pixel, and how well that is known.
///
/// grey     codes; pixel centres at +0.5
/// reach    how far across the segment the edge is looked for, pixels
/// Nothing when less than half of its length shows an edge there.
[[nodiscard]] std::optional<DetectedSegment> fitEdge(const Image<float>& grey,
                                                     const DetectedSegment& segment,
                                                     double reach);

/// Pieces of one edge joined, and fitted anew; the longest first.
[[nodiscard]] std::vector<DetectedSegment> joinPieces(std::vector<DetectedSegment> segments,
                                                      const Image<float>& grey);

}  // namespace insitu::edges
