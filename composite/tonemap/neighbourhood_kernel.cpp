#include "composite/tonemap/neighbourhood_kernel.h"

#include "composite/tonemap/line_steps.h"
#include "core/check.h"

#include <cmath>
#include <memory>

namespace insitu::tonemap {

namespace {

/// A plane of a coarser level; (0, 0) is the tile's first pixel.
struct Plane {
    Plane(int width, int height, int margin_pixels)
        : margin(margin_pixels),
          stride(width + 2 * margin),
          rows(height + 2 * margin),
          // Not initialised: all that is read is written before.
          values(new float[static_cast<std::size_t>(stride) * static_cast<std::size_t>(rows)])
    {
    }
    [[nodiscard]] float* at(int x, int y) const
    {
        return values.get() + static_cast<std::ptrdiff_t>(y + margin) * stride + (x + margin);
    }

    int margin;
    int stride;
    int rows;
    std::unique_ptr<float[]> values;
};

/// Longest line: a tile's row with its halo.
constexpr int kLongestLine = 2048;
/// Many lines are read side by side: their starts must not share the sets of the first cache.
struct Line {
    alignas(64) float values[kLongestLine + 48];
};

/// What a line of midpoints needs before its first place, and in all.
constexpr int kBefore = kMidpointReach - 1;
constexpr int kAround = 2 * kMidpointReach - 1;

/// Every second pixel of the picture after G_4.
INSITU_KERNEL void reducePatch(const LuminancePatch& patch, const Kernel& kernel, Plane& half)
{
    Line blurred;
    const std::ptrdiff_t columns = patch.half();
    for (int y = -half.margin; y < half.rows - half.margin; ++y) {
        filterLine<kReduceRadius>(patch.even(2 * y) - patch.halo / 2,
                                  patch.stride(),
                                  kernel.data(),
                                  blurred.values,
                                  2 * columns);
        const float* const even = blurred.values + patch.halo / 2 - half.margin;
        filterEven<kReduceRadius>(
            even, even + columns, kernel.data(), half.at(-half.margin, y), half.stride);
    }
}

template <int kRadius>
INSITU_KERNEL void filterPlane(const Plane& from, const Kernel& kernel, Plane& to)
{
    Line blurred;
    const int margin = to.margin;
    for (int y = -margin; y < to.rows - margin; ++y) {
        filterLine<kRadius>(from.at(-margin - kRadius, y),
                            from.stride,
                            kernel.data(),
                            blurred.values,
                            to.stride + 2 * kRadius);
        filterLine<kRadius>(
            blurred.values + kRadius, 1, kernel.data(), to.at(-margin, y), to.stride);
    }
}

/// The five coarse scales of a level from its input; `wide` is the third of them.
INSITU_KERNEL void filterLevel(const Plane& input,
                               const NeighbourhoodKernels& kernels,
                               std::array<Plane, kCoarseScales>& planes)
{
    filterPlane<kCoarseRadius[0]>(input, kernels.coarse[0], planes[0]);
    filterPlane<kCoarseRadius[1]>(input, kernels.coarse[1], planes[1]);
    filterPlane<kCoarseRadius[2]>(input, kernels.coarse[2], planes[2]);
    filterPlane<kCoarseRadius[3]>(input, kernels.coarse[3], planes[3]);
    filterPlane<kCoarseRadius[4]>(input, kernels.coarse[4], planes[4]);
}

INSITU_KERNEL void takeEverySecond(const Plane& from, Plane& to)
{
    for (int y = -to.margin; y < to.rows - to.margin; ++y) {
        const float* const in = from.at(-2 * to.margin, 2 * y);
        float* const out = to.at(-to.margin, y);
        for (int x = 0; x < to.stride; ++x)
            out[x] = in[2 * x];
    }
}

/// A plane of the quarter level at the half level's pixels.
INSITU_KERNEL void doublePlane(const Plane& from, const Kernel& midpoint, Plane& to)
{
    Line between;
    Line middles;
    const int first = -to.margin / 2;
    const int count = to.stride / 2;
    for (int y = -to.margin; y < to.rows - to.margin; ++y) {
        const float* in = from.at(first - kBefore, (y - (y & 1)) / 2);
        if ((y & 1) != 0) {
            midpointLine<kMidpointReach>(
                in, from.stride, midpoint.data(), between.values, count + kAround);
            in = between.values;
        }
        midpointLine<kMidpointReach>(in + kBefore, 1, midpoint.data(), middles.values, count);
        float* const out = to.at(-to.margin, y);
        for (int x = 0; x < count; ++x) {
            out[2 * x] = in[x + kBefore];
            out[2 * x + 1] = middles.values[x];
        }
    }
}

/// All scales of one run of pixels, columns of one parity: g[s] for s = 0 (the luminance) to 10 and
/// g[10 + i] for 12, 14, … 20.
using Scales = std::array<const float*, kScales + kCoarseScales + 1>;

constexpr int wider(int scale)
{
    return 2 * scale <= kScales ? 2 * scale : kScales + (2 * scale - kScales) / 2;
}

/// Where the local contrast |G_s - G_2s| / G_s first exceeds the threshold, between s - 1 and s, by
/// linear interpolation of the contrast. From the coarsest scale to the finest, so that what is
/// kept last is the first crossing: no branch.
INSITU_KERNEL void chooseScale(const Scales& g,
                               float threshold,
                               float* __restrict adapted,
                               std::ptrdiff_t count)
{
    for (std::ptrdiff_t i = 0; i < count; ++i) {
        // Contrasts as fractions: above / below at the crossing, `before` at the scale before.
        float above = 1.0f, below = 1.0f, before_above = 0.0f, before_below = 1.0f;
        float level = g[kScales][i];
        float before_level = level;
#pragma GCC unroll 16
        for (int s = kScales; s >= 1; --s) {
            const float middle = g[static_cast<std::size_t>(s)][i];
            const float difference = std::fabs(middle - g[static_cast<std::size_t>(wider(s))][i]);
            const float finer = g[static_cast<std::size_t>(s - 1)][i];
            const float finer_difference =
                s == 1 ? 0.0f : std::fabs(finer - g[static_cast<std::size_t>(wider(s - 1))][i]);
            const bool crossed = difference > threshold * middle;
            above = crossed ? difference : above;
            below = crossed ? middle : below;
            before_above = crossed ? finer_difference : before_above;
            before_below = crossed ? (s == 1 ? 1.0f : finer) : before_below;
            level = crossed ? middle : level;
            before_level = crossed ? finer : before_level;
        }
        // (threshold - c') / (c - c') with c = above / below, c' the same of the scale before.
        const float span = above * before_below - before_above * below;
        const float part = (threshold * before_below - before_above) * below;
        const float share = part / (span > 0.0f ? span : 1.0f);
        adapted[i] = before_level + share * (level - before_level);
    }
}

/// One tile's coarse levels and the lines of its rows.
struct Search {
    Search(const LuminancePatch& luminances, int half_width, int half_height)
        : patch(luminances),
          half(planes(half_width, half_height, kHalfWideMargin)),
          doubled(planes(half_width, half_height, kHalfMargin))
    {
    }
    /// The third is what the next level starts from.
    static std::array<Plane, kCoarseScales> planes(int width, int height, int third_margin)
    {
        const auto plane = [&](int margin) { return Plane(width, height, margin); };
        return {plane(kHalfMargin),
                plane(kHalfMargin),
                plane(third_margin),
                plane(kHalfMargin),
                plane(kHalfMargin)};
    }

    const LuminancePatch& patch;
    const NeighbourhoodKernels& kernels = neighbourhoodKernels();
    std::array<Plane, kCoarseScales> half;     ///< s = 6…10
    std::array<Plane, kCoarseScales> doubled;  ///< s = 12…20, at the half level's pixels
    using RowScales = std::array<Line, kScales + kCoarseScales + 1>;
    Line vertical;
    std::array<RowScales, 2> lines;  ///< scales of the row, by parity
    RowScales between;               ///< coarse ones between two rows
};

template <int kScale>
INSITU_KERNEL void fineScale(Search& search, int y, int first, int count)
{
    constexpr int kRadius = kFineRadius[kScale];
    const float* const kernel = search.kernels.fine[kScale].data();
    const int width = count + kRadius + 2;
    const std::ptrdiff_t start = first - kRadius / 2 - 1;
    float* const even = search.vertical.values;
    float* const odd = even + width;
    const std::ptrdiff_t stride = search.patch.stride();
    filterLine<kRadius>(search.patch.even(y) + start, stride, kernel, even, width);
    filterLine<kRadius>(search.patch.odd(y) + start, stride, kernel, odd, width);
    const int skip = kRadius / 2 + 1;
    filterEven<kRadius>(even + skip, odd + skip, kernel, search.lines[0][kScale + 1].values, count);
    filterEven<kRadius>(
        odd + skip, even + skip + 1, kernel, search.lines[1][kScale + 1].values, count);
}

/// Row y of a half-level plane at the picture's pixels: what it has is the even column.
template <std::size_t kIndex>
INSITU_KERNEL void coarseScale(
    Search& search, const Plane& plane, int y, int first, int count, std::array<Scales, 2>& g)
{
    constexpr std::size_t scale = kFineScales + 1 + kIndex;
    const float* in = plane.at(first - kBefore, y / 2);
    Line& line = search.between[kIndex];
    if (y % 2 != 0) {
        midpointLine<kMidpointReach>(
            in, plane.stride, search.kernels.midpoint.data(), line.values, count + kAround);
        in = line.values;
    }
    Line& middles = search.lines[1][scale];
    midpointLine<kMidpointReach>(
        in + kBefore, 1, search.kernels.midpoint.data(), middles.values, count);
    g[0][scale] = in + kBefore;
    g[1][scale] = middles.values;
}

/// Columns [2 first, 2 (first + count)) of row y.
INSITU_KERNEL void searchRun(
    Search& search, int y, int first, int count, float threshold, float* adapted)
{
    fineScale<0>(search, y, first, count);
    fineScale<1>(search, y, first, count);
    fineScale<2>(search, y, first, count);
    fineScale<3>(search, y, first, count);
    fineScale<4>(search, y, first, count);
    std::array<Scales, 2> g{};
    g[0][0] = search.patch.even(y) + first;
    g[1][0] = search.patch.odd(y) + first;
    for (std::size_t s = 1; s <= kFineScales; ++s)
        for (std::size_t parity = 0; parity < 2; ++parity)
            g[parity][s] = search.lines[parity][s].values;
    coarseScale<0>(search, search.half[0], y, first, count, g);
    coarseScale<1>(search, search.half[1], y, first, count, g);
    coarseScale<2>(search, search.half[2], y, first, count, g);
    coarseScale<3>(search, search.half[3], y, first, count, g);
    coarseScale<4>(search, search.half[4], y, first, count, g);
    coarseScale<5>(search, search.doubled[0], y, first, count, g);
    coarseScale<6>(search, search.doubled[1], y, first, count, g);
    coarseScale<7>(search, search.doubled[2], y, first, count, g);
    coarseScale<8>(search, search.doubled[3], y, first, count, g);
    coarseScale<9>(search, search.doubled[4], y, first, count, g);
    float* const row = adapted + static_cast<std::ptrdiff_t>(y) * search.patch.width;
    chooseScale(g[0], threshold, row + first, count);
    chooseScale(g[1], threshold, row + search.patch.width / 2 + first, count);
}

INSITU_KERNEL void searchBlocks(Search& search,
                                const WantedBlocks& blocks,
                                float threshold,
                                float* adapted)
{
    constexpr int kHalfBlock = WantedBlocks::kWidth / 2;
    const int columns = search.patch.width / 2;
    for (int y = 0; y < search.patch.height; ++y) {
        const std::uint8_t* const wanted =
            blocks.wanted.data() +
            static_cast<std::ptrdiff_t>(y / WantedBlocks::kHeight) * blocks.columns;
        for (int block = 0; block < blocks.columns; ++block) {
            if (wanted[block] == 0) continue;
            const int first = block * kHalfBlock;
            while (block + 1 < blocks.columns && wanted[block + 1] != 0)
                ++block;
            const int end = std::min((block + 1) * kHalfBlock, columns);
            searchRun(search, y, first, end - first, threshold, adapted);
        }
    }
}

INSITU_KERNEL void adaptAny(const LuminancePatch& patch,
                            const WantedBlocks& blocks,
                            float threshold,
                            float* adapted)
{
    const NeighbourhoodKernels& kernels = neighbourhoodKernels();
    const int half_width = patch.width / 2;
    const int half_height = patch.height / 2;
    const auto quarterPlane = [&](int margin) {
        return Plane(half_width / 2, half_height / 2, margin);
    };
    const auto search = std::make_unique<Search>(patch, half_width, half_height);
    Plane half_input(half_width, half_height, kHalfInputMargin);
    reducePatch(patch, kernels.reduce, half_input);
    filterLevel(half_input, kernels, search->half);
    Plane quarter_input = quarterPlane(kQuarterInputMargin);
    takeEverySecond(search->half[2], quarter_input);
    std::array<Plane, kCoarseScales> quarter = {quarterPlane(kQuarterMargin),
                                                quarterPlane(kQuarterMargin),
                                                quarterPlane(kQuarterMargin),
                                                quarterPlane(kQuarterMargin),
                                                quarterPlane(kQuarterMargin)};
    filterLevel(quarter_input, kernels, quarter);
    for (std::size_t i = 0; i < kCoarseScales; ++i)
        doublePlane(quarter[i], kernels.midpoint, search->doubled[i]);
    searchBlocks(*search, blocks, threshold, adapted);
}

void adaptBase(const LuminancePatch& p, const WantedBlocks& b, float t, float* a)
{
    adaptAny(p, b, t, a);
}

#if defined(__x86_64__)
INSITU_TARGET_AVX2 void adaptAvx2(const LuminancePatch& p, const WantedBlocks& b, float t, float* a)
{
    adaptAny(p, b, t, a);
}

INSITU_TARGET_AVX512 void adaptAvx512(const LuminancePatch& p,
                                      const WantedBlocks& b,
                                      float t,
                                      float* a)
{
    adaptAny(p, b, t, a);
}
#endif

}  // namespace

void adaptToNeighbourhood(InstructionSet set,
                          const LuminancePatch& patch,
                          const WantedBlocks& blocks,
                          float threshold,
                          float* adapted)
{
    INSITU_CHECK(set <= bestInstructionSet(), "instruction set");
    INSITU_CHECK(patch.halo >= kNeighbourhoodHalo && patch.width % 4 == 0 &&
                     patch.height % 4 == 0 && patch.stride() <= kLongestLine,
                 "patch {}x{}, halo {}",
                 patch.width,
                 patch.height,
                 patch.halo);
#if defined(__x86_64__)
    if (set == InstructionSet::Avx512) return adaptAvx512(patch, blocks, threshold, adapted);
    if (set == InstructionSet::Avx2) return adaptAvx2(patch, blocks, threshold, adapted);
#endif
    adaptBase(patch, blocks, threshold, adapted);
}

}  // namespace insitu::tonemap
