#pragma once

#include "core/environment_map.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// Irradiance that was measured somewhere, to tell how strong the lights are that are clipped in
/// every exposure of the probe.
struct LightReference {
    glm::dvec3 position_m{0.0};  ///< not used where all light is taken to be far
    glm::dvec3 normal{0.0, 1.0, 0.0};
    /// Per channel, > 0, in the light's unit; with `scale_free` of its group up to a factor.
    glm::dvec3 irradiance{0.0};
    /// Standard deviation of its logarithm, apart from what the whole group has in common. > 0.
    double log_sigma = 0.03;
};

/// Measurements with an error in common: all places of one grey ball, all readings of one meter.
struct ReferenceGroup {
    std::string name;  ///< for messages: "the grey card"
    std::vector<LightReference> places;
    /// Standard deviation of the logarithm of a factor on all of them (reflectance), >= 0.
    double common_log_sigma = 0.0;
    /// That factor is not known at all (a meter's lux in the camera's unit, a ball of unknown
    /// reflectance): only ratios count, and it takes at least two places.
    bool scale_free = false;
    /// The channels are all the same luminance: tells how strong, not what colour.
    bool luminance_only = false;
};

/// Irradiance at a place of a reference, as the probe knows it.
struct PredictedIrradiance {
    glm::dvec3 measured{0.0};  ///< from all that is not clipped
    glm::dvec3 clipped{0.0};   ///< from what is, as a lower bound
};

/// What is known of a clipped light's strength before: from the surfaces that it lights.
struct ClippedPrior {
    glm::dvec3 factor{1.0};
    /// Standard deviation of the logarithm; nothing: no idea.
    std::optional<glm::dvec3> log_sigma;
};

/// What clipped lights need to be multiplied by, per channel, and how well that is known.
struct ClippedSolution {
    glm::dvec3 factor{1.0};
    glm::dvec3 log_sigma{0.0};
    /// Channels in which something is clipped and no reference tells: their factor stays 1.
    glm::bvec3 open{false};
    /// Root mean square of what the references say beyond the solution, in their own standard
    /// deviations (1 expected; more: they contradict each other, the prior or the probe).
    double residual = 0.0;
    /// The references see less light than the probe measured without the clipped part, by this
    /// logarithm, beyond three standard deviations: the largest such; 0: none.
    double excess = 0.0;
};

/// Solves for the strength s of what is clipped, each channel by itself. With measured irradiance
/// E_i, the probe's K_i (measured) and G_i (clipped), groups g with common factor k_g,
///   minimise Σ_i (log E_i − log(K_i + s G_i) − k_g)² / σ_i² + Σ_g k_g² / σ_g² + (log s − log s0)²
///   / σ0²
/// over log s in [0, log 1e6]: found on a grid, then by golden section; the k_g are eliminated. The
/// standard deviation is that of Gauss–Newton at the minimum. s is at least 1: what is clipped is
/// not weaker than it looks. When all groups are luminance_only, one factor serves all channels,
/// which keep the ratios of `prior.factor`.
///
/// Nothing when the references tell in no channel (log_sigma would exceed 0.5), as they get too
/// little light from what is clipped. `predicted` is place by place, group by group (precondition).
[[nodiscard]] std::optional<ClippedSolution> solveClipped(
    std::span<const ReferenceGroup> groups,
    std::span<const PredictedIrradiance> predicted,
    const ClippedPrior& prior = {});

/// The places of all groups against an environment at infinity: irradiance() of each normal.
[[nodiscard]] std::vector<PredictedIrradiance> predictIrradiance(
    std::span<const ReferenceGroup> groups, const EnvironmentMap& environment);

/// Multiplies the clipped part, of an environment and in it.
void scaleClipped(EnvironmentMap& environment, glm::dvec3 factor);

/// What references said, for findings and reports: irradiance in luminance, of the place that gets
/// the most from what is clipped.
struct ReferenceEffect {
    double before = 0.0;  ///< the bound: measured and clipped part as they look
    double after = 0.0;
    double sigma = 0.0;  ///< of `after`, relative
};
[[nodiscard]] ReferenceEffect referenceEffect(std::span<const PredictedIrradiance> predicted,
                                              const ClippedSolution& solution);

/// Findings of a solution: "light-clipped-solved" with bound, result and deviation, and
/// "light-reference-disagrees" when residual or excess say so.
[[nodiscard]] Findings referenceFindings(std::span<const ReferenceGroup> groups,
                                         std::span<const PredictedIrradiance> predicted,
                                         const ClippedSolution& solution);

/// Where nothing is clipped references only check the probe: "light-reference-unneeded", or
/// "light-reference-disagrees" by more than three times the stated deviation.
[[nodiscard]] Findings checkReferences(std::span<const ReferenceGroup> groups,
                                       std::span<const PredictedIrradiance> predicted);

/// For an environment without a room: predicts, solves, scales. Findings as above;
/// "light-clipped-unsolved" with the bound when something is clipped and no reference tells;
/// "light-reference-unneeded" when nothing is clipped: how far they agree with the probe.
[[nodiscard]] Findings applyReferences(std::span<const ReferenceGroup> groups,
                                       EnvironmentMap& environment);

}  // namespace insitu
