#pragma once

#include "core/image.h"

#include <glm/glm.hpp>

namespace insitu {

/// Distant (or probe-centred) radiance by direction, equirectangular.
///
/// Column: the image's centre looks along world −z, +x is to the right of the centre. Row: +y on
/// the top row, −y at the bottom. u = 0.5 + atan2(x, −z)/2π, v = acos(y)/π, both in [0, 1].
/// Directions are in the world frame.
struct EnvironmentMap {
    Image<Rgb> pixels;
    /// The part of each texel's radiance that comes from what is clipped in every exposure, and is
    /// therefore only a lower bound; 0 to `pixels`, in each channel. Empty: none.
    Image<Rgb> clipped{};
};

[[nodiscard]] glm::dvec2 environmentUvFromDirection(glm::dvec3 unit_direction);
[[nodiscard]] glm::dvec3 environmentDirectionFromUv(glm::dvec2 uv);
/// Solid angle of a texel in row y: 2π/w · (cos θ₀ − cos θ₁).
[[nodiscard]] double environmentTexelSolidAngle(int width, int height, int y);
/// Column and row of the texel that a direction falls into.
[[nodiscard]] glm::ivec2 environmentTexelAt(int width, int height, glm::dvec3 unit_direction);
/// Bilinear look-up, wrapping in azimuth, clamped at the poles.
[[nodiscard]] Rgb lookUp(const EnvironmentMap& environment, glm::dvec3 unit_direction);
/// The same of its clipped part, so that the difference of both is what was measured.
[[nodiscard]] Rgb lookUpClipped(const EnvironmentMap& environment, glm::dvec3 unit_direction);
/// Irradiance of a surface with the given unit normal: Σ L cos ΔΩ over the upper hemisphere.
[[nodiscard]] glm::dvec3 irradiance(const EnvironmentMap& environment, glm::dvec3 unit_normal);

}  // namespace insitu
