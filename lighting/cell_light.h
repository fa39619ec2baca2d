#pragma once

#include "core/environment_map.h"
#include "core/finding.h"
#include "lighting/direction_cells.h"

#include <glm/glm.hpp>

#include <array>
#include <span>
#include <vector>

namespace insitu {

/// Light of some directions as a vector for each colour channel: Σ L(ω) ω ΔΩ. Its dot product with
/// a unit normal is the irradiance that the light gives a surface, as long as all of its directions
/// lie above the surface's horizon. Of all directions, or of those that an object hides, it is the
/// fullsphere irradiance vector (FIV). Source: [Michael10] 3.2, equations 10 and 11.
struct IrradianceVector {
    std::array<glm::vec3, 3> channels{glm::vec3(0.0f), glm::vec3(0.0f), glm::vec3(0.0f)};

    /// N·FIV, a channel each; may be negative.
    [[nodiscard]] Rgb along(glm::vec3 unit_normal) const
    {
        return {glm::dot(channels[0], unit_normal),
                glm::dot(channels[1], unit_normal),
                glm::dot(channels[2], unit_normal)};
    }
    IrradianceVector& operator+=(const IrradianceVector& other)
    {
        for (std::size_t c = 0; c < 3; ++c)
            channels[c] += other.channels[c];
        return *this;
    }
    IrradianceVector& operator-=(const IrradianceVector& other)
    {
        for (std::size_t c = 0; c < 3; ++c)
            channels[c] -= other.channels[c];
        return *this;
    }
    IrradianceVector& operator*=(float factor)
    {
        for (glm::vec3& channel : channels)
            channel *= factor;
        return *this;
    }
    [[nodiscard]] bool operator==(const IrradianceVector&) const = default;
};

/// How an environment's light is shared out among directions.
struct LightSplitOptions {
    /// Most directions of its own that concentrated light (sun, lamps) gets, >= 0; 0: only the
    /// atlas's cells.
    int max_fine_directions = 48;
    /// Light counts as concentrated while its cell's share of all light times its spread around the
    /// cell's direction is above this. Radians, >= 0.
    double spread_tolerance = 5e-5;

    [[nodiscard]] Findings validate() const;
};

/// The light of an environment, in an object's axes, shared out among an atlas's cells and some
/// directions of its own where it is concentrated: the light's cells dominate the error of a
/// shadow.
struct CellLight {
    /// Of the cells of side 0 and of side 1, one a pair.
    std::vector<IrradianceVector> along, against;
    /// Directions of concentrated light (unit, its own centre), and what comes from them; this is
    /// not in the cells any more.
    std::vector<glm::dvec3> fine_directions;
    std::vector<IrradianceVector> fine;
    /// Root mean square angle between light and the direction that stands for it, weighted by
    /// luminance, over the sphere: how far, times the distance, shadow edges are displaced.
    /// Radians.
    double spread_rad = 0.0;

    /// FIV of the whole environment.
    [[nodiscard]] IrradianceVector total() const;
    /// Irradiance of a surface that faces this way, where nothing hides any of it.
    [[nodiscard]] Rgb irradiance(glm::vec3 unit_normal) const;
};

/// `object_from_world` is a rotation. Each texel shines from its own area, cut finer than the
/// cells. Sums run in double over fixed blocks: the same for any number of threads. NaN, infinity
/// or negative radiance is an InputError with the texel; bad options too. A map without pixels is
/// black.
[[nodiscard]] CellLight splitLight(const EnvironmentMap& environment,
                                   const glm::dmat3& object_from_world,
                                   DirectionCells cells,
                                   const LightSplitOptions& options = {});

}  // namespace insitu
