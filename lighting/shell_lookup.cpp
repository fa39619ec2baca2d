#include "lighting/shell_lookup.h"

#include "core/check.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>

namespace insitu::fiv {

namespace {

using std::numbers::pi;

/// Places whose corners are found together, for the compiler's vectors.
constexpr int kBatch = 32;

/// A node and the first third of the next one, which counts nothing.
using Vector16 = float __attribute__((vector_size(64)));
using Vector4 = float __attribute__((vector_size(16)));

/// atan2 in units of a full turn, [0, 1), off by 2e-7: a polynomial on the octant next to +x.
/// Source: [AbrSte64] 4.4.49, eight terms.
INSITU_KERNEL float turnOf(float x, float z)
{
    const float ax = std::abs(x);
    const float az = std::abs(z);
    const float most = ax > az ? ax : az;
    const float least = ax > az ? az : ax;
    const float t = least / (most > 1e-30f ? most : 1e-30f);
    const float s = t * t;
    float angle = -0.0161657367f + s * 0.0028662257f;
    angle = 0.0429096138f + s * angle;
    angle = -0.0752896400f + s * angle;
    angle = 0.1065626393f + s * angle;
    angle = -0.1420889944f + s * angle;
    angle = 0.1999355085f + s * angle;
    angle = -0.3333314528f + s * angle;
    angle = (1.0f + s * angle) * t * static_cast<float>(0.5 / pi);
    angle = az > ax ? 0.25f - angle : angle;
    angle = x < 0.0f ? 0.5f - angle : angle;
    angle = z < 0.0f ? 1.0f - angle : angle;
    return angle;
}

/// log2 of a normal number > 0, off by 2e-7: of the mantissa m in [√½, √2) by the series of
/// 2 artanh((m − 1)/(m + 1)), five terms.
INSITU_KERNEL float binaryLogarithm(float value)
{
    constexpr std::int32_t kRootHalf = 0x3f3504f3;
    const std::int32_t bits = std::bit_cast<std::int32_t>(value);
    const std::int32_t exponent = (bits - kRootHalf) >> 23;
    const float m = std::bit_cast<float>(bits - exponent * (1 << 23));
    const float s = (m - 1.0f) / (m + 1.0f);
    const float q = s * s;
    float series = 1.0f / 7.0f + q * (1.0f / 9.0f);
    series = 1.0f / 5.0f + q * series;
    series = 1.0f / 3.0f + q * series;
    series = 1.0f + q * series;
    constexpr float kTwoOverLn2 = 2.8853900818f;
    return static_cast<float>(exponent) + kTwoOverLn2 * s * series;
}

/// floor of a number >= 0, no more than `last`.
INSITU_KERNEL std::int32_t cellOf(float value, std::int32_t last)
{
    const auto cell = static_cast<std::int32_t>(value);
    return cell < last ? cell : last;
}

struct Lookup {
    std::int32_t node;
    float azimuth, polar, shell;  ///< parts of a cell
    float fall;
};

INSITU_KERNEL Lookup lookUp(const ShellGrid& grid, float x, float y, float z)
{
    const float across = std::sqrt(x * x + z * z);
    const float distance = std::sqrt(x * x + y * y + z * z);
    float clamped = distance < grid.first ? grid.first : distance;
    clamped = clamped > grid.last ? grid.last : clamped;
    const float azimuth = turnOf(x, z) * static_cast<float>(grid.azimuths);
    const float polar = 2.0f * turnOf(y, across) * static_cast<float>(grid.polars - 1);
    float shell = binaryLogarithm(clamped / grid.first) * grid.shells_an_octave;
    shell = shell < 0.0f ? 0.0f : shell;
    const std::int32_t i = cellOf(azimuth, grid.azimuths - 1);
    const std::int32_t j = cellOf(polar, grid.polars - 2);
    const std::int32_t k = cellOf(shell, grid.shells - 2);
    // The object's solid angle falls with the square of its distance.
    const float ratio = clamped / (distance > grid.first ? distance : grid.first);
    return {(k * grid.polars + j) * (grid.azimuths + 1) + i,
            azimuth - static_cast<float>(i),
            polar - static_cast<float>(j),
            shell - static_cast<float>(k),
            ratio * ratio};
}

INSITU_KERNEL void weigh(const Lookup& at, float* weights, int stride)
{
    for (int corner = 0; corner < 8; ++corner) {
        const float a = (corner & 1) != 0 ? at.azimuth : 1.0f - at.azimuth;
        const float b = (corner & 2) != 0 ? at.polar : 1.0f - at.polar;
        const float c = (corner & 4) != 0 ? at.shell : 1.0f - at.shell;
        weights[corner * stride] = at.fall * a * b * c;
    }
}

/// Everything that a look-up needs of its field.
struct Field {
    const ShellGrid& grid;
    const ShellNode* nodes;
    glm::vec3 half_extent;
};

/// Up to kBatch places.
INSITU_KERNEL void lookUpBatch(
    const Field& field, const glm::vec3* places, const glm::vec3* normals, Rgb* hidden, int count)
{
    alignas(64) float x[kBatch], y[kBatch], z[kBatch];
    alignas(64) float nx[kBatch], ny[kBatch], nz[kBatch];
    alignas(64) float share[kBatch], weights[8][kBatch];
    alignas(64) std::int32_t node[kBatch];
    for (int i = 0; i < kBatch; ++i) {
        const int from = i < count ? i : count - 1;
        x[i] = places[from].x;
        y[i] = places[from].y;
        z[i] = places[from].z;
        nx[i] = normals[from].x;
        ny[i] = normals[from].y;
        nz[i] = normals[from].z;
    }
    const glm::vec3 half = field.half_extent;
    for (int i = 0; i < kBatch; ++i) {
        // Height of the object's centre over the place's plane, in its half extents along the
        // normal: d / R of the thesis.
        const float extent =
            half.x * std::abs(nx[i]) + half.y * std::abs(ny[i]) + half.z * std::abs(nz[i]);
        const float height = -(x[i] * nx[i] + y[i] * ny[i] + z[i] * nz[i]) / extent;
        float part = 0.5f * (height + 1.0f);
        part = part > 0.0f ? part : 0.0f;
        share[i] = part < 1.0f ? part : 1.0f;
        const Lookup at = lookUp(field.grid, x[i], y[i], z[i]);
        node[i] = at.node;
        weigh(at, &weights[0][i], kBatch);
    }
    const std::ptrdiff_t row = field.grid.row();
    const std::ptrdiff_t sphere = field.grid.sphere();
    const std::ptrdiff_t steps[8] = {
        0, 1, row, row + 1, sphere, sphere + 1, sphere + row, sphere + row + 1};
    for (int i = 0; i < count; ++i) {
        Vector16 sum{};
        for (int corner = 0; corner < 8; ++corner) {
            Vector16 value;
            std::memcpy(&value, field.nodes + node[i] + steps[corner], sizeof(value));
            sum += weights[corner][i] * value;
        }
        Vector4 axis[4];
        std::memcpy(axis, &sum, sizeof(axis));
        const Vector4 light = share[i] * (axis[0] * nx[i] + axis[1] * ny[i] + axis[2] * nz[i]);
        for (int c = 0; c < 3; ++c)
            hidden[i][c] = light[c] > 0.0f ? light[c] : 0.0f;
    }
}

INSITU_KERNEL void lookUpAll(const Field& field,
                             std::span<const glm::vec3> places,
                             std::span<const glm::vec3> normals,
                             std::span<Rgb> hidden)
{
    for (std::size_t i = 0; i < places.size(); i += kBatch)
        lookUpBatch(field,
                    &places[i],
                    &normals[i],
                    &hidden[i],
                    static_cast<int>(std::min<std::size_t>(kBatch, places.size() - i)));
}

void lookUpBase(const Field& field,
                std::span<const glm::vec3> places,
                std::span<const glm::vec3> normals,
                std::span<Rgb> hidden)
{
    lookUpAll(field, places, normals, hidden);
}

#if defined(__x86_64__)
INSITU_TARGET_AVX2 void lookUpAvx2(const Field& field,
                                   std::span<const glm::vec3> places,
                                   std::span<const glm::vec3> normals,
                                   std::span<Rgb> hidden)
{
    lookUpAll(field, places, normals, hidden);
}

INSITU_TARGET_AVX512 void lookUpAvx512(const Field& field,
                                       std::span<const glm::vec3> places,
                                       std::span<const glm::vec3> normals,
                                       std::span<Rgb> hidden)
{
    lookUpAll(field, places, normals, hidden);
}
#endif

}  // namespace

ShellCorners shellCorners(const ShellGrid& grid, glm::vec3 place)
{
    const Lookup at = lookUp(grid, place.x, place.y, place.z);
    ShellCorners corners{at.node, {}};
    weigh(at, corners.weights.data(), 1);
    return corners;
}

void lookUpShells(InstructionSet isa,
                  const ShellGrid& grid,
                  std::span<const ShellNode> nodes,
                  glm::vec3 half_extent,
                  std::span<const glm::vec3> places,
                  std::span<const glm::vec3> normals,
                  std::span<Rgb> hidden)
{
    INSITU_CHECK(places.size() == hidden.size() && places.size() == normals.size(),
                 "{} and {} for {}",
                 hidden.size(),
                 normals.size(),
                 places.size());
    INSITU_CHECK(nodes.size() > static_cast<std::size_t>(grid.sphere()) *
                                    static_cast<std::size_t>(grid.shells),
                 "{} nodes",
                 nodes.size());
    if (places.empty()) return;
    const Field field{grid, nodes.data(), half_extent};
#if defined(__x86_64__)
    if (isa == InstructionSet::Avx512) return lookUpAvx512(field, places, normals, hidden);
    if (isa == InstructionSet::Avx2) return lookUpAvx2(field, places, normals, hidden);
#endif
    lookUpBase(field, places, normals, hidden);
}

}  // namespace insitu::fiv
