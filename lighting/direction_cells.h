#pragma once

#include <glm/glm.hpp>

#include <cstddef>

namespace insitu {

/// One direction of a pair: ω itself (side 0) or −ω (side 1).
struct DirectedPair {
    std::size_t pair = 0;
    int side = 0;
    [[nodiscard]] bool operator==(const DirectedPair&) const = default;
};

/// The sphere of directions as the texels of a cube, ω and −ω taken together.
///
/// 6·n² cells, so 3·n² pairs. Pair (axis·n + row)·n + column looks through the texel's centre on
/// the face of the positive axis; its other side is the opposite texel of the opposite face. Column
/// runs along the next axis (x → y → z → x), row along the one after.
struct DirectionCells {
    int face_size = 32;
    glm::dmat3 axes{1.0};  ///< of the cube, as columns; a rotation

    [[nodiscard]] std::size_t pairCount() const
    {
        return 3 * static_cast<std::size_t>(face_size) * static_cast<std::size_t>(face_size);
    }
    /// Unit direction through the centre of the cell of side 0.
    [[nodiscard]] glm::dvec3 direction(std::size_t pair) const;
    /// Unit direction through a point of a cell, `inside` in [0, 1]², along column and row. Cells
    /// of both sides are numbered 2·pair + side.
    [[nodiscard]] glm::dvec3 directionIn(std::size_t cell, glm::dvec2 inside) const;
    /// One of rays_along² directions spread evenly over a cell.
    [[nodiscard]] glm::dvec3 directionOfRay(std::size_t cell, int ray, int rays_along) const
    {
        return directionIn(cell,
                           (glm::dvec2(ray % rays_along, ray / rays_along) + 0.5) /
                               static_cast<double>(rays_along));
    }
    /// Exact solid angle of either cell of the pair; all of them sum to 4π.
    [[nodiscard]] double solidAngle(std::size_t pair) const;
    /// The cell that a direction of any length > 0 falls into.
    [[nodiscard]] DirectedPair cellAt(glm::dvec3 direction) const;
};

}  // namespace insitu
