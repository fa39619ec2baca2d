#pragma once

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <span>

namespace insitu {

/// Kinds of light whose strength the probe could not measure. Directions through an opening that
/// it did not see, above what it saw, below it, and beside it; and lights that are clipped even in
/// the shortest exposure.
enum LightBand : std::size_t { kAboveBand, kBelowBand, kBesideBand, kClippedBand };
inline constexpr std::size_t kLightBands = 4;

/// A place on a surface whose radiance was measured.
struct LitCell {
    std::size_t face = 0;      ///< places of one face share a reflectance
    double area = 0.0;         ///< m², its weight
    glm::dvec3 radiance{0.0};  ///< measured
    glm::dvec3 known{0.0};     ///< irradiance from all that the probe measured
    /// Irradiance from each band, as guessed.
    std::array<glm::dvec3, kLightBands> guessed{};
};

/// Factors on the guesses, per channel, and how well the surfaces tell them.
struct LightFit {
    std::array<glm::dvec3, kLightBands> factors{};
    /// Standard deviation of the logarithm of each factor; large where nothing speaks.
    std::array<glm::dvec3, kLightBands> log_sigma{};
};

/// Factors that the guessed radiance of each band needs, per channel, so that the light on every
/// face explains its measured radiance with one reflectance.
///
/// The probe sees only a part of the sky through a window; the floor by the window sees more of it
/// and is as bright as it is because of that. And a patch of sun is as much brighter than the floor
/// beside it as the sun is stronger than all other light, however clipped its picture. For each
/// channel, with r_f = log ρ_f of a face,
///   minimise Σ_i w_i φ(log π L_i − log(K_i + Σ_b s_b G_ib) − r_f(i)) + Σ_b λ_b (log s_b)²
/// by Gauss–Newton on log s, with φ Cauchy's robust loss against patterned surfaces and r_f
/// eliminated. Logarithms, because a pattern multiplies: a linear fit of 1/ρ would shrink s. A
/// clipped light may be a thousand times its guess, where the loss has other minima: the fit starts
/// from several strengths and keeps the best.
///
/// Factors of openings are within [0.1, 20], of clipped lights within [1, 1e6]; 1 where nothing
/// speaks. Faces with fewer than 20 places take no part.
[[nodiscard]] LightFit fitLightBands(std::span<const LitCell> cells);

}  // namespace insitu
