#include "composite/tonemap/patch_reader.h"

#include "composite/tonemap/line_steps.h"

#include <algorithm>

namespace insitu::tonemap {

namespace {

constexpr int roundedUp(int pixels)
{
    return (pixels + 3) / 4 * 4;
}

struct RowArguments {
    const Rgb* row;
    int first;  ///< column of the patch's first pixel, may be outside
    int width;  ///< of the picture
    float scale;
    float* even;
    float* odd;
    int columns;
    float* line;  ///< `columns` floats of scratch
};

INSITU_KERNEL void readRowAny(const RowArguments& a)
{
    // Outside, the border's pixels go on.
    const int inside_first = std::clamp(-a.first, 0, a.columns);
    const int inside_end = std::clamp(a.width - a.first, inside_first, a.columns);
    luminanceLine(&a.row[a.first + inside_first].r,
                  a.scale,
                  a.line + inside_first,
                  inside_end - inside_first);
    std::fill(a.line, a.line + inside_first, a.line[inside_first]);
    std::fill(a.line + inside_end, a.line + a.columns, a.line[inside_end - 1]);
    float* __restrict const even = a.even;
    float* __restrict const odd = a.odd;
    const float* const line = a.line;
    for (int i = 0; i < a.columns / 2; ++i) {
        even[i] = line[2 * i];
        odd[i] = line[2 * i + 1];
    }
}

struct WriteArguments {
    const Rgb* scene;
    const float* luminance;
    const float* display;
    float scale;
    std::ptrdiff_t half;
    int count;
    float* line;  ///< 2 half floats of scratch
    Rgb* out;
};

INSITU_KERNEL void writeRowAny(const WriteArguments& a)
{
    float* __restrict const gains = a.line;
    const std::ptrdiff_t half = a.half;
    for (std::ptrdiff_t i = 0; i < half; ++i) {
        const float even = a.luminance[i];
        const float odd = a.luminance[i + half];
        gains[2 * i] = a.scale * a.display[i] / (even > 0.0f ? even : 1.0f);
        gains[2 * i + 1] = a.scale * a.display[i + half] / (odd > 0.0f ? odd : 1.0f);
    }
    const float* const in = &a.scene->r;
    float* __restrict const out = &a.out->r;
    for (int x = 0; x < a.count; ++x)
        for (int c = 0; c < 3; ++c)
            out[3 * x + c] = std::min(in[3 * x + c] * gains[x], 1.0f);
}

void readRowBase(const RowArguments& a)
{
    readRowAny(a);
}
void writeRowBase(const WriteArguments& a)
{
    writeRowAny(a);
}
#if defined(__x86_64__)
INSITU_TARGET_AVX2 void readRowAvx2(const RowArguments& a)
{
    readRowAny(a);
}
INSITU_TARGET_AVX512 void readRowAvx512(const RowArguments& a)
{
    readRowAny(a);
}
INSITU_TARGET_AVX2 void writeRowAvx2(const WriteArguments& a)
{
    writeRowAny(a);
}
INSITU_TARGET_AVX512 void writeRowAvx512(const WriteArguments& a)
{
    writeRowAny(a);
}
#endif

void readRow(InstructionSet set, const RowArguments& a)
{
#if defined(__x86_64__)
    if (set == InstructionSet::Avx512) return readRowAvx512(a);
    if (set == InstructionSet::Avx2) return readRowAvx2(a);
#endif
    readRowBase(a);
}

}  // namespace

LuminancePatch readPatch(
    const SceneStrip& scene, int x0, int y0, int width, int height, int halo, float scale)
{
    LuminancePatch patch;
    patch.width = roundedUp(std::min(width, scene.width() - x0));
    patch.height = roundedUp(std::min(height, scene.height - y0));
    patch.halo = halo;
    const int rows = patch.height + 2 * halo;
    const int columns = patch.width + 2 * halo;
    // Not initialised: all is written below.
    patch.values.reset(
        new float[static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows)]);
    std::vector<float> line(static_cast<std::size_t>(columns));
    const InstructionSet set = bestInstructionSet();
    for (int row = 0; row < rows; ++row) {
        const int y = std::clamp(y0 - halo + row, 0, scene.height - 1);
        float* const even = patch.values.get() + row * patch.stride();
        readRow(set,
                {scene.row(y).data(),
                 x0 - halo,
                 scene.width(),
                 scale,
                 even,
                 even + patch.half(),
                 columns,
                 line.data()});
    }
    return patch;
}

void writeRow(
    const Rgb* scene, const RowResult& result, int count, std::vector<float>& line, Rgb* out)
{
    line.resize(2 * static_cast<std::size_t>(result.half));
    const WriteArguments a{scene,
                           result.luminance,
                           result.display,
                           result.scale,
                           result.half,
                           count,
                           line.data(),
                           out};
#if defined(__x86_64__)
    const InstructionSet set = bestInstructionSet();
    if (set == InstructionSet::Avx512) return writeRowAvx512(a);
    if (set == InstructionSet::Avx2) return writeRowAvx2(a);
#endif
    writeRowBase(a);
}

}  // namespace insitu::tonemap
