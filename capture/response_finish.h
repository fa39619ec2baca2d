#pragma once

#include "capture/response_groups.h"
#include "capture/response_solve.h"
#include "core/finding.h"

#include <array>
#include <vector>

namespace insitu::detail {

/// Lowest and highest code that the samples of a channel show; low > high: none.
struct CodeReach {
    double low = 255.0;
    double high = 0.0;
};
[[nodiscard]] CodeReach reachOf(const PixelGroups& groups);
[[nodiscard]] CodeReach reachOf(const std::vector<PatchObservations>& patches);

/// Continues each curve beyond its channel's reach in the shape of the channels that reach there,
/// as steep against them as before the end: one camera's channels differ little in shape. A channel
/// without reach is the others' mean.
void borrowShapes(std::array<LogCurve, 3>& curves, const std::array<CodeReach, 3>& reaches);

/// Brings the curve to nothing at the level of black (a code, 0: none): along a straight line from
/// `lowest`, the lowest code that samples reach; below, entries go on falling, to increase
/// strictly.
void applyFloor(LogCurve& curve, int floor, double lowest);

/// Isotonic regression (pool adjacent violators, [BarBrunk72]) and then a least step, so that the
/// table is strictly increasing.
void makeIncreasing(LogCurve& curve);

/// "response-partly-extrapolated", "response-channel-borrowed"
[[nodiscard]] Findings reachFindings(const std::array<CodeReach, 3>& reaches);

/// "response-exposures-refined" and "bracket-exposure-mismatch" from ln of the frames' corrections.
[[nodiscard]] Findings exposureFindings(const Bracket& bracket,
                                        const std::vector<double>& log_scale);

/// "bracket-exposure-mismatch" for neighbours that are the same picture, or in the wrong order,
/// although their exposures differ: needs no curve. `triples` of one channel.
[[nodiscard]] Findings orderFindings(const Bracket& bracket,
                                     const std::vector<FrameTriple>& triples);

}  // namespace insitu::detail
