#include "composite/tonemap/neighbourhood_kernel.h"
#include "core/check.h"

#include <cmath>

namespace insitu::tonemap {

namespace {

/// Sampled Gaussian, normalised to sum 1 over the whole kernel.
Kernel gaussian(double variance, int radius)
{
    std::array<double, 16> weights{};
    double sum = 0.0;
    for (int k = 0; k <= radius; ++k) {
        weights[static_cast<std::size_t>(k)] = std::exp(-0.5 * k * k / variance);
        sum += (k == 0 ? 1.0 : 2.0) * weights[static_cast<std::size_t>(k)];
    }
    Kernel kernel{};
    for (std::size_t k = 0; k < kernel.size(); ++k)
        kernel[k] = static_cast<float>(weights[k] / sum);
    return kernel;
}

/// Midpoint from its neighbours that errs least, in the mean over white noise blurred with the
/// level's narrowest Gaussian (standard deviation 1.5), and is exact for constants: the best linear
/// unbiased estimate with covariance exp(-d² / (4·1.5²)). By symmetry one weight for each two
/// neighbours, and one Lagrange multiplier.
Kernel midpointKernel()
{
    constexpr std::size_t kWeights = kMidpointReach;
    constexpr std::size_t kUnknowns = kWeights + 1;
    constexpr double kDeviation = 1.5;
    const auto covariance = [](double d) {
        return std::exp(-d * d / (4.0 * kDeviation * kDeviation));
    };
    std::array<std::array<double, kUnknowns + 1>, kUnknowns> rows{};
    for (std::size_t i = 0; i < kWeights; ++i) {
        const double a = 0.5 + static_cast<double>(i);
        for (std::size_t j = 0; j < kWeights; ++j) {
            const double b = 0.5 + static_cast<double>(j);
            rows[i][j] = covariance(a - b) + covariance(a + b);
        }
        rows[i][kWeights] = 1.0;
        rows[i][kUnknowns] = covariance(a);
        rows[kWeights][i] = 2.0;
    }
    rows[kWeights][kUnknowns] = 1.0;
    // Gauss-Jordan with the largest pivot.
    for (std::size_t c = 0; c < kUnknowns; ++c) {
        std::size_t pivot = c;
        for (std::size_t r = c + 1; r < kUnknowns; ++r)
            if (std::abs(rows[r][c]) > std::abs(rows[pivot][c])) pivot = r;
        std::swap(rows[c], rows[pivot]);
        for (std::size_t r = 0; r < kUnknowns; ++r) {
            if (r == c) continue;
            const double factor = rows[r][c] / rows[c][c];
            for (std::size_t k = c; k <= kUnknowns; ++k)
                rows[r][k] -= factor * rows[c][k];
        }
    }
    Kernel kernel{};
    for (std::size_t i = 0; i < kWeights; ++i)
        kernel[i] = static_cast<float>(rows[i][kUnknowns] / rows[i][i]);
    return kernel;
}

NeighbourhoodKernels makeKernels()
{
    NeighbourhoodKernels kernels;
    for (std::size_t i = 0; i < kFineScales; ++i) {
        const double deviation = 0.5 * static_cast<double>(i + 1);
        kernels.fine[i] = gaussian(deviation * deviation, kFineRadius[i]);
    }
    for (std::size_t i = 0; i < kCoarseScales; ++i) {
        const double deviation = 1.5 + 0.25 * static_cast<double>(i);
        kernels.coarse[i] = gaussian(deviation * deviation - 1.0, kCoarseRadius[i]);
    }
    kernels.reduce = gaussian(4.0, kReduceRadius);
    kernels.midpoint = midpointKernel();
    return kernels;
}

}  // namespace

const NeighbourhoodKernels& neighbourhoodKernels()
{
    static const NeighbourhoodKernels kernels = makeKernels();
    return kernels;
}

}  // namespace insitu::tonemap
