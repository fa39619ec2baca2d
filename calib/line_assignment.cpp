#include "calib/line_assignment.h"

#include <algorithm>
#include <cmath>

namespace insitu::manhattan {

namespace {

/// A segment is of an axis when most of it is, by the mixture.
constexpr double kMember = 0.6;
/// Ends lie where edges meet others, seen a little too far or too short: cut off, share and pixels
/// of a picture 1000 px wide. Also keeps ends from being taken for common corners.
constexpr double kTrimShare = 0.04;
constexpr double kTrimPer1000 = 5.0;

LineSegment trimmed(RoomAxis axis, const DetectedSegment& segment, double long_side)
{
    const double length = segment.length();
    const double cut =
        std::min(0.2 * length, std::max(kTrimShare * length, kTrimPer1000 * 1e-3 * long_side));
    const glm::dvec2 along = (segment.to_px - segment.from_px) / length;
    return {axis, segment.from_px + along * cut, segment.to_px - along * cut};
}

}  // namespace

Assigned assignAxes(const std::vector<DetectedSegment>& segments,
                    const Task& task,
                    const Frame& frame,
                    int most_per_axis)
{
    Assigned result;
    double squares = 0.0;
    double members = 0.0;
    double weights = 0.0;
    int counts[3] = {};
    int taken = 0;
    for (std::size_t i = 0; i < segments.size(); ++i) {
        const Observation& one = task.observations[i];
        const auto shares = memberships(one, frame);
        const auto best = std::max_element(shares.begin(), shares.end()) - shares.begin();
        weights += one.weight;
        members += one.weight * (shares[0] + shares[1] + shares[2]);
        if (shares[static_cast<std::size_t>(best)] < kMember || counts[best] == most_per_axis)
            continue;
        ++counts[best];
        ++taken;
        result.segments.push_back(
            trimmed(static_cast<RoomAxis>(best), segments[i], task.long_side));
        // An angle ε is a distance ε L/2 of the ends, of which each has σ/√2.
        const double off =
            missAngle(one, frame.axes[static_cast<int>(best)], frame.focal_px) * one.length;
        squares += 0.5 * off * off;
    }
    if (taken > 0) result.sigma_px = std::max(0.05, std::sqrt(squares / taken));
    if (weights > 0.0) result.explained = members / weights;
    return result;
}

}  // namespace insitu::manhattan
