#pragma once

#include "core/color.h"
#include "core/instruction_set.h"

#include <bit>
#include <cstddef>
#include <cstdint>

/// Arithmetic for vector loops over lines of pixels; inlined, so that each instruction set gets its
/// own. Private to this module.
namespace insitu::tonemap {

/// Natural logarithm, x > 0 normal; relative error below 3e-7 (absolute where the result is near
/// 0), which a test holds against the library's. x = 0 gives about -88. Source: minimax polynomial
/// of [Moshier89], Cephes logf, on [sqrt(1/2), sqrt(2)).
INSITU_KERNEL float logOf(float x)
{
    const auto bits = std::bit_cast<std::int32_t>(x);
    const std::int32_t exponent = (bits - 0x3f3504f3) >> 23;  // sqrt(1/2)
    const float f = std::bit_cast<float>(bits - exponent * (1 << 23)) - 1.0f;
    float p = 7.0376836292e-2f;
    p = p * f - 1.1514610310e-1f;
    p = p * f + 1.1676998740e-1f;
    p = p * f - 1.2420140846e-1f;
    p = p * f + 1.4249322787e-1f;
    p = p * f - 1.6668057665e-1f;
    p = p * f + 2.0000714765e-1f;
    p = p * f - 2.4999993993e-1f;
    p = p * f + 3.3333331174e-1f;
    const float e = static_cast<float>(exponent);
    // ln 2 in two parts, so that the large product is exact.
    return (f + (f * f * (p * f - 0.5f) + e * -2.12194440e-4f)) + e * 0.693359375f;
}

/// Luminance of `count` colours, three floats each, times `scale`.
INSITU_KERNEL void luminanceLine(const float* rgb,
                                 float scale,
                                 float* __restrict out,
                                 std::ptrdiff_t count)
{
    for (std::ptrdiff_t i = 0; i < count; ++i)
        out[i] =
            scale * (kLuminanceWeights[0] * rgb[3 * i] + kLuminanceWeights[1] * rgb[3 * i + 1] +
                     kLuminanceWeights[2] * rgb[3 * i + 2]);
}

/// Symmetric filter of radius kRadius over neighbours `step` floats apart; kernel[0] is the middle.
template <int kRadius>
INSITU_KERNEL void filterLine(const float* in,
                              std::ptrdiff_t step,
                              const float* kernel,
                              float* __restrict out,
                              std::ptrdiff_t count)
{
    for (std::ptrdiff_t i = 0; i < count; ++i) {
        const float* const middle = in + i;
        float sum = kernel[0] * middle[0];
#pragma GCC unroll 16
        for (int k = 1; k <= kRadius; ++k)
            sum += kernel[k] * (middle[-k * step] + middle[k * step]);
        out[i] = sum;
    }
}

/// The same along a row whose columns are sorted by parity, for its even columns; for its odd ones
/// they change places: filterEven(odd, even + 1, ...).
template <int kRadius>
INSITU_KERNEL void filterEven(const float* even,
                              const float* odd,
                              const float* kernel,
                              float* __restrict out,
                              std::ptrdiff_t count)
{
    for (std::ptrdiff_t i = 0; i < count; ++i) {
        float sum = kernel[0] * even[i];
#pragma GCC unroll 16
        for (int k = 1; k <= kRadius; ++k) {
            const int m = k / 2;
            sum +=
                kernel[k] * (k % 2 == 0 ? even[i - m] + even[i + m] : odd[i - m - 1] + odd[i + m]);
        }
        out[i] = sum;
    }
}

/// Half-way between in[0] and in[step], from kReach neighbours on either side; kernel[0] is for the
/// nearest.
template <int kReach>
INSITU_KERNEL void midpointLine(const float* in,
                                std::ptrdiff_t step,
                                const float* kernel,
                                float* __restrict out,
                                std::ptrdiff_t count)
{
    for (std::ptrdiff_t i = 0; i < count; ++i) {
        const float* const p = in + i;
        float sum = kernel[0] * (p[0] + p[step]);
#pragma GCC unroll 16
        for (int k = 1; k < kReach; ++k)
            sum += kernel[k] * (p[-k * step] + p[(k + 1) * step]);
        out[i] = sum;
    }
}

}  // namespace insitu::tonemap
