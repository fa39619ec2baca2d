#include "lighting/fiv_kernel.h"

#include "core/check.h"

#include <bit>
#include <cmath>
#include <cstring>

namespace insitu::fiv {

static_assert(std::endian::native == std::endian::little, "depths are read as pairs of 16 bits");

// Inlined into one function for each instruction set, which then decides how loops are vectorised.
#define INSITU_KERNEL inline __attribute__((always_inline))

namespace {

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
};

INSITU_KERNEL Look lookAt(const SilhouetteFrame& frame, int resolution, float bias)
{
    Look look{frame};
    look.column_size = size(look.frame.column_axis);
    look.row_size = size(look.frame.row_axis);
    look.depth_size = size(look.frame.depth_axis);
    look.edge = static_cast<float>(resolution - 1);
    look.undecided = (0.5f + std::abs(bias)) * look.frame.texel_depth;
    return look;
}

/// Which blocks of the group the silhouette can hide from the light, each a set of Concern.
INSITU_KERNEL void concerns(const Look& look,
                            const Group& group,
                            std::uint32_t shines,
                            std::uint32_t* found)
{
    const SilhouetteFrame& f = look.frame;
    for (int b = 0; b < Group::kBlocks; ++b) {
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
        found[b] = lit | (sides == (kAlong | kAgainst) ? std::uint32_t{kDepth} : 0u);
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

template <Sum kSum>
INSITU_KERNEL void sumDirections(const Source& source, float bias, Group& group)
{
    const SilhouetteSet& set = *source.set;
    constexpr auto kNumbers = static_cast<std::size_t>(fluxNumbers(kSum));
    Projected p;
    alignas(64) std::uint32_t found[Group::kBlocks];
    for (std::size_t direction = 0; direction < source.shines.size(); ++direction) {
        const std::uint32_t shines = source.shines[direction];
        if (shines == 0) continue;
        const Look look = lookAt(set.frames[direction], set.resolution, bias);
        concerns(look, group, shines, found);
        for (int b = 0; b < group.count; ++b) {
            if ((found[b] & (kAlong | kAgainst)) == 0) continue;
            Block& block = group.blocks[b];
            if (!sharesOf(look, set, direction, block, found[b], bias, p)) continue;
            if ((found[b] & kAlong) != 0)
                accumulate<kSum>(p.along, source.along.data() + direction * kNumbers, block);
            if ((found[b] & kAgainst) != 0)
                accumulate<kSum>(p.against, source.against.data() + direction * kNumbers, block);
        }
    }
}

/// What several objects leave of the light of a block: multiplied by each one's shares.
struct Left {
    alignas(64) float along[kSize], against[kSize];
    bool any = false;

    INSITU_KERNEL void start()
    {
        any = false;
        for (int i = 0; i < kSize; ++i)
            along[i] = against[i] = 1.0f;
    }
    INSITU_KERNEL static void take(float* left, const float* share)
    {
        for (int i = 0; i < kSize; ++i)
            left[i] *= 1.0f - share[i];
    }
    INSITU_KERNEL static void invert(float* left)
    {
        for (int i = 0; i < kSize; ++i)
            left[i] = 1.0f - left[i];
    }
};

template <Sum kSum>
INSITU_KERNEL void sumUnion(const Source& light,
                            std::span<const Occluder> occluders,
                            float bias,
                            std::span<Group> groups)
{
    constexpr auto kNumbers = static_cast<std::size_t>(fluxNumbers(kSum));
    Projected p;
    Left left;
    std::vector<Look> looks(occluders.size());
    std::vector<std::uint32_t> found(occluders.size() * Group::kBlocks);
    for (std::size_t direction = 0; direction < light.shines.size(); ++direction) {
        const std::uint32_t shines = light.shines[direction];
        if (shines == 0) continue;
        for (std::size_t k = 0; k < occluders.size(); ++k) {
            const Occluder& o = occluders[k];
            looks[k] = lookAt(o.frames[direction], o.set->resolution, bias);
            const std::uint32_t own =
                o.swapped[direction] != 0 ? (shines >> 1) | ((shines & 1u) << 1) : shines;
            concerns(looks[k], groups[k], own, found.data() + k * Group::kBlocks);
        }
        for (int b = 0; b < groups[0].count; ++b) {
            left.start();
            for (std::size_t k = 0; k < occluders.size(); ++k) {
                const Occluder& o = occluders[k];
                const std::uint32_t concern =
                    found[k * Group::kBlocks + static_cast<std::size_t>(b)];
                if ((concern & (kAlong | kAgainst)) == 0) continue;
                if (!sharesOf(looks[k],
                              *o.set,
                              o.silhouettes[direction],
                              groups[k].blocks[b],
                              concern,
                              bias,
                              p))
                    continue;
                const bool swapped = o.swapped[direction] != 0;
                if ((concern & kAlong) != 0)
                    Left::take(swapped ? left.against : left.along, p.along);
                if ((concern & kAgainst) != 0)
                    Left::take(swapped ? left.along : left.against, p.against);
                left.any = true;
            }
            if (!left.any) continue;
            Left::invert(left.along);
            Left::invert(left.against);
            Block& block = groups[0].blocks[b];
            if ((shines & 1u) != 0)
                accumulate<kSum>(left.along, light.along.data() + direction * kNumbers, block);
            if ((shines & 2u) != 0)
                accumulate<kSum>(left.against, light.against.data() + direction * kNumbers, block);
        }
    }
}

/// Everything that a sum is made from; no occluders: the source's own set.
struct Job {
    const Source& source;
    std::span<const Occluder> occluders;
    float bias = 0.0f;
    std::span<Group> groups;
};

template <Sum kSum>
INSITU_KERNEL void sumJob(const Job& job)
{
    if (job.occluders.empty())
        sumDirections<kSum>(job.source, job.bias, job.groups[0]);
    else
        sumUnion<kSum>(job.source, job.occluders, job.bias, job.groups);
}

INSITU_KERNEL void sumAny(Sum sum, const Job& job)
{
    switch (sum) {
        case Sum::Vectors:
            return sumJob<Sum::Vectors>(job);
        case Sum::Irradiance:
            return sumJob<Sum::Irradiance>(job);
        case Sum::PerPlace:
            return sumJob<Sum::PerPlace>(job);
    }
}

void sumBase(Sum sum, const Job& job)
{
    sumAny(sum, job);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) void sumAvx2(Sum sum, const Job& job)
{
    sumAny(sum, job);
}

__attribute__((target("avx512f,avx512bw,avx512vl,avx512dq,prefer-vector-width=512"))) void
sumAvx512(Sum sum, const Job& job)
{
    sumAny(sum, job);
}
#endif

void dispatch(Isa isa, Sum sum, const Job& job)
{
    INSITU_CHECK(static_cast<int>(isa) <= static_cast<int>(bestIsa()), "instruction set");
#if defined(__x86_64__)
    if (isa == Isa::Avx512) return sumAvx512(sum, job);
    if (isa == Isa::Avx2) return sumAvx2(sum, job);
#endif
    sumBase(sum, job);
}

}  // namespace

Isa bestIsa()
{
#if defined(__x86_64__)
    static const Isa best = [] {
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
            __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq"))
            return Isa::Avx512;
        return __builtin_cpu_supports("avx2") ? Isa::Avx2 : Isa::Base;
    }();
    return best;
#else
    return Isa::Base;
#endif
}

void addHidden(Isa isa, Sum sum, const Source& source, float bias_texels, Group& group)
{
    dispatch(isa, sum, {source, {}, bias_texels, {&group, 1}});
}

void addHiddenByAny(Isa isa,
                    Sum sum,
                    const Source& light,
                    std::span<const Occluder> occluders,
                    float bias_texels,
                    std::span<Group> groups)
{
    INSITU_CHECK(!occluders.empty() && occluders.size() == groups.size(),
                 "{} groups for {} occluders",
                 groups.size(),
                 occluders.size());
    dispatch(isa, sum, {light, occluders, bias_texels, groups});
}

}  // namespace insitu::fiv
