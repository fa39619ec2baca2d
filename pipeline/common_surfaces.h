#pragma once

#include "core/camera.h"
#include "core/environment_map.h"
#include "reconstruct/scene_proxy.h"

#include <glm/glm.hpp>

#include <cstddef>
#include <vector>

namespace insitu {

/// A pixel of a photograph that shows a surface of the room which the light probe sees too.
struct CommonPixel {
    glm::ivec2 pixel{0};
    Rgb seen{0.0f};        ///< the probe's radiance of it, unclipped, not black
    std::size_t face = 0;  ///< of the proxy
};

/// Some 60 000 of them at most, on a regular grid: surfaces of the room, not of solid boxes nor
/// beyond openings.
[[nodiscard]] std::vector<CommonPixel> commonPixels(const Camera& camera,
                                                    const SceneProxy& proxy,
                                                    const EnvironmentMap& probe,
                                                    glm::dvec3 probe_center_m);

}  // namespace insitu
