#pragma once

#include "bench/fiv_baseline.h"
#include "bench/fiv_stage.h"
#include "core/color.h"

#include <algorithm>
#include <numeric>
#include <vector>

/// The lights of the thesis's configurations.
namespace insitu::fiv_bench {

using baseline::TexelLight;

inline Progress silent;

/// Black but for square patches on the cube's faces.
struct Patch {
    glm::dvec3 direction{0.0};
    double cosine = 0.0;  ///< of its half angle; 1: the one texel
    Rgb radiance{0.0f};
};
inline TexelLight patches(const std::vector<Patch>& lights)
{
    TexelLight light{{32}, {}};
    light.radiance.resize(2 * light.cells.pairCount(), Rgb(0.0f));
    for (const Patch& patch : lights) {
        const DirectedPair cell = light.cells.cellAt(patch.direction);
        light.radiance[2 * cell.pair + static_cast<std::size_t>(cell.side)] = patch.radiance;
        for (std::size_t k = 0; k < light.radiance.size(); ++k)
            if (glm::dot(light.direction(k), glm::normalize(patch.direction)) > patch.cosine)
                light.radiance[k] = patch.radiance;
    }
    return light;
}

/// Light as given by the texels of a cube, as in the thesis. Each is a point at its middle, so the
/// `fine` brightest throw hard shadows of their own.
inline ObjectLight litByTexels(const Stage& stage,
                               const TexelLight& light,
                               std::size_t fine,
                               const FineSilhouetteOptions& silhouettes = {})
{
    CellLight cells = light.asCellLight();
    std::vector<std::size_t> order(light.radiance.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, std::greater{}, [&](std::size_t k) {
        return luminance(light.radiance[k]) * light.cells.solidAngle(k / 2);
    });
    for (const std::size_t k : std::span(order).first(fine)) {
        if (light.radiance[k] == Rgb(0.0f)) break;
        IrradianceVector& v = (k % 2 == 0 ? cells.along : cells.against)[k / 2];
        cells.fine_directions.push_back(light.direction(k));
        cells.fine.push_back(v);
        v = {};
    }
    return lightObject(stage.mesh, stage.atlas, std::move(cells), silhouettes, silent);
}

}  // namespace insitu::fiv_bench
