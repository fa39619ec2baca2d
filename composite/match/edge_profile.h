#pragma once

#include "core/finding.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <vector>

namespace insitu {

/// A straight piece of an edge in a photograph, as each channel shows it:
///     value(p) = dark + step · Φ((normal·(p − at) − offset) / spread),
/// Φ the normal distribution, so that `spread` is the standard deviation of the line spread
/// function across the edge, the pixel's own box (1/12) included. Pixels throughout.
struct EdgeProfile {
    glm::dvec2 at{0.0};      ///< centre of the window that was fitted
    glm::dvec2 normal{0.0};  ///< unit, towards the brighter side
    glm::dvec3 offset{0.0};
    glm::dvec3 spread{0.0};
    glm::dvec3 offset_sigma{0.0};  ///< one standard deviation, from the fit's residuals
    glm::dvec3 spread_sigma{0.0};
};

/// The clearest straight, isolated edges of a linear picture, at most `max_count`, spread over it.
/// Only windows of 15×15 pixels are used, all of whose pixels are `usable`; spreads above 3 pixels
/// do not fit into them. Source: the slanted edge of [ISO12233], by fit instead of by bins.
[[nodiscard]] std::vector<EdgeProfile> edgeProfiles(const Image<Rgb>& radiance,
                                                    const Image<std::uint8_t>& usable,
                                                    int max_count = 800);

/// How sharp the photograph's sharpest ordinary edges are.
struct BlurEstimate {
    /// Standard deviation of the camera's blur, pixels, pixel's box taken off; 0 when unknown.
    double sigma_px = 0.0;
    double sigma_of_sigma_px = 0.0;
    int edges = 0;
    Findings findings;  ///< "blur-unknown": fewer than 20 clear edges
};
/// Edges of shadows and of things out of focus are softer than the camera; the estimate is where
/// the sharper half of the edges crowds.
[[nodiscard]] BlurEstimate estimateBlur(const std::vector<EdgeProfile>& edges);

/// Lateral chromatic aberration: red and blue are magnified about the centre by 1 + k against
/// green.
struct ChromaticAberration {
    glm::dvec3 magnification{0.0};        ///< k by channel; green is 0
    glm::dvec3 magnification_sigma{0.0};  ///< one standard deviation
    bool significant = false;  ///< either is over 3 deviations and moves the corners 0.05 px
};
/// From where the channels show the same edges; all 0 with fewer than 20 edges.
[[nodiscard]] ChromaticAberration estimateChromaticAberration(const std::vector<EdgeProfile>& edges,
                                                              glm::dvec2 centre_px);

}  // namespace insitu
