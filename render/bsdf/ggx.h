#pragma once

#include <glm/glm.hpp>

namespace insitu::ggx {

/// The GGX (Trowbridge–Reitz) facet distribution, isotropic, in the frame where the surface normal
/// is +z. alpha > 0; directions are unit and above the horizon unless said otherwise.
/// Source: [Walter07] for D and G1, [Heitz14] for the height-correlated masking and shadowing.

/// D(h), per steradian; the integral of D cos over the hemisphere is 1.
[[nodiscard]] double distribution(glm::dvec3 h, double alpha);
/// Share of the facets of a direction that are seen from it.
[[nodiscard]] double masking(glm::dvec3 w, double alpha);
/// G2(wo, wi) / (4 cos_o cos_i).
[[nodiscard]] double visibility(glm::dvec3 wo, glm::dvec3 wi, double alpha);
/// A facet normal drawn from those seen from wo, density masking·D·(wo·h)/cos_o; u in [0, 1)².
/// Source: [Heitz18], "Sampling the GGX distribution of visible normals", listing 1.
[[nodiscard]] glm::dvec3 drawVisibleNormal(glm::dvec3 wo, double alpha, glm::dvec2 u);

}  // namespace insitu::ggx
