#include "lighting/fiv_kernel.h"

#include "core/check.h"
#include "lighting/fiv_kernel_steps.h"

namespace insitu::fiv {

namespace {

/// All of a direction's light is hidden from all places.
template <Sum kSum>
INSITU_KERNEL void accumulateAll(const float* flux, Projected& p, Block& block)
{
    if constexpr (kSum == Sum::PerPlace || kSum == Sum::Radiance) {
        for (int i = 0; i < kSize; ++i)
            p.along[i] = 1.0f;
        accumulate<kSum>(p.along, flux, block);
    } else {
        for (int k = 0; k < fluxNumbers(kSum); ++k)
            block.uniform[k] += flux[k];
    }
}

template <Sum kSum>
INSITU_KERNEL void sumDirections(const Source& source, float bias, Group& group)
{
    const SilhouetteSet& set = *source.set;
    constexpr auto kNumbers = static_cast<std::size_t>(fluxNumbers(kSum));
    Projected p;
    Concerns found;
    for (std::size_t direction = 0; direction < source.shines.size(); ++direction) {
        const std::uint32_t shines = source.shines[direction];
        if (shines == 0) continue;
        const Look look = lookAt(set.frames[direction], set.resolution, bias);
        concerns(look, group, shines, found);
        for (int b = 0; b < group.count; ++b) {
            const std::uint32_t sides = found.sides[b];
            if ((sides & (kAlong | kAgainst)) == 0) continue;
            const Cover cover = coverOf(set.tiles[direction], found, b);
            if (cover == Cover::Nothing) continue;
            Block& block = group.blocks[b];
            const float* const along = source.along.data() + direction * kNumbers;
            const float* const against = source.against.data() + direction * kNumbers;
            if (cover == Cover::All && (sides & kDepth) == 0) {
                accumulateAll<kSum>((sides & kAlong) != 0 ? along : against, p, block);
                continue;
            }
            if (!sharesOf(look, set, direction, block, sides, bias, p)) continue;
            if ((sides & kAlong) != 0) accumulate<kSum>(p.along, along, block);
            if ((sides & kAgainst) != 0) accumulate<kSum>(p.against, against, block);
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
    std::vector<Concerns> found(occluders.size());
    for (std::size_t direction = 0; direction < light.shines.size(); ++direction) {
        const std::uint32_t shines = light.shines[direction];
        if (shines == 0) continue;
        for (std::size_t k = 0; k < occluders.size(); ++k) {
            const Occluder& o = occluders[k];
            looks[k] = lookAt(o.frames[direction], o.set->resolution, bias);
            const std::uint32_t own =
                o.swapped[direction] != 0 ? (shines >> 1) | ((shines & 1u) << 1) : shines;
            concerns(looks[k], groups[k], own, found[k]);
        }
        for (int b = 0; b < groups[0].count; ++b) {
            left.start();
            for (std::size_t k = 0; k < occluders.size(); ++k) {
                const Occluder& o = occluders[k];
                const std::uint32_t concern = found[k].sides[b];
                if ((concern & (kAlong | kAgainst)) == 0) continue;
                if (coverOf(o.set->tiles[o.silhouettes[direction]], found[k], b) == Cover::Nothing)
                    continue;
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
        case Sum::Radiance:
            return sumJob<Sum::Radiance>(job);
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
