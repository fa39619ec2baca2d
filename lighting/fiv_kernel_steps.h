#pragma once

#include "lighting/fiv_concerns.h"

#include <bit>
#include <cstring>

/// The steps of fiv_kernel.cpp and nothing else: from a block's places to the shares that a
/// silhouette hides.
namespace insitu::fiv {

static_assert(std::endian::native == std::endian::little, "depths are read as pairs of 16 bits");

/// Places of a block in a silhouette.
struct Projected {
    alignas(64) float column[kSize], row[kSize];  ///< parts of a texel
    alignas(64) float depth[kSize];
    alignas(64) std::int32_t texel_column[kSize], texel_row[kSize], texel[kSize];
    /// Coverage of the texels around each place: bytes 0 and 1 of its own row, 2 and 3 of the next.
    alignas(64) std::uint32_t quads[kSize];
    alignas(64) std::uint32_t spans[4][kSize];
    alignas(64) float along[kSize], against[kSize];
};

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
        p.texel_column[i] = c;
        p.texel_row[i] = r;
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

/// A square of 4 x 4 texels that holds all texels around a block's places; places of a picture are
/// so close together that most blocks have one.
struct Window {
    static constexpr std::int32_t kSide = 4;

    std::int32_t column = 0, row = 0;
    bool holds_all = false;
};

INSITU_KERNEL Window windowOf(const Projected& p, int resolution)
{
    std::int32_t left = p.texel_column[0];
    std::int32_t right = left;
    std::int32_t top = p.texel_row[0];
    std::int32_t bottom = top;
    for (int i = 0; i < kSize; ++i) {
        left = left < p.texel_column[i] ? left : p.texel_column[i];
        right = right > p.texel_column[i] ? right : p.texel_column[i];
        top = top < p.texel_row[i] ? top : p.texel_row[i];
        bottom = bottom > p.texel_row[i] ? bottom : p.texel_row[i];
    }
    const std::int32_t last = resolution - Window::kSide;
    return {left < last ? left : last,
            top < last ? top : last,
            right - left < Window::kSide - 1 && bottom - top < Window::kSide - 1};
}

/// Coverage from a window, without memory: bytes of one vector by the numbers in another.
INSITU_KERNEL bool coverageOfWindow(const std::uint8_t* coverage,
                                    int resolution,
                                    const Window& window,
                                    Projected& p)
{
    using Bytes = std::uint8_t __attribute__((vector_size(16)));
    using Words = std::uint32_t __attribute__((vector_size(16)));
    Words rows;
    for (std::int32_t y = 0; y < Window::kSide; ++y) {
        std::uint32_t row;
        std::memcpy(&row, coverage + (window.row + y) * resolution + window.column, sizeof(row));
        rows[y] = row;
    }
    if ((rows[0] | rows[1] | rows[2] | rows[3]) == 0) return false;
    alignas(64) std::uint32_t control[kSize];
    for (int i = 0; i < kSize; ++i) {
        const std::int32_t first =
            (p.texel_row[i] - window.row) * Window::kSide + p.texel_column[i] - window.column;
        control[i] = static_cast<std::uint32_t>(first) * 0x01010101u + 0x05040100u;
    }
    for (int i = 0; i < kSize; i += 4) {
        Bytes wanted;
        std::memcpy(&wanted, control + i, sizeof(wanted));
        const Bytes quads = __builtin_shuffle(reinterpret_cast<Bytes>(rows), wanted);
        std::memcpy(p.quads + i, &quads, sizeof(quads));
    }
    return true;
}

/// False when nothing covers any of the texels around the places.
INSITU_KERNEL bool loadCoverage(const std::uint8_t* coverage, int resolution, Projected& p)
{
    if (const Window window = windowOf(p, resolution); window.holds_all)
        return coverageOfWindow(coverage, resolution, window, p);
    std::uint32_t any = 0;
    for (int i = 0; i < kSize; ++i) {
        const std::uint8_t* const texel = coverage + p.texel[i];
        const std::uint32_t quad =
            loaded<std::uint16_t>(texel) | loaded<std::uint16_t>(texel + resolution) << 16;
        p.quads[i] = quad;
        any |= quad;
    }
    return any != 0;
}

/// Coverage of one of the four texels around a place, [0, 255].
INSITU_KERNEL float covered(std::uint32_t quad, int corner)
{
    return static_cast<float>(static_cast<std::int32_t>(quad >> (8 * corner) & 255u));
}

/// Shares of both directions, whatever the depth.
INSITU_KERNEL void shareOfCoverage(Projected& p)
{
    for (int i = 0; i < kSize; ++i) {
        const std::uint32_t quad = p.quads[i];
        const float a = covered(quad, 0);
        const float b = covered(quad, 1);
        const float c = covered(quad, 2);
        const float d = covered(quad, 3);
        const float upper = a + p.column[i] * (b - a);
        const float lower = c + p.column[i] * (d - c);
        p.along[i] = p.against[i] = (upper + p.row[i] * (lower - upper)) * (1.0f / 255.0f);
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
        float along = 0.0f;
        float against = 0.0f;
        for (int k = 0; k < 4; ++k) {
            const auto near =
                static_cast<float>(static_cast<std::int32_t>(p.spans[k][i] & 0xffffu));
            const auto far = static_cast<float>(static_cast<std::int32_t>(p.spans[k][i] >> 16));
            const float weight = weights[k] * covered(p.quads[i], k);
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
        shareOfCoverage(p);
    }
    return true;
}

}  // namespace insitu::fiv
