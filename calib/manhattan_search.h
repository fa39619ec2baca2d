#pragma once

#include "calib/orientation.h"
#include "calib/segment_detection.h"

#include <glm/glm.hpp>

#include <array>
#include <optional>
#include <vector>

/// Internal to calib/: three directions at right angles in a heap of segments. Not installed.
///
/// Common rules: pixels relative to the principal point. A frame's axes are unordered and unsigned.
/// Everything is a function of the segments alone: no random numbers.
namespace insitu::manhattan {

/// A segment as evidence of a direction.
struct Observation {
    glm::dvec2 middle{0.0};
    glm::dvec2 along{1.0, 0.0};  ///< unit vector
    double length = 0.0;
    double sigma = 0.0;   ///< of its angle, from the fit alone. Radians
    double weight = 1.0;  ///< of its evidence: long edges are rarely clutter. (0, 1]
};

struct Frame {
    glm::dmat3 axes{1.0};  ///< columns: the directions in the camera's frame, a rotation
    double focal_px = 0.0;
    double slack = 0.0;  ///< angle by which segments miss beyond their own error, 1σ. Radians
    double score = 0.0;  ///< logarithm of the evidence, against segments of any direction
};

/// Focal lengths beyond these multiples of the long side are no lens for a room: 127° and 7°.
inline constexpr double kShortestLens = 0.25;
inline constexpr double kLongestLens = 8.0;

struct Task {
    std::vector<Observation> observations;  ///< the longest first
    double long_side = 0.0;
    std::optional<FocalPrior> prior;
    std::optional<Gravity> up;
};

/// segments   the longest first, as detectSegments gives them
[[nodiscard]] Task makeTask(const std::vector<DetectedSegment>& segments,
                            int width,
                            int height,
                            const std::optional<FocalPrior>& prior);

/// Sine of the angle at a segment's middle between it and its line to the vanishing point of
/// `direction`, signed; at infinity like anywhere else.
[[nodiscard]] double missAngle(const Observation& segment, glm::dvec3 direction, double focal_px);

/// Shares of a segment that belong to each axis; what is missing to 1 belongs to none.
[[nodiscard]] std::array<double, 3> memberships(const Observation& segment, const Frame& frame);

/// Σ weight · ln(p(angle | frame) / p(angle | any direction)), a mixture of the three axes and
/// clutter, plus what is known beforehand of how photographs are taken (see the source).
[[nodiscard]] double evidence(const Task& task, const Frame& frame);

/// Expectation–maximisation over rotation, focal length and slack from a start; the score is set.
[[nodiscard]] Frame refined(const Task& task, Frame start);

/// σ of ln f that the segments alone leave, to first order; infinite when they don't tell it.
[[nodiscard]] double focalSigma(const Task& task, const Frame& frame);

/// Candidates: vanishing points of pairs of long segments; for each of the best, and each focal
/// length of a grid (or about the prior), the others vote for the turn about it. The best are
/// refined. Distinct local maxima, the best first; empty when there are too few segments.
/// Source: the vote about one axis after [Lu17]; the mixture after [CouYui03].
[[nodiscard]] std::vector<Frame> search(const Task& task);

/// Largest angle between an axis of a and the nearest axis of b. Radians
[[nodiscard]] double axesApart(const Frame& a, const Frame& b);

}  // namespace insitu::manhattan
