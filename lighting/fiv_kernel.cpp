#include "lighting/fiv_kernel.h"

#include "core/check.h"
#include "lighting/fiv_kernel_steps.h"

#include <algorithm>
#include <memory>

namespace insitu::fiv {

namespace {

/// All of a direction's light is hidden from all places.
template <Sum kSum>
INSITU_KERNEL void accumulateAll(const float* flux, Projected& p, Block& block)
{
    if constexpr (kSum == Sum::PerPlace) {
        for (int i = 0; i < kSize; ++i)
            p.along[i] = 1.0f;
        accumulate<kSum>(p.along, flux, block);
    } else {
        for (int k = 0; k < fluxNumbers(kSum); ++k)
            block.uniform[k] += flux[k];
    }
}

/// A direction's numbers; null where no direction has any.
INSITU_KERNEL const float* fluxOf(const std::vector<float>& flux,
                                  std::size_t direction,
                                  std::size_t numbers)
{
    return flux.empty() ? nullptr : flux.data() + direction * numbers;
}

/// Whether light may fall on the front of any surface whose normal lies within the bounds.
INSITU_KERNEL bool mayFallOn(const NormalBounds& bounds, const float* vector)
{
    float most = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        const float low = vector[axis] * bounds.low[axis];
        const float high = vector[axis] * bounds.high[axis];
        most += low > high ? low : high;
    }
    return most > 0.0f;
}

/// Those of the sides from which light falls on surfaces.
template <Sum kSum>
INSITU_KERNEL std::uint32_t litSides(std::uint32_t sides,
                                     const NormalBounds& bounds,
                                     const float* along,
                                     const float* against)
{
    if constexpr (kSum != Sum::PerPlace) return sides;
    constexpr int kVectors = 3;  // one a channel
    const auto falls = [&](const float* vectors) {
        bool any = false;
        for (int c = 0; c < kVectors; ++c)
            any |= mayFallOn(bounds, vectors + 3 * c);
        return any;
    };
    if ((sides & kAlong) != 0 && !falls(along)) sides &= ~std::uint32_t{kAlong};
    if ((sides & kAgainst) != 0 && !falls(against)) sides &= ~std::uint32_t{kAgainst};
    return sides;
}

template <Sum kSum>
INSITU_KERNEL void sumDirections(const Source& source, float bias, Group& group)
{
    const SilhouetteSet& set = *source.set;
    constexpr auto kNumbers = static_cast<std::size_t>(fluxNumbers(kSum));
    Projected p;
    Concerns found;
    for (std::size_t direction = 0; direction < source.shines.size(); ++direction) {
        const float* const along = fluxOf(source.along, direction, kNumbers);
        const float* const against = fluxOf(source.against, direction, kNumbers);
        const std::uint32_t shines =
            litSides<kSum>(source.shines[direction], group.all_normals, along, against);
        if (shines == 0) continue;
        const Look look = lookAt(set.frames[direction], set.resolution, bias);
        concerns(look, group, shines, found);
        const SilhouetteTiles& tiles = set.tiles[direction];
        for (int n = 0; n < found.count; ++n) {
            const int b = found.list[n];
            const Cover cover = coverOf(tiles, found, b);
            if (cover == Cover::Nothing) continue;
            const std::uint32_t sides =
                litSides<kSum>(sidesOf(look, tiles, found, b), group.normals[b], along, against);
            if ((sides & (kAlong | kAgainst)) == 0) continue;
            Block& block = group.blocks[static_cast<std::size_t>(b)];
            if (cover == Cover::All && (sides & kDepth) == 0) {
                if ((sides & kAlong) != 0) accumulateAll<kSum>(along, p, block);
                if ((sides & kAgainst) != 0) accumulateAll<kSum>(against, p, block);
                continue;
            }
            if (!sharesOf(look, set, direction, block, sides, bias, p)) continue;
            if ((sides & kAlong) != 0) accumulate<kSum>(p.along, along, block);
            if ((sides & kAgainst) != 0) accumulate<kSum>(p.against, against, block);
        }
    }
}

/// What several objects leave of the light of each block: multiplied by each one's shares.
struct Left {
    bool any[Group::kBlocks];
    alignas(64) float along[Group::kBlocks][kSize], against[Group::kBlocks][kSize];

    INSITU_KERNEL void start(int b)
    {
        if (any[b]) return;
        any[b] = true;
        for (int i = 0; i < kSize; ++i)
            along[b][i] = against[b][i] = 1.0f;
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

/// Takes from what is left of a direction's light what one of the objects hides.
INSITU_KERNEL void takeHidden(const Occluder& occluder,
                              std::size_t direction,
                              const Look& look,
                              const Concerns& found,
                              float bias,
                              const Group& group,
                              Projected& p,
                              Left& left)
{
    const std::size_t silhouette = occluder.silhouettes[direction];
    const SilhouetteTiles& tiles = occluder.set->tiles[silhouette];
    const bool swapped = occluder.swapped[direction] != 0;
    for (int n = 0; n < found.count; ++n) {
        const int b = found.list[n];
        if (coverOf(tiles, found, b) == Cover::Nothing) continue;
        const std::uint32_t sides = sidesOf(look, tiles, found, b);
        if ((sides & (kAlong | kAgainst)) == 0) continue;
        const Block& block = group.blocks[static_cast<std::size_t>(b)];
        if (!sharesOf(look, *occluder.set, silhouette, block, sides, bias, p)) continue;
        left.start(b);
        if ((sides & kAlong) != 0) Left::take(swapped ? left.against[b] : left.along[b], p.along);
        if ((sides & kAgainst) != 0)
            Left::take(swapped ? left.along[b] : left.against[b], p.against);
    }
}

template <Sum kSum>
INSITU_KERNEL void sumUnion(const Source& light,
                            std::span<const Occluder> occluders,
                            float bias,
                            std::span<Group> groups)
{
    constexpr auto kNumbers = static_cast<std::size_t>(fluxNumbers(kSum));
    Projected p;
    Concerns found;
    const auto left = std::make_unique<Left>();
    for (std::size_t direction = 0; direction < light.shines.size(); ++direction) {
        const float* const along = fluxOf(light.along, direction, kNumbers);
        const float* const against = fluxOf(light.against, direction, kNumbers);
        const std::uint32_t shines =
            litSides<kSum>(light.shines[direction], groups[0].all_normals, along, against);
        if (shines == 0) continue;
        std::fill(std::begin(left->any), std::end(left->any), false);
        for (std::size_t k = 0; k < occluders.size(); ++k) {
            const Occluder& o = occluders[k];
            const Look look = lookAt(o.frames[direction], o.set->resolution, bias);
            const std::uint32_t own =
                o.swapped[direction] != 0 ? (shines >> 1) | ((shines & 1u) << 1) : shines;
            concerns(look, groups[k], own, found);
            takeHidden(o, direction, look, found, bias, groups[k], p, *left);
        }
        for (int b = 0; b < groups[0].count; ++b) {
            if (!left->any[b]) continue;
            Left::invert(left->along[b]);
            Left::invert(left->against[b]);
            Block& block = groups[0].blocks[static_cast<std::size_t>(b)];
            if ((shines & kAlong) != 0) accumulate<kSum>(left->along[b], along, block);
            if ((shines & kAgainst) != 0) accumulate<kSum>(left->against[b], against, block);
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
        case Sum::Corners:
            return sumJob<Sum::Corners>(job);
    }
}

void sumBase(Sum sum, const Job& job)
{
    sumAny(sum, job);
}

#if defined(__x86_64__)
INSITU_TARGET_AVX2 void sumAvx2(Sum sum, const Job& job)
{
    sumAny(sum, job);
}

INSITU_TARGET_AVX512 void sumAvx512(Sum sum, const Job& job)
{
    sumAny(sum, job);
}
#endif

void dispatch(Isa isa, Sum sum, const Job& job)
{
    INSITU_CHECK(static_cast<int>(isa) <= static_cast<int>(bestInstructionSet()),
                 "instruction set");
#if defined(__x86_64__)
    if (isa == Isa::Avx512) return sumAvx512(sum, job);
    if (isa == Isa::Avx2) return sumAvx2(sum, job);
#endif
    sumBase(sum, job);
}

}  // namespace

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
