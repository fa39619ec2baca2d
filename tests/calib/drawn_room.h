#pragma once

#include "core/camera.h"
#include "core/photo.h"
#include "core/random.h"

#include <glm/glm.hpp>

#include <array>
#include <cmath>

namespace insitu::synthetic {

/// A box room with pictures and a door on its walls and tiles on its floor, seen by `camera`:
/// every edge runs along an axis. 4 x 4 samples a pixel, noise of `noise` codes.
///
/// x in [-2.4, 2.1], y in [0, 2.6], z in [-3, 3]
inline EncodedImage drawRoom(const Camera& camera, double noise, std::uint64_t seed)
{
    const glm::dvec3 low(-2.4, 0.0, -3.0);
    const glm::dvec3 high(2.1, 2.6, 3.0);
    const std::array<double, 6> grey = {150, 190, 95, 235, 172, 120};
    const auto shade = [&](glm::dvec3 ray) {
        double nearest = 1e9;
        int face = 0;
        for (int axis = 0; axis < 3; ++axis) {
            if (ray[axis] == 0.0) continue;
            const bool up = ray[axis] > 0.0;
            const double t = ((up ? high : low)[axis] - camera.position_m[axis]) / ray[axis];
            if (t < nearest) {
                nearest = t;
                face = 2 * axis + (up ? 1 : 0);
            }
        }
        const glm::dvec3 p = camera.position_m + ray * nearest;
        const double value = grey[static_cast<std::size_t>(face)];
        if (face == 2) {  // tiles
            const double tile = std::floor(p.x / 0.8) + std::floor(p.z / 0.8);
            return value + (std::fmod(std::abs(tile), 2.0) < 0.5 ? 0.0 : 14.0);
        }
        if (face == 3) return value;
        const double along = face / 2 == 0 ? p.z : p.x;
        const bool frame = p.y > 1.1 && p.y < 1.9 && std::fmod(along + 30.0, 1.5) < 0.7;
        const bool door = p.y < 2.0 && along > 1.2 && along < 1.9;
        return frame ? value - 60.0 : door ? value - 35.0 : value;
    };
    EncodedImage image;
    image.codes = Image<glm::u16vec3>(camera.width, camera.height);
    RandomStream random(seed, 0, 0);
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            double sum = 0.0;
            for (int i = 0; i < 16; ++i)
                sum += shade(camera.rayDirection(
                           {x + 0.125 + 0.25 * (i % 4), y + 0.125 + 0.25 * (i / 4)})) /
                       16.0;
            const double code = std::clamp(sum + noise * random.normal(), 0.0, 255.0);
            image.codes(x, y) = glm::u16vec3(static_cast<std::uint16_t>(code + 0.5));
        }
    return image;
}

}  // namespace insitu::synthetic
