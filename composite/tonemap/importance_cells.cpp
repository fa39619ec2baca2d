#include "composite/tonemap/importance_cells.h"

#include "composite/tonemap/line_steps.h"
#include "core/check.h"

#include <algorithm>

namespace insitu::tonemap {

namespace {

/// Keeps log(0) finite; cd/m² or scaled units, far below what either part can tell from black.
constexpr float kBlack = 1e-6f;

/// Logarithms of a row of the patch: even columns, then odd ones.
struct LogRow {
    std::vector<float> even;
    std::vector<float> odd;
};

/// Gradients of the row between three others, squared, joined to what a row of cells holds so far.
/// From column `first` (even) on; `best` takes the largest of each two columns.
INSITU_KERNEL void sobelRow(const std::array<LogRow, 3>& rows,
                            std::size_t middle,
                            float* __restrict best,
                            std::ptrdiff_t count)
{
    const LogRow& above = rows[(middle + 2) % 3];
    const LogRow& centre = rows[middle % 3];
    const LogRow& below = rows[(middle + 1) % 3];
    const auto squared =
        [](float tl, float t, float tr, float l, float r, float bl, float b, float br) {
            const float gx = (tr - tl) + 2.0f * (r - l) + (br - bl);
            const float gy = (bl - tl) + 2.0f * (b - t) + (br - tr);
            return gx * gx + gy * gy;
        };
    const float* const ae = above.even.data() + 1;
    const float* const ao = above.odd.data() + 1;
    const float* const ce = centre.even.data() + 1;
    const float* const co = centre.odd.data() + 1;
    const float* const be = below.even.data() + 1;
    const float* const bo = below.odd.data() + 1;
    for (std::ptrdiff_t i = 0; i < count; ++i) {
        const float at_even =
            squared(ao[i - 1], ae[i], ao[i], co[i - 1], co[i], bo[i - 1], be[i], bo[i]);
        const float at_odd =
            squared(ae[i], ao[i], ae[i + 1], ce[i], ce[i + 1], be[i], bo[i], be[i + 1]);
        const float both = at_even > at_odd ? at_even : at_odd;
        best[i] = both > best[i] ? both : best[i];
    }
}

INSITU_KERNEL void logLine(const float* in, float* __restrict out, std::ptrdiff_t count)
{
    for (std::ptrdiff_t i = 0; i < count; ++i)
        out[i] = logOf(in[i] + kBlack);
}

INSITU_KERNEL void markAny(const LuminancePatch& patch, float threshold, Cells& cells)
{
    constexpr int kMargin = Cells::kMargin;
    const std::ptrdiff_t pairs = 2 * cells.stride();  // two to a cell
    const auto length = static_cast<std::size_t>(pairs) + 2;
    std::array<LogRow, 3> rows;
    for (LogRow& row : rows)
        row = {std::vector<float>(length), std::vector<float>(length)};
    const auto load = [&](int y) {
        LogRow& row = rows[static_cast<std::size_t>(y + 3 * patch.halo) % 3];
        const std::ptrdiff_t start = -2 * kMargin - 1;
        logLine(patch.even(y) + start, row.even.data(), pairs + 2);
        logLine(patch.odd(y) + start, row.odd.data(), pairs + 2);
    };
    std::vector<float> best(static_cast<std::size_t>(pairs));
    const int first = -kMargin * Cells::kSize;
    load(first - 1);
    load(first);
    for (int cell_row = -kMargin; cell_row < cells.rows + kMargin; ++cell_row) {
        std::fill(best.begin(), best.end(), 0.0f);
        for (int k = 0; k < Cells::kSize; ++k) {
            const int y = cell_row * Cells::kSize + k;
            load(y + 1);
            sobelRow(rows, static_cast<std::size_t>(y + 3 * patch.halo) % 3, best.data(), pairs);
        }
        float* const cell = cells.row(cell_row) - kMargin;
        for (int i = 0; i < cells.stride(); ++i)
            if (std::max(best[2 * i], best[2 * i + 1]) > threshold * threshold) cell[i] = 1.0f;
    }
}

void markBase(const LuminancePatch& patch, float threshold, Cells& cells)
{
    markAny(patch, threshold, cells);
}
#if defined(__x86_64__)
INSITU_TARGET_AVX2 void markAvx2(const LuminancePatch& patch, float threshold, Cells& cells)
{
    markAny(patch, threshold, cells);
}
INSITU_TARGET_AVX512 void markAvx512(const LuminancePatch& patch, float threshold, Cells& cells)
{
    markAny(patch, threshold, cells);
}
#endif

/// Largest value, or mean, of 2 reach + 1 cells, along rows and then columns.
template <class Combine>
void overNeighbours(Cells& cells, int reach, const Combine& combine)
{
    const int height = cells.rows + 2 * Cells::kMargin;
    const int width = cells.stride();
    std::vector<float> passed(cells.values.size());
    std::vector<float> line(static_cast<std::size_t>(width + 2 * reach));
    const auto join = [&](float* __restrict to, const float* from) {
        for (int x = 0; x < width; ++x)
            to[x] = combine(to[x], from[x]);
    };
    for (int y = 0; y < height; ++y) {
        const float* const row = cells.values.data() + y * width;
        for (int i = 0; i < std::ssize(line); ++i)
            line[static_cast<std::size_t>(i)] = row[std::clamp(i - reach, 0, width - 1)];
        for (int k = 0; k <= 2 * reach; ++k)
            join(passed.data() + y * width, line.data() + k);
    }
    std::ranges::fill(cells.values, 0.0f);
    for (int y = 0; y < height; ++y)
        for (int k = -reach; k <= reach; ++k)
            join(cells.values.data() + y * width,
                 passed.data() + std::clamp(y + k, 0, height - 1) * width);
}

}  // namespace

void markEdges(const LuminancePatch& patch, float threshold, Cells& cells)
{
    INSITU_CHECK(patch.halo >= Cells::kHalo, "halo {}", patch.halo);
#if defined(__x86_64__)
    const InstructionSet set = bestInstructionSet();
    if (set == InstructionSet::Avx512) return markAvx512(patch, threshold, cells);
    if (set == InstructionSet::Avx2) return markAvx2(patch, threshold, cells);
#endif
    markBase(patch, threshold, cells);
}

void spreadCells(Cells& cells)
{
    overNeighbours(cells, Cells::kSpread, [](float a, float b) { return std::max(a, b); });
    constexpr float kShare = 1.0f / (2 * Cells::kBlend - 1);
    overNeighbours(cells, Cells::kBlend - 1, [](float a, float b) { return a + kShare * b; });
}

WantedBlocks weighPixels(const Cells& cells, int width, int height, float* weights)
{
    WantedBlocks blocks;
    blocks.columns = (width + WantedBlocks::kWidth - 1) / WantedBlocks::kWidth;
    const int block_rows = (height + WantedBlocks::kHeight - 1) / WantedBlocks::kHeight;
    blocks.wanted.assign(
        static_cast<std::size_t>(blocks.columns) * static_cast<std::size_t>(block_rows), 0);
    constexpr int kSize = Cells::kSize;
    std::vector<float> line(static_cast<std::size_t>(cells.columns) + 2);
    for (int y = 0; y < height; ++y) {
        // Centres of cells lie at multiples of 4 plus 2, of pixels at plus 0.5.
        const int cell_y = (y + kSize / 2) / kSize - 1;
        const float ty = (static_cast<float>((y + kSize / 2) % kSize) + 0.5f) / kSize;
        const float* const above = cells.row(cell_y) - 1;
        const float* const below = cells.row(cell_y + 1) - 1;
        for (std::size_t i = 0; i < line.size(); ++i)
            line[i] = above[i] + ty * (below[i] - above[i]);
        float* const even = weights + static_cast<std::ptrdiff_t>(y) * width;
        float* const odd = even + width / 2;
        for (int cell = 0; cell < cells.columns; ++cell) {
            const float before = line[static_cast<std::size_t>(cell)];
            const float here = line[static_cast<std::size_t>(cell) + 1];
            const float after = line[static_cast<std::size_t>(cell) + 2];
            even[2 * cell] = before + 0.625f * (here - before);
            odd[2 * cell] = before + 0.875f * (here - before);
            even[2 * cell + 1] = here + 0.125f * (after - here);
            odd[2 * cell + 1] = here + 0.375f * (after - here);
            if (before + here + after > 0.0f)
                blocks.wanted[static_cast<std::size_t>(y / WantedBlocks::kHeight * blocks.columns +
                                                       cell * kSize / WantedBlocks::kWidth)] = 1;
        }
    }
    return blocks;
}

}  // namespace insitu::tonemap
