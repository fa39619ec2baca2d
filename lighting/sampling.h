#pragma once

#include <glm/glm.hpp>

#include <cmath>
#include <cstddef>
#include <numbers>

namespace insitu {

/// Warps of the unit square, for Monte Carlo. u in [0, 1)².

/// Point `number` of the R2 sequence in [0, 1)²: each beginning of it is spread evenly. Begun at
/// `begin` instead of the middle it is another one. [Roberts18].
[[nodiscard]] inline glm::dvec2 r2Point(double number, glm::dvec2 begin = glm::dvec2(0.5))
{
    return glm::fract(begin + number * glm::dvec2(0.7548776662466927, 0.5698402909980532));
}

/// Cosine-weighted direction about +z; density cos/π. [Veach97] 2.
[[nodiscard]] inline glm::dvec3 cosineHemisphere(glm::vec2 u)
{
    const double radius = std::sqrt(static_cast<double>(u.x));
    const double angle = 2.0 * std::numbers::pi * u.y;
    return {radius * std::cos(angle),
            radius * std::sin(angle),
            std::sqrt(std::max(0.0, 1.0 - static_cast<double>(u.x)))};
}

/// Uniform direction in the cone about +z with the given cosine of its half angle; density
/// 1 / (2π (1 − cos)).
[[nodiscard]] inline glm::dvec3 uniformCone(glm::vec2 u, double cos_half_angle)
{
    const double z = 1.0 - u.x * (1.0 - cos_half_angle);
    const double radius = std::sqrt(std::max(0.0, 1.0 - z * z));
    const double angle = 2.0 * std::numbers::pi * u.y;
    return {radius * std::cos(angle), radius * std::sin(angle), z};
}

/// Weights (b, c) of the second and third corner; uniform over the triangle's area.
[[nodiscard]] inline glm::dvec2 uniformTriangle(glm::vec2 u)
{
    const double root = std::sqrt(static_cast<double>(u.x));
    return {root * (1.0 - u.y), root * u.y};
}

/// Uniform direction (by solid angle) within an equirectangular texel.
[[nodiscard]] inline glm::dvec3 directionInTexel(int width,
                                                 int height,
                                                 std::size_t texel,
                                                 glm::vec2 u)
{
    using std::numbers::pi;
    const double column = static_cast<double>(texel % static_cast<std::size_t>(width));
    const double row = static_cast<double>(texel / static_cast<std::size_t>(width));
    const double azimuth = ((column + u.x) / width - 0.5) * 2.0 * pi;
    const double top = std::cos(pi * row / height);
    const double bottom = std::cos(pi * (row + 1.0) / height);
    const double y = top + u.y * (bottom - top);
    const double s = std::sqrt(std::max(0.0, 1.0 - y * y));
    return {s * std::sin(azimuth), y, -s * std::cos(azimuth)};
}

/// Columns: two tangents and the normal, right-handed, continuous but at one pole.
/// Source: [Duff17], "Building an orthonormal basis, revisited".
[[nodiscard]] inline glm::dmat3 frameFromNormal(glm::dvec3 n)
{
    const double sign = std::copysign(1.0, n.z);
    const double a = -1.0 / (sign + n.z);
    const double b = n.x * n.y * a;
    return {glm::dvec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            glm::dvec3(b, sign + n.y * n.y * a, -n.y),
            n};
}

}  // namespace insitu
