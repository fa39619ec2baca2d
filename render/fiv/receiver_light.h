#pragma once

#include "render/fiv/fiv_scene.h"

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

namespace insitu {

/// A point of the room's surfaces.
struct ReceiverPlace {
    glm::dvec3 point{0.0};
    glm::dvec3 normal{0.0};  ///< unit, on the side that is seen
    std::size_t face = 0;
    glm::dvec2 uv{0.0};
};

/// Irradiance without the objects, and by how much they change it.
struct ReceiverIrradiance {
    Rgb without{0.0f};
    Rgb change{0.0f};

    ReceiverIrradiance& operator+=(const ReceiverIrradiance& other)
    {
        without += other.without;
        change += other.change;
        return *this;
    }
};

/// What the room's surfaces receive.
///
/// The light is looked at from a grid of nodes on each surface, a few in a metre, and is linear in
/// between: so a lamp two metres away is in the right direction everywhere. What the objects hide
/// is exact for every place. Nodes that are far from the objects look finely only to where these
/// are.
class ReceiverLight {
public:
    ReceiverLight(const FivScene& scene, double node_spacing_m);

    /// To be called when the scene's room_change has changed.
    void update();
    /// The smooth light of directions' cells. Nodes are made as they are needed and kept.
    [[nodiscard]] std::vector<ReceiverIrradiance> cells(std::span<const ReceiverPlace> places);
    /// What the objects change of it directly, not by way of the room's surfaces.
    [[nodiscard]] std::vector<Rgb> directChange(std::span<const ReceiverPlace> places);
    /// The light of concentrated spots.
    [[nodiscard]] ReceiverIrradiance spots(const ReceiverPlace& place) const;
    /// Whether objects might be in the way of a spot.
    [[nodiscard]] bool mayShade(const ReceiverPlace& place) const;

private:
    /// A look at a cell of the scene's atlas that the objects may hide from the squares around.
    struct Look {
        std::uint32_t cell = 0;  ///< number 2·pair + side
        float weight = 0.0f;     ///< cosine times solid angle
        float beyond = 0.0f;     ///< share of the cell where the room ends beyond the objects
        Rgb radiance{0.0f};      ///< that comes from there, mean over the cell
        PlaceLight::End end;
        Rgb loss{0.0f};  ///< irradiance that is lost when an object hides it
    };
    struct Node {
        glm::dvec3 position{0.0};
        glm::dvec3 normal{0.0};
        double reach_m = 0.0;  ///< of the squares around
        int rays_along = 0;    ///< with which `looks` were made; 0: not yet
        std::vector<Look> looks;
        PlaceLight around;        ///< coarser, all above the horizon; looked at when needed
        ReceiverIrradiance open;  ///< without; change: by what the room's surfaces changed
    };
    /// Places between the same four nodes.
    struct Square {
        std::array<std::size_t, 4> nodes{};
        std::vector<std::size_t> places;
        std::vector<std::array<float, 4>> weights;
    };
    [[nodiscard]] std::vector<Square> squaresOf(std::span<const ReceiverPlace> places);
    [[nodiscard]] std::size_t nodeAt(const ReceiverPlace& place, int column, int row);
    /// Makes the squares' nodes look towards the objects, and around when the open light matters.
    void look(std::span<const Square> squares, std::span<const ReceiverPlace> places, bool around);
    void settle(Node& node, const ReceiverPlace& seen) const;
    void lookTowardObjects(Node& node, int rays_along) const;
    void lookAroundFrom(Node& node) const;
    void update(Node& node) const;
    /// Irradiance that objects hide from the square's places, in their order.
    [[nodiscard]] std::vector<Rgb> hidden(const Square& square,
                                          std::span<const ReceiverPlace> places) const;

    const FivScene& scene_;
    double spacing_;
    std::shared_ptr<const CellGeometry> few_cells_;
    std::vector<Node> nodes_;
    std::unordered_map<std::uint64_t, std::size_t> index_;
};

/// What the objects change of the room's own radiance: ρ/π times the change of irradiance that they
/// cause directly, on the room's cell grid.
[[nodiscard]] FaceGrid<Rgb> roomChange(const FivScene& scene, ReceiverLight& light);

}  // namespace insitu
