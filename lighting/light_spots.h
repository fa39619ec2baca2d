#pragma once

#include "lighting/room_light.h"

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>
#include <vector>

namespace insitu {

/// A part of a concentrated light of a room: of the sun, or of a lamp.
struct LightSpot {
    bool far = false;
    glm::dvec3 at{0.0};      ///< unit direction when far, else a place on a surface
    glm::dvec3 normal{0.0};  ///< of that surface
    glm::dvec3 power{0.0};   ///< Σ L ΔΩ when far, else Σ L ΔA
};

/// What of a spot reaches a place.
struct SpotArrival {
    glm::dvec3 direction{0.0};   ///< unit
    double distance_m = 0.0;     ///< infinite when far
    glm::dvec3 irradiance{0.0};  ///< of a surface that faces it
};

struct LightSpotOptions {
    /// A texel is concentrated light when a cell of this solid angle, filled with its radiance...
    double cell_solid_angle = 2e-3;
    /// ...would give more than this share of all light.
    double least_share = 0.03;
    /// Most spots, >= 0; 0: none is told apart.
    int max_spots = 24;
    /// Groups of texels are cut until share of light times root mean square angle is below this,
    /// radians.
    double spread_tolerance = 2e-4;
};

/// The lights of a room that are too bright and too small for cells of the sphere of directions: a
/// sun behind a window, lamps. Each texel of them belongs to a spot; what is left is smooth.
class LightSpots {
public:
    LightSpots() = default;
    /// `reference` is where the objects stand.
    LightSpots(const RoomLight& room, glm::dvec3 reference, const LightSpotOptions& options);

    [[nodiscard]] const std::vector<LightSpot>& spots() const { return spots_; }
    /// True when what arrives is part of a spot: not to be counted among the smooth light.
    [[nodiscard]] bool holds(const RoomLight::Arrival& arrival, glm::dvec3 direction) const;

private:
    const RoomLight* room_ = nullptr;
    std::vector<LightSpot> spots_;
    std::vector<std::uint8_t> far_;      ///< per texel of RoomLight::outside()
    std::vector<std::uint8_t> surface_;  ///< per texel of RoomLight::surfaceRadiance()
};

/// The light of a spot at a place; nothing when the room itself hides it.
[[nodiscard]] std::optional<SpotArrival> reach(const RoomLight& room,
                                               const LightSpot& spot,
                                               glm::dvec3 place);

}  // namespace insitu
