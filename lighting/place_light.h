#pragma once

#include "lighting/direction_cells.h"
#include "lighting/light_spots.h"
#include "lighting/room_light.h"

#include <memory>
#include <optional>
#include <vector>

namespace insitu {

/// Centres and solid angles of the cells of the sphere of directions, number 2·pair + side: what
/// sums over directions ask for again and again.
struct CellGeometry {
    explicit CellGeometry(DirectionCells cells_of);

    DirectionCells cells;
    std::vector<glm::vec3> directions;  ///< unit
    std::vector<float> solid_angles;
};

/// The light that arrives at one place of a room along the centre of each cell.
struct PlaceLight {
    /// Where a ray ends: on a face, far away, or there was none.
    struct End {
        static constexpr std::uint32_t kNoFace = 0xffffffff;
        static constexpr std::uint32_t kNotLooked = 0xfffffffe;
        std::uint32_t face = kNotLooked;
        glm::vec2 uv{0.0f};

        /// Of a quantity of the room's surfaces; 0 where there is none.
        [[nodiscard]] Rgb lookUp(const FaceGrid<Rgb>& on_surfaces) const
        {
            return face >= kNotLooked ? Rgb(0.0f)
                                      : on_surfaces.lookUp(face, glm::dvec2(uv), Rgb(0.0f));
        }
    };
    std::shared_ptr<const CellGeometry> geometry;
    std::vector<Rgb> radiance;  ///< of the room as it was, without its light spots
    std::vector<End> ends;
    std::vector<Rgb> change;  ///< what was added since where the rays end
    /// Share of the rays that leave a surface through its back: a place inside furniture or a wall.
    double inside_share = 0.0;

    /// Takes `change` from the change of the surfaces' radiance on the room's cell grid.
    void setChange(const FaceGrid<Rgb>& room_change);
    /// Σ (radiance, change) max(0, n·ω) ΔΩ.
    [[nodiscard]] std::pair<Rgb, Rgb> irradiance(glm::vec3 unit_normal) const;
};

/// Where what arrives comes from.
[[nodiscard]] PlaceLight::End endOf(const RoomLight::Arrival& arrival);

/// Which cells are looked along: those whose centre lies above a horizon and in a cone; and how.
struct LookOptions {
    std::optional<glm::vec3> horizon_normal{};
    glm::vec3 axis{0.0f};  ///< unit, or 0: no cone
    float least_cosine = -1.0f;
    /// Rays along a cell's side, > 0: their mean is its radiance.
    int rays_along = 1;

    [[nodiscard]] bool hold(glm::vec3 direction) const
    {
        return (!horizon_normal || glm::dot(direction, *horizon_normal) > 0.0f) &&
               glm::dot(direction, axis) >= least_cosine;
    }
};

/// Looks along the cells that the options hold; the others stay black. `spots` is left out, since
/// it is too concentrated for cells (light_spots.h).
[[nodiscard]] PlaceLight lookAround(const RoomLight& room,
                                    const LightSpots& spots,
                                    glm::dvec3 place,
                                    std::shared_ptr<const CellGeometry> geometry,
                                    const LookOptions& options = {});

}  // namespace insitu
