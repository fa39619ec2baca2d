#pragma once

#include "core/color.h"
#include "core/instruction_set.h"

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <vector>

namespace insitu {

/// Radiance of points all over the objects, for places of the room: the floor under a seat sees
/// others of them than the wall behind.
class ObjectGlow {
public:
    /// A point's surface looks along its normal and stands for an area.
    void add(glm::dvec3 position, glm::dvec3 normal, double area, Rgb radiance);

    /// Mean radiance of the points that face the place and lie above its horizon, each as its form
    /// factor; 0 where there is none. What points hide each other from the place is not looked at.
    [[nodiscard]] Rgb seenFrom(glm::dvec3 place, glm::dvec3 unit_normal) const;
    /// The same by one of the processor's instruction sets, with the same bytes.
    [[nodiscard]] Rgb seenFrom(InstructionSet isa, glm::dvec3 place, glm::dvec3 unit_normal) const;

private:
    static constexpr std::size_t kLanes = 16;
    using Lanes = std::array<float, kLanes>;
    /// As many points as are worked on at a time; unused ones have no area.
    struct Bundle {
        Lanes x{}, y{}, z{}, normal_x{}, normal_y{}, normal_z{}, area{}, red{}, green{}, blue{};
    };
    struct Sums;
    void sum(glm::vec3 x, glm::vec3 n, Sums& sums) const;
    void sumAvx2(glm::vec3 x, glm::vec3 n, Sums& sums) const;
    void sumAvx512(glm::vec3 x, glm::vec3 n, Sums& sums) const;

    std::vector<Bundle> bundles_;
    std::size_t count_ = 0;
};

}  // namespace insitu
