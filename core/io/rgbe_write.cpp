#include "core/check.h"
#include "core/io/byte_writer.h"
#include "core/io/radiance_formats.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

/// Nearest representable colour: the largest component gets a mantissa in [128, 255].
std::array<std::uint8_t, 4> rgbeOf(const Rgb& color)
{
    INSITU_CHECK(color.r >= 0.0f && color.g >= 0.0f && color.b >= 0.0f,
                 "({}, {}, {}) is negative",
                 color.r,
                 color.g,
                 color.b);
    const float largest = std::max({color.r, color.g, color.b});
    int exponent = 0;
    (void)std::frexp(largest, &exponent);
    // Rounding may reach 256: then the next exponent.
    if (std::round(std::ldexp(largest, 8 - exponent)) > 255.0f) ++exponent;
    if (largest <= 0.0f || exponent < -127) return {0, 0, 0, 0};
    const int stored = std::min(exponent, 127);
    const auto mantissa = [&](float value) {
        const float rounded = std::round(std::ldexp(value, 8 - stored));
        return static_cast<std::uint8_t>(std::min(rounded, 255.0f));
    };
    return {mantissa(color.r),
            mantissa(color.g),
            mantissa(color.b),
            static_cast<std::uint8_t>(stored + 128)};
}

/// Length of the run of equal bytes that begins at `at`, at most 127.
std::size_t runLength(std::span<const std::uint8_t> row, std::size_t at)
{
    std::size_t end = at + 1;
    while (end < row.size() && row[end] == row[at] && end - at < 127)
        ++end;
    return end - at;
}

/// One component of one row: runs of at least four, literal stretches of at most 128.
void appendRuns(Bytes& bytes, std::span<const std::uint8_t> row)
{
    constexpr std::size_t kShortestRun = 4;
    constexpr std::size_t kLongestLiteral = 128;
    std::size_t at = 0;
    while (at < row.size()) {
        std::size_t literal_end = at;
        std::size_t run = 0;
        while (literal_end < row.size()) {
            run = runLength(row, literal_end);
            if (run >= kShortestRun) break;
            literal_end += run;
            run = 0;
        }
        while (at < literal_end) {
            const std::size_t count = std::min(literal_end - at, kLongestLiteral);
            bytes.push_back(static_cast<std::uint8_t>(count));
            append(bytes, row.subspan(at, count));
            at += count;
        }
        if (run == 0) continue;
        bytes.push_back(static_cast<std::uint8_t>(128 + run));
        bytes.push_back(row[at]);
        at += run;
    }
}

}  // namespace

std::vector<std::uint8_t> encodeRgbe(const Image<Rgb>& image)
{
    const int width = image.width();
    const std::string header =
        fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", image.height(), width);
    Bytes bytes;
    append(bytes, header);
    const bool compressed = width >= 8 && width <= 0x7FFF;
    std::array<Bytes, 4> components;
    for (int y = 0; y < image.height(); ++y) {
        for (Bytes& component : components)
            component.clear();
        for (const Rgb& pixel : image.row(y)) {
            const auto rgbe = rgbeOf(pixel);
            if (!compressed) append(bytes, rgbe);
            for (std::size_t c = 0; c < 4 && compressed; ++c)
                components[c].push_back(rgbe[c]);
        }
        if (!compressed) continue;
        append16(bytes, 0x0202);
        append16(bytes, static_cast<std::uint32_t>(width));
        for (const Bytes& component : components)
            appendRuns(bytes, component);
    }
    return bytes;
}

}  // namespace insitu
