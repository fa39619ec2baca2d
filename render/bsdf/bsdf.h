#pragma once

#include "core/mesh.h"

#include <glm/glm.hpp>

#include <optional>

namespace insitu {

/// Surface parameters at a point, textures looked up.
struct SurfaceMaterial {
    Rgb base_color{0.8f};
    float metallic = 0.0f;
    float roughness = 1.0f;
    float specular = 1.0f;
    Rgb emissive{0.0f};
};

struct BsdfSample {
    glm::dvec3 direction{0.0};  ///< unit, in the world
    Rgb weight{0.0f};           ///< f·cos / pdf
    double pdf = 0.0;           ///< per solid angle, of the whole BSDF (all lobes)
};

/// glTF 2.0 metallic-roughness reflection: a diffuse lobe plus GGX (Smith height-correlated,
/// visible normals sampling). Directions are unit and point away from the surface; normal is on the
/// side of wo. alpha = max(roughness², 1e-4). Reciprocal; reflects no more than it receives when
/// the parameters are in [0, 1]. What the facets scatter more than once is lost, as in glTF.
///
/// `specular` 0 with metallic 0 is pure Lambert base_color/π, and then alone wo may lie below the
/// horizon of `normal` (as happens with interpolated normals): Lambert does not depend on it.

/// f, per steradian, without the cosine; 0 for wi at or below the horizon.
[[nodiscard]] Rgb evaluateBsdf(const SurfaceMaterial& m,
                               glm::dvec3 normal,
                               glm::dvec3 wo,
                               glm::dvec3 wi);
/// Density with which sampleBsdf() draws wi; its integral over wi is 1 less the share of draws
/// that end below the horizon.
[[nodiscard]] double bsdfPdf(const SurfaceMaterial& m,
                             glm::dvec3 normal,
                             glm::dvec3 wo,
                             glm::dvec3 wi);
/// selector and u in [0, 1). Nothing when the drawn direction is below the horizon or the surface
/// is black: counts as a sample of value 0.
[[nodiscard]] std::optional<BsdfSample> sampleBsdf(
    const SurfaceMaterial& m, glm::dvec3 normal, glm::dvec3 wo, float selector, glm::vec2 u);

/// True when the surface has a lobe that depends on wo, which must then be above the horizon.
[[nodiscard]] inline bool isGlossy(const SurfaceMaterial& m)
{
    return m.specular > 0.0f || m.metallic > 0.0f;
}

}  // namespace insitu
