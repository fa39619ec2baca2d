#include "render/bsdf/ggx_albedo.h"

#include "lighting/sampling.h"
#include "render/bsdf/ggx.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace insitu::ggx {

namespace {

constexpr std::size_t kCosines = 32;
constexpr std::size_t kRoughnesses = 32;

using Row = std::array<Albedo, kCosines>;

/// Cosines are squares of equal steps: the albedo changes fastest near the horizon.
double cosineAt(std::size_t i)
{
    const double step = static_cast<double>(i) / (kCosines - 1);
    return std::max(1e-4, step * step);
}

Albedo mix(const Albedo& a, const Albedo& b, double t)
{
    return {a.at_f0 + t * (b.at_f0 - a.at_f0), a.at_f90 + t * (b.at_f90 - a.at_f90)};
}

/// Mean of the visible-normal sampler's weight G2/G1·F over a fixed low-discrepancy set (R2,
/// [Roberts18]), which gives the integral without bias from the lobe's width.
Albedo integrate(double alpha, double cosine)
{
    constexpr int kPoints = 512;
    const glm::dvec3 wo(std::sqrt(1.0 - cosine * cosine), 0.0, cosine);
    Albedo sum;
    for (int i = 0; i < kPoints; ++i) {
        const glm::dvec3 h = drawVisibleNormal(wo, alpha, r2Point(i));
        const double oh = glm::dot(wo, h);
        const glm::dvec3 wi = 2.0 * oh * h - wo;
        if (!(wi.z > 0.0)) continue;
        // f·cos/pdf = D·V·cos_i / (G1·D / (4 cos_o)).
        const double weight = visibility(wo, wi, alpha) * 4.0 * wo.z * wi.z / masking(wo, alpha);
        const double schlick = std::pow(std::clamp(1.0 - oh, 0.0, 1.0), 5.0);
        sum.at_f0 += weight * (1.0 - schlick) / kPoints;
        sum.at_f90 += weight * schlick / kPoints;
    }
    return sum;
}

/// ∫ 2c·albedo(c) dc with the albedo linear in sqrt(c) between nodes, as it is looked up:
/// with c = s², ∫ 4s³·albedo ds, by Simpson's rule, exact for that polynomial up to degree 3.
Albedo mean(const Row& row)
{
    Albedo sum;
    constexpr double kStep = 1.0 / (kCosines - 1);
    for (std::size_t i = 0; i + 1 < kCosines; ++i) {
        const double s0 = static_cast<double>(i) * kStep;
        const auto add = [&](double t, double weight) {
            const double s = s0 + t * kStep;
            const Albedo value = mix(row[i], row[i + 1], t);
            sum.at_f0 += weight * kStep * 4.0 * s * s * s * value.at_f0;
            sum.at_f90 += weight * kStep * 4.0 * s * s * s * value.at_f90;
        };
        add(0.0, 1.0 / 6.0);
        add(0.5, 4.0 / 6.0);
        add(1.0, 1.0 / 6.0);
    }
    return sum;
}

struct Table {
    std::array<Row, kRoughnesses> directional;
    std::array<Albedo, kRoughnesses> means;

    Table()
    {
        for (std::size_t r = 0; r < kRoughnesses; ++r) {
            const double roughness = static_cast<double>(r) / (kRoughnesses - 1);
            for (std::size_t c = 0; c < kCosines; ++c)
                directional[r][c] = integrate(alphaFromRoughness(roughness), cosineAt(c));
            means[r] = mean(directional[r]);
        }
    }
};

const Table& table()
{
    static const Table made;
    return made;
}

/// Cell and place in it of a value in [0, 1] on `nodes` equally spaced nodes.
struct Place {
    std::size_t cell = 0;
    double t = 0.0;
};
Place place(double value, std::size_t nodes)
{
    const double scaled = std::clamp(value, 0.0, 1.0) * static_cast<double>(nodes - 1);
    const std::size_t cell = std::min(static_cast<std::size_t>(scaled), nodes - 2);
    return {cell, scaled - static_cast<double>(cell)};
}

}  // namespace

double alphaFromRoughness(double roughness)
{
    return std::max(1e-4, roughness * roughness);
}

Albedo directionalAlbedo(double roughness, double cosine)
{
    const Place r = place(roughness, kRoughnesses);
    const Place c = place(std::sqrt(std::max(0.0, cosine)), kCosines);
    const auto& rows = table().directional;
    return mix(mix(rows[r.cell][c.cell], rows[r.cell][c.cell + 1], c.t),
               mix(rows[r.cell + 1][c.cell], rows[r.cell + 1][c.cell + 1], c.t),
               r.t);
}

Albedo meanAlbedo(double roughness)
{
    const Place r = place(roughness, kRoughnesses);
    return mix(table().means[r.cell], table().means[r.cell + 1], r.t);
}

}  // namespace insitu::ggx
