#pragma once

#include "capture/bracket.h"

#include <glm/glm.hpp>

#include <optional>
#include <string>
#include <vector>

namespace insitu::detail {

/// Codes below this share of full scale count as black, above the other one as clipped.
inline constexpr double kBlackShare = 0.016;
inline constexpr double kClipShare = 0.96;

/// The frame with the most pixels between black and clipped; the middle one of several equal ones.
[[nodiscard]] int bestExposedFrame(const Bracket& bracket);

/// Two frames of different exposure made comparable, pixel by pixel.
///
/// Both images are in the codes (0 to 255) of the frame that was exposed less: those of the other
/// are matched by rank, code with the same share of darker pixels to code, which needs no response
/// curve and hardly any registration [GroNay03]. Both are clamped to the codes that *both* frames
/// tell apart: where one is clipped or black, the other one becomes just as flat, so that no masks
/// are needed and the outline of a clipped window still counts.
struct MatchedPyramids {
    /// Level 0 is the full picture, or one reduced `factor` times when that is very large; each
    /// further one is half as large (means of 2 x 2 pixels).
    std::vector<Image<float>> a;
    std::vector<Image<float>> b;
    int factor = 1;
};

/// Ranks are taken where both frames show the scene, as far as `b_from_a` (pixels, corner
/// convention) tells. Images are `coarsening` times (a power of two) smaller than they could be.
/// Nothing when the frames tell no common codes apart; then `reason` says so.
[[nodiscard]] std::optional<MatchedPyramids> matchPyramids(const BracketFrame& a,
                                                           const BracketFrame& b,
                                                           const glm::dmat3& b_from_a,
                                                           int coarsening,
                                                           std::string& reason);

}  // namespace insitu::detail
