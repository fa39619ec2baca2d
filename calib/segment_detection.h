#pragma once

#include "core/finding.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <vector>

namespace insitu {

/// A straight edge found in a picture. Pixels of the picture, convention of core/camera.h.
struct DetectedSegment {
    glm::dvec2 from_px{0.0};
    glm::dvec2 to_px{0.0};
    /// Standard deviation of each end across the segment that gives the fitted line's direction the
    /// error that the fit shows. Pixels, > 0.
    double sigma_px = 1.0;

    [[nodiscard]] double length() const { return glm::length(to_px - from_px); }
};

struct SegmentDetectionOptions {
    /// Pictures with a longer side are reduced to it first: edges of furniture and walls survive,
    /// texture does not. Pixels, >= 64.
    int working_side_px = 1600;
    /// Shorter segments say little about directions. Share of the picture's diagonal, (0, 0.5].
    double shortest = 0.02;
    /// The longest segments that are kept, > 0.
    int most_segments = 500;

    /// Every problem at once: "segment-options".
    [[nodiscard]] Findings validate() const;
};

/// Straight edges, the longest first.
///
/// 1. OpenCV's line segment detector on the reduced grey picture [Gioi10].
/// 2. Each is fitted anew to the places, to parts of a pixel, where the grey changes fastest across
///    it, by least squares with Tukey's weights; what has no edge along half of its length is
///    dropped. The scatter about the line gives `sigma_px`, neighbours within the blur's width
///    counting as one.
/// 3. Pieces of one edge (collinear within their errors, gap below half of the shorter) become one.
/// The order and the values do not depend on threads. InputError for unusable options; an empty
/// list where there are no edges.
[[nodiscard]] std::vector<DetectedSegment> detectSegments(
    const EncodedImage& image, const SegmentDetectionOptions& options = {});

}  // namespace insitu
