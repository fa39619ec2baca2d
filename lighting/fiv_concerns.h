#pragma once

#include "lighting/fiv_kernel.h"

#include <cmath>
#include <cstddef>

/// The first steps of fiv_kernel.cpp and nothing else: which blocks of places a silhouette concerns
/// at all, before any of its texels is looked at.
namespace insitu::fiv {

constexpr int kSize = Block::kSize;

/// What of a silhouette concerns a block.
enum Concern : std::uint32_t {
    kAlong = 1,
    kAgainst = 2,
    kDepth = 4,  ///< depths must be compared
};

/// What a silhouette means for the blocks of a group.
struct Concerns {
    int count = 0;
    std::int32_t list[Group::kBlocks];  ///< blocks that it can hide from some light, in order
    alignas(64) std::uint32_t sides[Group::kBlocks];  ///< sets of Concern
    /// First and last tile that the places of a block may touch, where it is listed.
    alignas(64) std::int32_t left[Group::kBlocks], right[Group::kBlocks];
    alignas(64) std::int32_t top[Group::kBlocks], bottom[Group::kBlocks];
    alignas(64) float nearest[Group::kBlocks], farthest[Group::kBlocks];  ///< depths of its places
};

INSITU_KERNEL float dot(const glm::vec3& axis, float x, float y, float z)
{
    return axis.x * x + axis.y * y + axis.z * z;
}

INSITU_KERNEL float size(const glm::vec3& axis)
{
    return std::sqrt(dot(axis, axis.x, axis.y, axis.z));
}

/// Frame with what all blocks need of it.
struct Look {
    SilhouetteFrame frame;
    float column_size = 0.0f, row_size = 0.0f, depth_size = 0.0f;
    float edge = 0.0f;
    float undecided = 0.0f;  ///< depth codes from a surface within which its side is undecided
    float tiles_a_texel = 0.0f;
};

INSITU_KERNEL Look lookAt(const SilhouetteFrame& frame, int resolution, float bias)
{
    Look look{frame};
    look.column_size = size(look.frame.column_axis);
    look.row_size = size(look.frame.row_axis);
    look.depth_size = size(look.frame.depth_axis);
    look.edge = static_cast<float>(resolution - 1);
    look.tiles_a_texel = 1.0f / static_cast<float>(SilhouetteTiles::texels(resolution));
    look.undecided = (0.5f + std::abs(bias)) * look.frame.texel_depth;
    return look;
}

constexpr float kRounding = 2e-3f;

INSITU_KERNEL std::int32_t tileOf(float texel, const Look& look)
{
    texel = texel < 0.0f ? 0.0f : texel;
    texel = texel > look.edge ? look.edge : texel;
    return static_cast<std::int32_t>(texel * look.tiles_a_texel);
}

/// Blocks that are looked at together.
constexpr int kBatch = 32;
static_assert(Group::kBlocks % kBatch == 0);

/// Sets the sides that matter for a batch of blocks; 0 when none does.
INSITU_KERNEL std::uint32_t findSides(
    const Look& look, const Group& group, std::uint32_t shines, int first, Concerns& found)
{
    const SilhouetteFrame& f = look.frame;
    const float* const xs = group.x + first;
    const float* const ys = group.y + first;
    const float* const zs = group.z + first;
    const float* const radii = group.radius + first;
    std::uint32_t* const found_sides = found.sides + first;
    std::uint32_t any = 0;
    for (int i = 0; i < kBatch; ++i) {
        const float x = xs[i];
        const float y = ys[i];
        const float z = zs[i];
        const float radius = radii[i];
        const float column = dot(f.column_axis, x, y, z) + f.column_offset;
        const float row = dot(f.row_axis, x, y, z) + f.row_offset;
        const float depth = dot(f.depth_axis, x, y, z) + f.depth_offset;
        const float across = radius * look.column_size;
        const float down = radius * look.row_size;
        const float deep = radius * look.depth_size;
        const bool inside = (column + across > 0.0f) & (column - across < look.edge) &
                            (row + down > 0.0f) & (row - down < look.edge);
        const bool before = depth + deep <= kMinDepthCode - look.undecided;
        const bool beyond = depth - deep >= kMaxDepthCode + look.undecided;
        const std::uint32_t sides = (beyond ? 0u : kAlong) | (before ? 0u : kAgainst);
        const std::uint32_t lit = sides & shines & (0u - static_cast<std::uint32_t>(inside));
        found_sides[i] = lit | (sides == (kAlong | kAgainst) ? std::uint32_t{kDepth} : 0u);
        any |= lit;
    }
    return any;
}

/// Where in the silhouette a batch of blocks lies.
INSITU_KERNEL void findTiles(const Look& look, const Group& group, int first, Concerns& found)
{
    const SilhouetteFrame& f = look.frame;
    for (int b = first; b < first + kBatch; ++b) {
        const float x = group.x[b];
        const float y = group.y[b];
        const float z = group.z[b];
        const float radius = group.radius[b];
        const float column = dot(f.column_axis, x, y, z) + f.column_offset;
        const float row = dot(f.row_axis, x, y, z) + f.row_offset;
        const float depth = dot(f.depth_axis, x, y, z) + f.depth_offset;
        const float across = radius * look.column_size;
        const float down = radius * look.row_size;
        const float deep = radius * look.depth_size;
        // A texel more at the end, since places lie between texels; a little more for rounding.
        found.left[b] = tileOf(column - across - kRounding, look);
        found.right[b] = tileOf(column + across + 1.0f + kRounding, look);
        found.top[b] = tileOf(row - down - kRounding, look);
        found.bottom[b] = tileOf(row + down + 1.0f + kRounding, look);
        found.nearest[b] = depth - deep;
        found.farthest[b] = depth + deep;
    }
}

/// Which blocks of the group the silhouette can hide from the light.
INSITU_KERNEL void concerns(const Look& look,
                            const Group& group,
                            std::uint32_t shines,
                            Concerns& found)
{
    int count = 0;
    for (int first = 0; first < group.count; first += kBatch) {
        if (findSides(look, group, shines, first, found) == 0) continue;
        findTiles(look, group, first, found);
        const int last = first + kBatch < group.count ? first + kBatch : group.count;
        for (int b = first; b < last; ++b) {
            found.list[count] = b;
            count += (found.sides[b] & (kAlong | kAgainst)) != 0 ? 1 : 0;
        }
    }
    found.count = count;
}

/// How much of the part of a silhouette that a block may touch is covered.
enum class Cover { Nothing, Part, All };
INSITU_KERNEL Cover coverOf(const SilhouetteTiles& tiles, const Concerns& found, int b)
{
    const auto columns = static_cast<std::uint32_t>((2u << found.right[b]) - (1u << found.left[b]));
    std::uint32_t full = columns;
    std::uint32_t empty = columns;
    for (std::int32_t y = found.top[b]; y <= found.bottom[b]; ++y) {
        full &= tiles.full[static_cast<std::size_t>(y)];
        empty &= tiles.empty[static_cast<std::size_t>(y)];
    }
    if (empty == columns) return Cover::Nothing;
    return full == columns ? Cover::All : Cover::Part;
}

/// The block's sides by the depths of the surfaces that it may lie behind: most blocks are on one
/// side of all of them, and need no depth compared.
INSITU_KERNEL std::uint32_t sidesOf(const Look& look,
                                    const SilhouetteTiles& tiles,
                                    const Concerns& found,
                                    int b)
{
    const std::uint32_t sides = found.sides[b];
    if ((sides & kDepth) == 0) return sides;
    SilhouetteTiles::Depths all;
    for (std::int32_t y = found.top[b] / 2; y <= found.bottom[b] / 2; ++y)
        for (std::int32_t x = found.left[b] / 2; x <= found.right[b] / 2; ++x)
            all.add(tiles.depthsAt(x, y));
    const float nearest = found.nearest[b] - look.undecided;
    const float farthest = found.farthest[b] + look.undecided;
    std::uint32_t left = 0;
    bool decided = true;
    if ((sides & kAlong) != 0 && nearest < all.farMost()) {
        left |= kAlong;
        decided &= farthest <= all.farLeast();
    }
    if ((sides & kAgainst) != 0 && farthest > all.nearLeast()) {
        left |= kAgainst;
        decided &= nearest >= all.nearMost();
    }
    return left | (decided ? 0u : std::uint32_t{kDepth});
}

}  // namespace insitu::fiv
