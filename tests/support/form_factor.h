#pragma once

#include <glm/glm.hpp>

#include <cmath>
#include <numbers>
#include <vector>

/// Closed forms of how much of a surface a point sees.
namespace insitu::form_factor {

/// From a point to a parallel rectangle a × b at height h, one corner straight above the point.
/// Source: Howell, "A catalog of radiation heat transfer configuration factors", B-3.
[[nodiscard]] inline double parallelRectangle(double a, double b, double h)
{
    const double x = a / h;
    const double y = b / h;
    const double rx = std::sqrt(1.0 + x * x);
    const double ry = std::sqrt(1.0 + y * y);
    return (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry)) / (2.0 * std::numbers::pi);
}

/// Irradiance at x from a polygon of uniform radiance that lies wholly above x's horizon and shows
/// x its counter-clockwise side: E = L/2 · Σ angle_i (normal of the triangle x, v_i, v_i+1)·n.
/// Source: Lambert, "Photometria" (1760); sign by the outline's sense, so its size is returned.
[[nodiscard]] inline double polygonIrradiance(const std::vector<glm::dvec3>& outline,
                                              glm::dvec3 x,
                                              glm::dvec3 normal,
                                              double radiance)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const glm::dvec3 a = glm::normalize(outline[i] - x);
        const glm::dvec3 b = glm::normalize(outline[(i + 1) % outline.size()] - x);
        const glm::dvec3 across = glm::cross(a, b);
        const double sine = glm::length(across);
        sum += std::atan2(sine, glm::dot(a, b)) * glm::dot(across / sine, normal);
    }
    return std::abs(0.5 * radiance * sum);
}

}  // namespace insitu::form_factor
