#pragma once

#include "core/image.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <span>

namespace insitu {

/// What a few rays from places on the objects bring, as irradiance.
struct RayLight {
    Rgb all{0.0f};     ///< from the room, as if there were no objects
    Rgb passed{0.0f};  ///< of it past the objects
    Rgb sent{0.0f};    ///< from the objects that they meet

    RayLight& operator+=(const RayLight& other)
    {
        all += other.all;
        passed += other.passed;
        sent += other.sent;
        return *this;
    }
    /// Share of the room's light that is not hidden; 0 where the rays bring none.
    [[nodiscard]] Rgb open() const;
};
[[nodiscard]] inline RayLight operator*(float weight, const RayLight& light)
{
    return {weight * light.all, weight * light.passed, weight * light.sent};
}

/// A pixel that shows an object: what of its radiance waits for its neighbours. Sums over its
/// points are means over the pixel, so that they count for the share that objects cover.
struct ObjectPixel {
    glm::ivec2 pixel{0};
    glm::vec3 normal{0.0f};  ///< of its first point, as are depth and roughness
    float depth_m = 0.0f;
    float roughness = 0.0f;
    std::uint32_t object = 0;
    /// All its points are lit as one place. In creases and at edges they are not, and no neighbour
    /// is like them: these pixels keep to their own rays.
    bool one_place = true;
    Rgb matt{0.0f};       ///< reflectance of the base, over π
    Rgb matt_open{0.0f};  ///< that times the irradiance as if objects hid nothing
    RayLight rays;        ///< mean over its points
    Rgb glossy{0.0f};     ///< reflectance of the lobe, for what it gathers
    Rgb gathered{0.0f};   ///< radiance by a few directions of the lobe
};

/// Adds to a picture what its pixels reflect of the light that a few rays of each, and of its
/// neighbours, tell: neighbours on the same object, at about its depth, with like normals.
///
/// The irradiance as if objects hid nothing has no noise; rays tell the share of it that is hidden,
/// the same rays for both, so that the noise of the light itself cancels [HeiHilMcG18]. Lobes share
/// what they gathered per reflectance, among normals that differ by little of the lobe's width.
void addShared(std::span<const ObjectPixel> pixels, Image<Rgb>& picture);

}  // namespace insitu
