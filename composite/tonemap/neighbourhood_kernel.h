#pragma once

#include "composite/tonemap/separable.h"
#include "core/instruction_set.h"

#include <array>

/// Search for the largest uniform neighbourhood of each pixel, for one tile. Private to this
/// module; ashikhmin.h says what it computes.
///
/// G_s, a Gaussian of standard deviation s/2 pixels, is wanted for s = 1…10 and 2s. It is filtered
/// where it need not be finer: s <= 5 on the picture's pixels, 6…10 on every second pixel of the
/// picture after s = 4, 12…20 on every fourth after s = 8, then interpolated half-way twice. In its
/// own pixels each of these levels starts from a standard deviation of 1 and goes to the same five,
/// 1.5, 1.75, … 2.5, so one set of kernels serves both. Sampling a Gaussian of variance a and then
/// filtering with one of variance b leaves an alias of exp(-2 pi² ab / (a + b)) at most, 2e-5 for
/// a = 1, b = 1.25 (pixels of the level); midpoints of a Gaussian of 1.5 err by 8e-5 of its peak.
/// The sampled places are multiples of 2 and 4 of the picture, whatever the tile, so tiles have no
/// seams.
namespace insitu::tonemap {

constexpr int kScales = 10;  ///< [Ashikhmin02]: largest neighbourhood, pixels
constexpr int kFineScales = 5;
constexpr int kCoarseScales = 5;

/// Radii of the kernels: at least 3.9 standard deviations.
constexpr std::array<int, kFineScales> kFineRadius = {2, 4, 6, 8, 10};
constexpr std::array<int, kCoarseScales> kCoarseRadius = {5, 6, 7, 8, 9};
constexpr int kReduceRadius = 8;

/// Neighbours of a midpoint on either side.
constexpr int kMidpointReach = 6;

/// What each level needs around a tile, in its own pixels, from the coarsest on.
constexpr int kQuarterMargin = 9;
constexpr int kQuarterInputMargin = kQuarterMargin + 10;
constexpr int kHalfMargin = kMidpointReach;
constexpr int kHalfWideMargin =
    2 * kQuarterInputMargin;  ///< of s = 8, which the quarter starts from
constexpr int kHalfInputMargin = kHalfWideMargin + 8;
constexpr int kNeighbourhoodHalo = 2 * kHalfInputMargin + kReduceRadius;

using Kernel = std::array<float, 16>;
struct NeighbourhoodKernels {
    std::array<Kernel, kFineScales> fine;
    std::array<Kernel, kCoarseScales> coarse;
    Kernel reduce;  ///< the same as fine[3]
    Kernel midpoint;
};
[[nodiscard]] const NeighbourhoodKernels& neighbourhoodKernels();

/// LocalAdaptation::adapt with neighbourhoods whose local contrast stays below `threshold`.
void adaptToNeighbourhood(InstructionSet set,
                          const LuminancePatch& patch,
                          const WantedBlocks& blocks,
                          float threshold,
                          float* adapted);

}  // namespace insitu::tonemap
