#pragma once

#include "composite/match/grain.h"

#include <array>

// The measurements under estimateGrain; private to this module.

namespace insitu {

/// A block of 16×16 pixels, none of them clipped or black.
struct GrainBlock {
    int x = 0;
    int y = 0;
    glm::dvec3 level{0.0};     ///< mean code, 8-bit steps
    glm::dvec3 variance{0.0};  ///< about the plane that fits best, per degree of freedom
};

inline constexpr int kGrainBlock = 16;

/// Every usable block, side by side from the top-left corner.
[[nodiscard]] std::vector<GrainBlock> grainBlocks(const EncodedImage& photo);

/// Covariances of noise divided by its deviation, for shifts (dx, dy) within ±kReach.
struct GrainCorrelation {
    static constexpr int kReach = 4;
    static constexpr int kSide = 2 * kReach + 1;
    /// [ (dy + reach)·side + dx + reach ], element [d][c]: of channel c here with d shifted.
    std::array<glm::dmat3, kSide * kSide> covariance{};
    /// Share of the variance that survives taking off a plane, by channel, (0, 1].
    glm::dvec3 left_by_plane{1.0};
};

/// `measured` holds the deviations including rounding, whose variance is `rounding` (8-bit steps
/// squared) and counts as white.
[[nodiscard]] GrainCorrelation grainCorrelation(const EncodedImage& photo,
                                                const std::vector<GrainBlock>& flat,
                                                const GrainModel& measured,
                                                double rounding);

/// The kernel whose noise has that correlation: the square root of its spectrum, which is a
/// Hermitian matrix of the three channels at every frequency; unit variance in each channel.
void setKernel(const GrainCorrelation& correlation, GrainModel& model);

}  // namespace insitu
