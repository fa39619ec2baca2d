#pragma once

#include "capture/light_probe.h"
#include "core/image.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <filesystem>
#include <vector>

namespace insitu {

/// A mask says what not to use: non-zero where it holds.
using ProbeMask = Image<std::uint8_t>;

/// A mask of a picture: pixels whose centre lies inside one of the polygons (corners in pixels,
/// at least three each, even-odd rule). InputError: fewer corners, or one that is not finite.
[[nodiscard]] ProbeMask maskFromPolygons(int width,
                                         int height,
                                         const std::vector<std::vector<glm::dvec2>>& polygons_px);

/// The mask that a picture shows: what is not black in it (a channel above half of full scale).
/// InputError: unreadable, or not of the given size, that of the pictures it masks.
[[nodiscard]] ProbeMask readProbeMask(const std::filesystem::path& path, int width, int height);

/// Directions within `radius_rad` of `direction` (any length but 0).
struct SphereCap {
    glm::dvec3 direction{0.0};
    double radius_rad = 0.0;  ///< [0, pi]
};
/// A mask of an equirectangular map: texels whose middle lies in one of the caps. InputError: a cap
/// without direction, a radius out of range.
[[nodiscard]] ProbeMask maskFromCaps(int map_width, const std::vector<SphereCap>& caps);

/// Replaces the masked texels by the smoothest continuation of what surrounds them: the solution of
/// Laplace's equation on the sphere, so that nothing gets brighter or darker than the hole's rim,
/// whatever its shape, across the seam and over the poles alike. Finding "probe-inpainted": share
/// of the sphere.
///
/// Discretised by finite volumes: texels exchange (edge length / distance of middles) times their
/// difference, sin(theta) dphi / dtheta to the row below and dtheta / (sin(theta) dphi) along it.
/// InputError: a mask of another size; NoAnswerError: nothing is left outside it.
void inpaintProbe(LightProbe& probe, const ProbeMask& mask);

}  // namespace insitu
