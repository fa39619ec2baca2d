#pragma once

#include <array>

namespace insitu::cortex {

/// Filters of the cortex transform, in the frequency plane. Private to this module.
/// Source: [Watson87], as modified in [Daly93] section III.C: five octaves in six orientations and
/// a base; they sum to 1 at every frequency.

constexpr int kOctaves = 5;
constexpr int kOrientations = 6;
/// The base comes last.
constexpr int kBands = kOctaves * kOrientations + 1;

/// Weight of a band at (x, y), cycles per pixel in [-0.5, 0.5].
[[nodiscard]] double bandWeight(int band, double x, double y);

}  // namespace insitu::cortex
