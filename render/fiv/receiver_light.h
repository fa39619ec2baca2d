#pragma once

#include "render/fiv/fiv_scene.h"

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
/// is exact for every place. With and without come from the same numbers.
class ReceiverLight {
public:
    ReceiverLight(const FivScene& scene, double node_spacing_m);

    /// The smooth light of directions' cells. Nodes are made as they are needed and kept.
    [[nodiscard]] std::vector<ReceiverIrradiance> cells(std::span<const ReceiverPlace> places);
    /// The light of concentrated spots.
    [[nodiscard]] ReceiverIrradiance spots(const ReceiverPlace& place) const;
    /// Whether objects might be in the way of a spot.
    [[nodiscard]] bool mayShade(const ReceiverPlace& place) const;

private:
    struct Node {
        glm::dvec3 position{0.0};
        glm::dvec3 normal{0.0};
        PlaceLight light;
        ReceiverIrradiance open;  ///< without; change: by what the room's surfaces changed
        bool usable = false;
    };
    struct Use {
        std::size_t place = 0;
        std::size_t slot = 0;
    };
    [[nodiscard]] std::size_t nodeAt(const ReceiverPlace& place, int column, int row);
    void look(Node& node) const;
    void evaluate(const Node& node,
                  std::span<const Use> uses,
                  std::span<const ReceiverPlace> places,
                  std::span<ReceiverIrradiance> slots) const;

    const FivScene& scene_;
    double spacing_;
    std::vector<Node> nodes_;
    std::unordered_map<std::uint64_t, std::size_t> index_;
};

}  // namespace insitu
