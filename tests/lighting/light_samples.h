#pragma once

#include "core/random.h"
#include "lighting/hidden_light.h"

#include <algorithm>
#include <vector>

/// Lights and places that the tests of hidden light share.
namespace insitu {

inline Progress silent;

inline EnvironmentMap constant(float radiance)
{
    return {Image<Rgb>(64, 32, Rgb(radiance))};
}

/// Dim sky with a lamp and, opposite, a red window.
inline EnvironmentMap lamps()
{
    EnvironmentMap map{Image<Rgb>(128, 64, Rgb(0.2f, 0.25f, 0.3f))};
    for (int y = 10; y < 13; ++y)
        for (int x = 30; x < 34; ++x)
            map.pixels(x, y) = Rgb(40.0f);
    for (int y = 16; y < 28; ++y)
        for (int x = 90; x < 104; ++x)
            map.pixels(x, y) = Rgb(4.0f, 1.0f, 0.5f);
    return map;
}

/// Dim sky with a wide window.
inline EnvironmentMap skyWithWindow()
{
    EnvironmentMap map{Image<Rgb>(128, 64, Rgb(0.2f, 0.25f, 0.3f))};
    for (int y = 12; y < 26; ++y)
        for (int x = 20; x < 44; ++x)
            map.pixels(x, y) = Rgb(5.0f, 4.0f, 2.0f);
    return map;
}

inline ObjectLight lit(const TriangleMesh& mesh,
                       const VisibilityAtlas& atlas,
                       const EnvironmentMap& map,
                       const LightSplitOptions& options = {},
                       const glm::dmat3& object_from_world = glm::dmat3(1.0))
{
    return lightObject(
        mesh, atlas, splitLight(map, object_from_world, atlas.cells(), options), {}, silent);
}

inline std::vector<glm::vec3> placesAround(double radii, std::size_t count)
{
    std::vector<glm::vec3> places(count);
    for (std::size_t i = 0; i < count; ++i) {
        RandomStream random(5, 0, i);
        const glm::dvec3 d(random.normal(), random.normal(), random.normal());
        places[i] = glm::vec3(glm::normalize(d) * radii);
    }
    return places;
}

inline std::vector<IrradianceVector> hiddenAt(const ObjectLight& object,
                                              const std::vector<glm::vec3>& places)
{
    std::vector<IrradianceVector> hidden(places.size());
    hiddenVectors(object, places, hidden);
    return hidden;
}

/// Largest component of all channels.
inline double sizeOf(const IrradianceVector& v)
{
    double most = 0.0;
    for (const glm::vec3& channel : v.channels)
        for (int axis = 0; axis < 3; ++axis)
            most = std::max<double>(most, std::abs(channel[axis]));
    return most;
}

inline double distance(IrradianceVector a, const IrradianceVector& b)
{
    return sizeOf(a -= b);
}

}  // namespace insitu
