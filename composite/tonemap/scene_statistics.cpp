#include "composite/tonemap/scene_statistics.h"

#include "composite/tonemap/line_steps.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace insitu {

namespace {

/// Partial sums: several, so that additions need not wait for each other; the same number for every
/// instruction set, so that all give the same sum.
constexpr std::size_t kParts = 16;
constexpr std::ptrdiff_t kBlock = 1024;

/// What one row holds; rows are added in order, so that threads do not matter.
struct RowSums {
    double sum = 0.0;
    double log_sum = 0.0;
    float smallest = std::numeric_limits<float>::infinity();
    float largest = 0.0f;
    bool good = true;  ///< all finite and >= 0
};

struct RowJob {
    const float* rgb;
    std::ptrdiff_t pixels;
    float delta;  ///< of the logarithms
    RowSums& sums;
};

INSITU_KERNEL double sumOf(const float* values, std::ptrdiff_t count)
{
    double parts[kParts] = {};
    std::ptrdiff_t i = 0;
    for (; i + static_cast<std::ptrdiff_t>(kParts) <= count; i += kParts)
        for (std::size_t k = 0; k < kParts; ++k)
            parts[k] += static_cast<double>(values[i + static_cast<std::ptrdiff_t>(k)]);
    double sum = 0.0;
    for (const double part : parts)
        sum += part;
    for (; i < count; ++i)
        sum += static_cast<double>(values[i]);
    return sum;
}

/// Extends [least, most] to all values but NaN.
INSITU_KERNEL void measureBlock(const float* values,
                                std::ptrdiff_t count,
                                float& least,
                                float& most)
{
    float low[kParts];
    float high[kParts];
    std::fill_n(low, kParts, least);
    std::fill_n(high, kParts, most);
    const auto extend = [&](std::size_t k, float value) {
        low[k] = value < low[k] ? value : low[k];
        high[k] = value > high[k] ? value : high[k];
    };
    std::ptrdiff_t i = 0;
    for (; i + static_cast<std::ptrdiff_t>(kParts) <= count; i += kParts)
        for (std::size_t k = 0; k < kParts; ++k)
            extend(k, values[i + static_cast<std::ptrdiff_t>(k)]);
    for (; i < count; ++i)
        extend(0, values[i]);
    least = *std::min_element(low, low + kParts);
    most = *std::max_element(high, high + kParts);
}

INSITU_KERNEL void sumRowAny(const RowJob& job)
{
    float line[kBlock];
    float low = std::numeric_limits<float>::infinity();
    float high = 0.0f;
    for (std::ptrdiff_t first = 0; first < job.pixels; first += kBlock) {
        const std::ptrdiff_t count = std::min(kBlock, job.pixels - first);
        tonemap::luminanceLine(job.rgb + 3 * first, 1.0f, line, count);
        measureBlock(job.rgb + 3 * first, 3 * count, low, high);
        measureBlock(line, count, job.sums.smallest, job.sums.largest);
        job.sums.sum += sumOf(line, count);
    }
    // NaN hides from comparisons but not from the sum.
    job.sums.good =
        !(low < 0.0f) && high <= std::numeric_limits<float>::max() && std::isfinite(job.sums.sum);
}

INSITU_KERNEL void sumLogsAny(const RowJob& job)
{
    float line[kBlock];
    for (std::ptrdiff_t first = 0; first < job.pixels; first += kBlock) {
        const std::ptrdiff_t count = std::min(kBlock, job.pixels - first);
        tonemap::luminanceLine(job.rgb + 3 * first, 1.0f, line, count);
        for (std::ptrdiff_t i = 0; i < count; ++i)
            line[i] = tonemap::logOf(line[i] + job.delta);
        job.sums.log_sum += sumOf(line, count);
    }
}

enum class Pass { Values, Logarithms };

INSITU_KERNEL void runAny(Pass pass, const RowJob& job)
{
    if (pass == Pass::Values)
        sumRowAny(job);
    else
        sumLogsAny(job);
}
void runBase(Pass pass, const RowJob& job)
{
    runAny(pass, job);
}
#if defined(__x86_64__)
INSITU_TARGET_AVX2 void runAvx2(Pass pass, const RowJob& job)
{
    runAny(pass, job);
}
INSITU_TARGET_AVX512 void runAvx512(Pass pass, const RowJob& job)
{
    runAny(pass, job);
}
#endif

void overRows(Pass pass, const Image<Rgb>& scene, float delta, std::vector<RowSums>& rows)
{
    parallelFor(0, scene.height(), [&](std::int64_t y) {
        const auto row = scene.row(static_cast<int>(y));
        const RowJob job{&row.front().r,
                         static_cast<std::ptrdiff_t>(row.size()),
                         delta,
                         rows[static_cast<std::size_t>(y)]};
#if defined(__x86_64__)
        const InstructionSet set = bestInstructionSet();
        if (set == InstructionSet::Avx512) return runAvx512(pass, job);
        if (set == InstructionSet::Avx2) return runAvx2(pass, job);
#endif
        runBase(pass, job);
    });
}

[[noreturn]] void refuse(const SceneStrip& scene, int y)
{
    for (int x = 0; x < scene.width(); ++x) {
        const Rgb& pixel = scene(x, y);
        for (int c = 0; c < 3; ++c)
            if (!std::isfinite(pixel[c]) || pixel[c] < 0.0f)
                throw InputError("tone mapping",
                                 fmt::format("pixel ({}, {})", x, y),
                                 fmt::format("{} is not a finite colour >= 0", pixel[c]));
    }
    throw InputError("tone mapping", fmt::format("row {}", y), "the luminance is too large");
}

}  // namespace

void SceneMeter::gather(int pass, const SceneStrip& strip)
{
    std::vector<RowSums> rows(static_cast<std::size_t>(strip.rows.height()));
    if (pass == 1) {
        if (statistics_.largest == 0.0) return;
        overRows(Pass::Logarithms, strip.rows, static_cast<float>(1e-6 * statistics_.mean), rows);
        for (const RowSums& row : rows)
            sum_ += row.log_sum;
        return;
    }
    overRows(Pass::Values, strip.rows, 0.0f, rows);
    if (statistics_.pixels == 0) statistics_.smallest = std::numeric_limits<double>::infinity();
    statistics_.pixels += static_cast<std::int64_t>(strip.rows.pixelCount());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const RowSums& row = rows[i];
        if (!row.good) refuse(strip, strip.first + static_cast<int>(i));
        statistics_.smallest = std::min(statistics_.smallest, static_cast<double>(row.smallest));
        statistics_.largest = std::max(statistics_.largest, static_cast<double>(row.largest));
        sum_ += row.sum;
    }
}

void SceneMeter::endPass(int pass)
{
    const auto pixels = static_cast<double>(statistics_.pixels);
    if (pass == 0)
        statistics_.mean = sum_ / pixels;
    else if (statistics_.largest > 0.0)
        statistics_.log_average = std::exp(sum_ / pixels);
    sum_ = 0.0;
}

SceneStatistics measureScene(const Image<Rgb>& scene)
{
    if (scene.empty()) return {};
    SceneMeter meter;
    for (int pass = 0; pass < SceneMeter::kPasses; ++pass) {
        meter.gather(pass, SceneStrip(scene));
        meter.endPass(pass);
    }
    return meter.statistics();
}

SceneStatistics SceneStatistics::joined(const SceneStatistics& other) const
{
    if (pixels == 0) return other;
    if (other.pixels == 0) return *this;
    const double share = static_cast<double>(pixels) / static_cast<double>(pixels + other.pixels);
    SceneStatistics both;
    both.pixels = pixels + other.pixels;
    both.smallest = std::min(smallest, other.smallest);
    both.largest = std::max(largest, other.largest);
    both.mean = share * mean + (1.0 - share) * other.mean;
    if (log_average == 0.0 || other.log_average == 0.0)
        both.log_average =
            std::max(log_average, other.log_average);  // a black picture says nothing
    else
        both.log_average =
            std::exp(share * std::log(log_average) + (1.0 - share) * std::log(other.log_average));
    return both;
}

}  // namespace insitu
