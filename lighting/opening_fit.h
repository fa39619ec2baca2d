#pragma once

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <span>

namespace insitu {

/// Bands of directions through an opening that the probe did not see: above what it saw, below it,
/// and beside it.
inline constexpr std::size_t kOpeningBands = 3;

/// A place on a surface whose radiance was measured.
struct LitCell {
    std::size_t face = 0;      ///< places of one face share a reflectance
    double area = 0.0;         ///< m², its weight
    glm::dvec3 radiance{0.0};  ///< measured
    glm::dvec3 known{0.0};     ///< irradiance from all that the probe saw
    /// Irradiance from the unseen directions of each band, as guessed.
    std::array<glm::dvec3, kOpeningBands> guessed{};
};

/// Factors that the guessed radiance of each band needs, per channel, so that the light on every
/// face explains its measured radiance with one reflectance.
///
/// The probe sees only a part of the sky through a window; the floor by the window sees more of it
/// and is as bright as it is because of that. For each channel, with r_f = log ρ_f of a face,
///   minimise Σ_i w_i (log π L_i − log(K_i + Σ_b s_b G_ib) − r_f(i))² + λ Σ_b (log s_b)²
/// by Gauss–Newton on log s, with robust re-weighting against patterned surfaces and r_f
/// eliminated. Logarithms, because a pattern multiplies: a linear fit of 1/ρ would shrink s.
/// Factors are within [0.1, 20]; 1 where nothing speaks. Faces with fewer than 20 places take no
/// part.
[[nodiscard]] std::array<glm::dvec3, kOpeningBands> fitOpeningBands(std::span<const LitCell> cells);

}  // namespace insitu
