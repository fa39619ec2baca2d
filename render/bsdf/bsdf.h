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

/// glTF 2.0 metallic-roughness reflection: Lambert plus GGX (Smith height-correlated, visible
/// normals sampling). Directions point away from the surface; normal is on the side of wo.
/// `specular` 0 with metallic 0 is pure Lambert base_color/π. alpha = max(roughness², 1e-4).
[[nodiscard]] Rgb evaluateBsdf(const SurfaceMaterial& m,
                               glm::dvec3 normal,
                               glm::dvec3 wo,
                               glm::dvec3 wi);
[[nodiscard]] double bsdfPdf(const SurfaceMaterial& m,
                             glm::dvec3 normal,
                             glm::dvec3 wo,
                             glm::dvec3 wi);
[[nodiscard]] std::optional<BsdfSample> sampleBsdf(
    const SurfaceMaterial& m, glm::dvec3 normal, glm::dvec3 wo, float selector, glm::vec2 u);

}  // namespace insitu
