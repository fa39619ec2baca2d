#pragma once

#include "core/image.h"
#include "core/instruction_set.h"

#include <glm/glm.hpp>

#include <array>
#include <cstdint>
#include <span>

namespace insitu::fiv {

/// Irradiance vectors of the hidden light at one sample: x, y and z of all channels; the fourth
/// channel is unused.
struct alignas(16) ShellNode {
    std::array<float, 4> axis[3];
};

/// How samples on concentric spheres are numbered: azimuths run fastest, then polar angles, then
/// shells. A row has its first azimuth again at its end.
struct ShellGrid {
    int azimuths = 0;
    int polars = 0;
    int shells = 0;
    float first = 0.0f;  ///< radii of the first and last shell
    float last = 0.0f;
    float shells_an_octave = 0.0f;

    [[nodiscard]] int row() const { return azimuths + 1; }
    [[nodiscard]] int sphere() const { return row() * polars; }
};

/// Eight samples around a place with their weights: bit 0 of a corner's number is the next azimuth,
/// bit 1 the next polar angle, bit 2 the next shell.
struct ShellCorners {
    std::int32_t node = 0;  ///< the first of them
    std::array<float, 8> weights{};
};
[[nodiscard]] ShellCorners shellCorners(const ShellGrid& grid, glm::vec3 place);

/// N·FIV of many places as ShellField::hiddenIrradiance() says. `nodes` holds one node more than
/// the grid has. All instruction sets give the same bytes.
void lookUpShells(InstructionSet isa,
                  const ShellGrid& grid,
                  std::span<const ShellNode> nodes,
                  glm::vec3 half_extent,
                  std::span<const glm::vec3> places,
                  std::span<const glm::vec3> normals,
                  std::span<Rgb> hidden);

}  // namespace insitu::fiv
