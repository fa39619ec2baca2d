#pragma once

#include "core/instruction_set.h"
#include "lighting/silhouettes.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace insitu::fiv {

/// Places that are summed together: neighbours in space, so that they fall into the same part of a
/// silhouette. Everything is an array a coordinate, for the compiler's vectors.
struct Block {
    static constexpr int kSize = 32;
    using Row = float[kSize];

    alignas(64) Row x, y, z;     ///< local places; unused ones repeat the last
    alignas(64) Row nx, ny, nz;  ///< normals, where they are asked for
    alignas(64) Row sums[13];    ///< what comes out, channel by channel
    float uniform[13];           ///< the same for all places, to be added to the sums
};
struct NormalBounds {
    glm::vec3 low{0.0f}, high{0.0f};
};

/// Blocks that are summed together: their sums stay in the second cache while silhouettes pass by.
struct Group {
    static constexpr int kBlocks = 384;

    /// Makes room for `block_count` of them, at most kBlocks.
    void resize(std::size_t block_count)
    {
        count = static_cast<int>(block_count);
        blocks.resize(filled());
    }
    /// Blocks that must hold places: whole vectors of any instruction set.
    [[nodiscard]] std::size_t filled() const
    {
        return (static_cast<std::size_t>(count) + 31) / 32 * 32;
    }
    int count = 0;
    std::vector<Block> blocks;
    /// Balls around the places of each block; all of them beyond `count` are as the last.
    alignas(64) float x[kBlocks], y[kBlocks], z[kBlocks], radius[kBlocks];
    /// Boxes around the normals of each block and of all, where there are normals.
    NormalBounds normals[kBlocks], all_normals;
};
/// Places of one group when `places` are cut into groups: few enough for every thread to
/// get some. What comes out does not depend on it.
[[nodiscard]] std::size_t placesOfGroup(std::size_t places);

/// What is summed of each direction's hidden light.
enum class Sum {
    Vectors,     ///< its irradiance vector: 9 sums, flux of 9 numbers a direction
    Irradiance,  ///< irradiance of one common normal: 3 sums, flux of 3 numbers a direction
    PerPlace,    ///< max(0, N·vector) with each place's own normal: 3 sums, flux of 9 numbers
    /// Irradiance of one common normal in four lights: 12 sums and one for a sky of radiance 1,
    /// flux of as many numbers.
    Corners,
};
[[nodiscard]] constexpr int fluxNumbers(Sum sum)
{
    switch (sum) {
        case Sum::Irradiance:
            return 3;
        case Sum::Corners:
            return 13;
        case Sum::Vectors:
        case Sum::PerPlace:
            break;
    }
    return 9;
}

/// A set of silhouettes with the light of ω and −ω of each, `fluxNumbers` a direction.
struct Source {
    const SilhouetteSet* set = nullptr;  ///< not needed where occluders are given
    std::vector<float> along, against;
    std::vector<std::uint8_t> shines;  ///< bit 0: along, bit 1: against
};

/// One of several objects before the same light: which of its silhouettes answers for each of the
/// light's directions, and how places are seen in it.
struct Occluder {
    const SilhouetteSet* set = nullptr;
    std::vector<std::uint32_t> silhouettes;
    std::vector<SilhouetteFrame> frames;
    std::vector<std::uint8_t> swapped;  ///< 1: the light's ω is the silhouette's −ω
};

using Isa = InstructionSet;

/// Adds to the blocks' sums what the object hides from their places, direction by direction.
void addHidden(Isa isa, Sum sum, const Source& source, float bias_texels, Group& group);

/// The same for what at least one of several objects hides, exactly where coverage is 0 or 1; parts
/// of a texel count as independent. One group an occluder, with the same places in its own local
/// frame; sums are added to those of the first group.
void addHiddenByAny(Isa isa,
                    Sum sum,
                    const Source& light,
                    std::span<const Occluder> occluders,
                    float bias_texels,
                    std::span<Group> groups);

}  // namespace insitu::fiv
