#pragma once

#include "lighting/fiv_kernel.h"

#include <bit>
#include <cmath>
#include <cstring>

/// The steps of fiv_kernel.cpp and nothing else: from a block's places to the shares that a
/// silhouette hides.
namespace insitu::fiv {

static_assert(std::endian::native == std::endian::little, "depths are read as pairs of 16 bits");

constexpr int kSize = Block::kSize;

/// Places of a block in a silhouette.
struct Projected {
    alignas(64) float column[kSize], row[kSize];  ///< parts of a texel
    alignas(64) float depth[kSize];
    alignas(64) std::int32_t texel[kSize];
    alignas(64) std::uint32_t upper[kSize], lower[kSize];  ///< coverage of two texels each
    alignas(64) std::uint32_t spans[4][kSize];
    alignas(64) float along[kSize], against[kSize];
};

/// What a silhouette means for the blocks of a group.
struct Concerns {
    alignas(64) std::uint32_t sides[Group::kBlocks];  ///< sets of Concern
    /// First and last tile that the places of a block may touch.
    alignas(64) std::int32_t left[Group::kBlocks], right[Group::kBlocks];
    alignas(64) std::int32_t top[Group::kBlocks], bottom[Group::kBlocks];
};

/// What of a silhouette concerns a block.
enum Concern : std::uint32_t {
    kAlong = 1,
    kAgainst = 2,
    kDepth = 4,  ///< depths must be compared
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
    float blur = 0.0f;  ///< depth codes over which a surface's side is undecided
    float undecided = 0.0f;
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

/// Which blocks of the group the silhouette can hide from the light, each a set of Concern.
INSITU_KERNEL void concerns(const Look& look,
                            const Group& group,
                            std::uint32_t shines,
                            Concerns& found)
{
    const SilhouetteFrame& f = look.frame;
    const int blocks = static_cast<int>(group.filled());
    for (int b = 0; b < blocks; ++b) {
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
        const bool inside = (column + across > 0.0f) & (column - across < look.edge) &
                            (row + down > 0.0f) & (row - down < look.edge);
        const bool before = depth + deep <= kMinDepthCode - look.undecided;
        const bool beyond = depth - deep >= kMaxDepthCode + look.undecided;
        const std::uint32_t sides = (beyond ? 0u : kAlong) | (before ? 0u : kAgainst);
        const std::uint32_t lit = inside ? sides & shines : 0u;
        // A texel more at the end, since places lie between texels; a little more for rounding.
        found.left[b] = tileOf(column - across - kRounding, look);
        found.right[b] = tileOf(column + across + 1.0f + kRounding, look);
        found.top[b] = tileOf(row - down - kRounding, look);
        found.bottom[b] = tileOf(row + down + 1.0f + kRounding, look);
        found.sides[b] = lit | (sides == (kAlong | kAgainst) ? std::uint32_t{kDepth} : 0u);
    }
}

INSITU_KERNEL void project(const Look& look, const Block& block, int resolution, Projected& p)
{
    const SilhouetteFrame& f = look.frame;
    const std::int32_t last = resolution - 2;
    for (int i = 0; i < kSize; ++i) {
        float column = dot(f.column_axis, block.x[i], block.y[i], block.z[i]) + f.column_offset;
        float row = dot(f.row_axis, block.x[i], block.y[i], block.z[i]) + f.row_offset;
        column = column < 0.0f ? 0.0f : column;
        column = column > look.edge ? look.edge : column;
        row = row < 0.0f ? 0.0f : row;
        row = row > look.edge ? look.edge : row;
        std::int32_t c = static_cast<std::int32_t>(column);
        std::int32_t r = static_cast<std::int32_t>(row);
        c = c < last ? c : last;
        r = r < last ? r : last;
        p.column[i] = column - static_cast<float>(c);
        p.row[i] = row - static_cast<float>(r);
        p.texel[i] = r * resolution + c;
    }
}

/// A number from anywhere in memory. One at a time: compilers would put such loads together into
/// vectors by a long row of inserts, which is slower than storing them.
template <class Number>
INSITU_KERNEL std::uint32_t loaded(const void* from)
{
    Number number;
    std::memcpy(&number, from, sizeof(number));
    std::uint32_t value = number;
    __asm__("" : "+r"(value));
    return value;
}

/// False when nothing covers any of the texels around the places.
INSITU_KERNEL bool loadCoverage(const std::uint8_t* coverage, int resolution, Projected& p)
{
    std::uint32_t any = 0;
    for (int i = 0; i < kSize; ++i) {
        const std::uint32_t upper = loaded<std::uint16_t>(coverage + p.texel[i]);
        const std::uint32_t lower = loaded<std::uint16_t>(coverage + p.texel[i] + resolution);
        p.upper[i] = upper;
        p.lower[i] = lower;
        any |= upper | lower;
    }
    return any != 0;
}

INSITU_KERNEL void shareOfCoverage(Projected& p, float* share)
{
    for (int i = 0; i < kSize; ++i) {
        const auto a = static_cast<float>(static_cast<std::int32_t>(p.upper[i] & 255u));
        const auto b = static_cast<float>(static_cast<std::int32_t>(p.upper[i] >> 8));
        const auto c = static_cast<float>(static_cast<std::int32_t>(p.lower[i] & 255u));
        const auto d = static_cast<float>(static_cast<std::int32_t>(p.lower[i] >> 8));
        const float upper = a + p.column[i] * (b - a);
        const float lower = c + p.column[i] * (d - c);
        share[i] = (upper + p.row[i] * (lower - upper)) * (1.0f / 255.0f);
    }
}

INSITU_KERNEL void loadDepths(
    const Look& look, const Block& block, const DepthSpan* depths, int resolution, Projected& p)
{
    const SilhouetteFrame& f = look.frame;
    for (int i = 0; i < kSize; ++i)
        p.depth[i] = dot(f.depth_axis, block.x[i], block.y[i], block.z[i]) + f.depth_offset;
    for (int i = 0; i < kSize; ++i) {
        const DepthSpan* const upper = depths + p.texel[i];
        const DepthSpan* const lower = upper + resolution;
        p.spans[0][i] = loaded<std::uint32_t>(upper);
        p.spans[1][i] = loaded<std::uint32_t>(upper + 1);
        p.spans[2][i] = loaded<std::uint32_t>(lower);
        p.spans[3][i] = loaded<std::uint32_t>(lower + 1);
    }
}

INSITU_KERNEL float clampToUnit(float value)
{
    value = value < 0.0f ? 0.0f : value;
    return value > 1.0f ? 1.0f : value;
}

/// Shares of both directions, each texel by its own depth; see hiddenShares().
INSITU_KERNEL void sharesByDepth(const Look& look, float bias, Projected& p)
{
    const float sharpness = 1.0f / look.frame.texel_depth;
    const float middle = 0.5f - bias;
    for (int i = 0; i < kSize; ++i) {
        const float tx = p.column[i];
        const float ty = p.row[i];
        const float depth = p.depth[i];
        const float weights[4] = {
            (1.0f - tx) * (1.0f - ty), tx * (1.0f - ty), (1.0f - tx) * ty, tx * ty};
        const std::uint32_t covers[4] = {
            p.upper[i] & 255u, p.upper[i] >> 8, p.lower[i] & 255u, p.lower[i] >> 8};
        float along = 0.0f;
        float against = 0.0f;
        for (int k = 0; k < 4; ++k) {
            const auto near =
                static_cast<float>(static_cast<std::int32_t>(p.spans[k][i] & 0xffffu));
            const auto far = static_cast<float>(static_cast<std::int32_t>(p.spans[k][i] >> 16));
            const float weight =
                weights[k] * static_cast<float>(static_cast<std::int32_t>(covers[k]));
            along += weight * clampToUnit(middle + (far - depth) * sharpness);
            against += weight * clampToUnit(middle + (depth - near) * sharpness);
        }
        p.along[i] = along * (1.0f / 255.0f);
        p.against[i] = against * (1.0f / 255.0f);
    }
}

template <Sum kSum>
INSITU_KERNEL void accumulate(const float* share, const float* flux, Block& block)
{
    if constexpr (kSum == Sum::PerPlace) {
        for (int c = 0; c < 3; ++c) {
            const float* const vector = flux + 3 * c;
            for (int i = 0; i < kSize; ++i) {
                const float cosine =
                    vector[0] * block.nx[i] + vector[1] * block.ny[i] + vector[2] * block.nz[i];
                block.sums[c][i] += share[i] * (cosine > 0.0f ? cosine : 0.0f);
            }
        }
    } else if constexpr (kSum == Sum::Radiance) {
        for (int i = 0; i < kSize; ++i) {
            const float cosine =
                flux[0] * block.nx[i] + flux[1] * block.ny[i] + flux[2] * block.nz[i];
            const float weight = share[i] * (cosine > 0.0f ? cosine : 0.0f);
            block.sums[0][i] += weight * flux[3];
            block.sums[1][i] += weight * flux[4];
            block.sums[2][i] += weight * flux[5];
            block.sums[3][i] += weight * flux[6];
        }
    } else {
        for (int k = 0; k < fluxNumbers(kSum); ++k) {
            const float number = flux[k];
            for (int i = 0; i < kSize; ++i)
                block.sums[k][i] += share[i] * number;
        }
    }
}

/// Shares of the sides that concern a block; false when nothing covers its places.
INSITU_KERNEL bool sharesOf(const Look& look,
                            const SilhouetteSet& set,
                            std::size_t silhouette,
                            const Block& block,
                            std::uint32_t concern,
                            float bias,
                            Projected& p)
{
    project(look, block, set.resolution, p);
    if (!loadCoverage(set.coverageOf(silhouette), set.resolution, p)) return false;
    if ((concern & kDepth) != 0) {
        loadDepths(look, block, set.depthsOf(silhouette), set.resolution, p);
        sharesByDepth(look, bias, p);
    } else {
        shareOfCoverage(p, (concern & kAlong) != 0 ? p.along : p.against);
    }
    return true;
}

}  // namespace insitu::fiv
