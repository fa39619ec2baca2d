#include "evaluate/cortex_transform.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu::cortex {

namespace {

using std::numbers::pi;

/// Low pass that falls as a cosine around 2^-level, in units of half the sampling rate; the first
/// passes everything.
double mesa(int level, double radius)
{
    if (level == 0) return 1.0;
    const double half_amplitude = std::exp2(-level);
    const double width = 2.0 / 3.0 * half_amplitude;
    const double start = half_amplitude - 0.5 * width;
    if (radius <= start) return 1.0;
    if (radius >= start + width) return 0.0;
    return 0.5 * (1.0 + std::cos(pi * (radius - start) / width));
}

/// The base is a Gaussian, which does not ring.
double base(double radius)
{
    const double half_amplitude = std::exp2(-kOctaves);
    const double end = half_amplitude * (1.0 + 1.0 / 3.0);
    const double deviation = end / 3.0;
    return radius < end ? std::exp(-radius * radius / (2.0 * deviation * deviation)) : 0.0;
}

double octave(int k, double radius)
{
    const double low = k == kOctaves - 1 ? base(radius) : mesa(k + 1, radius);
    return mesa(k, radius) - low;
}

/// Cosine around its orientation, 0 from the neighbours' on.
double fan(int l, double angle)
{
    constexpr double kWidth = pi / kOrientations;
    double distance = std::fmod(std::abs(angle - l * kWidth), pi);
    distance = std::min(distance, pi - distance);
    return distance < kWidth ? 0.5 * (1.0 + std::cos(pi * distance / kWidth)) : 0.0;
}

}  // namespace

double bandWeight(int band, double x, double y)
{
    const double radius = 2.0 * std::hypot(x, y);
    if (band == kBands - 1) return base(radius);
    const double weight = octave(band / kOrientations, radius);
    return weight == 0.0 ? 0.0 : weight * fan(band % kOrientations, std::atan2(y, x));
}

}  // namespace insitu::cortex
