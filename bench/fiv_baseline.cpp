#include "bench/fiv_baseline.h"

#include "core/parallel.h"
#include "lighting/silhouettes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>

namespace insitu::baseline {

using std::numbers::pi;

namespace {

/// Looking from a sphere's outside: the cosine of the cone's half angle; -1 from within.
double coneCosine(double distance, double radius)
{
    if (distance <= radius) return -1.0;
    return std::sqrt(1.0 - radius * radius / (distance * distance));
}

IrradianceVector vectorOf(Rgb power, glm::dvec3 direction)
{
    const glm::vec3 d(direction);
    return {{power.r * d, power.g * d, power.b * d}};
}

Rgb atLeastZero(Rgb value)
{
    return glm::max(value, Rgb(0.0f));
}

}  // namespace

glm::dvec3 TexelLight::direction(std::size_t texel) const
{
    return cells.direction(texel / 2) * (texel % 2 == 0 ? 1.0 : -1.0);
}

IrradianceVector TexelLight::total() const
{
    return asCellLight().total();
}

CellLight TexelLight::asCellLight() const
{
    CellLight light;
    for (std::size_t texel = 0; texel < radiance.size(); ++texel) {
        const auto solid_angle = static_cast<float>(cells.solidAngle(texel / 2));
        (texel % 2 == 0 ? light.along : light.against)
            .push_back(vectorOf(radiance[texel] * solid_angle, direction(texel)));
    }
    return light;
}

TexelLight texelLight(const EnvironmentMap& environment, int face_size)
{
    TexelLight light{{face_size}, {}};
    const CellLight split =
        splitLight(environment, glm::dmat3(1.0), light.cells, {.max_fine_directions = 0});
    light.radiance.resize(2 * light.cells.pairCount());
    for (std::size_t texel = 0; texel < light.radiance.size(); ++texel) {
        const std::size_t pair = texel / 2;
        const IrradianceVector& v = texel % 2 == 0 ? split.along[pair] : split.against[pair];
        const auto solid_angle = static_cast<float>(light.cells.solidAngle(pair));
        light.radiance[texel] =
            atLeastZero(v.along(glm::vec3(light.direction(texel)))) / solid_angle;
    }
    return light;
}

IrradianceCube::IrradianceCube(const TexelLight& light, int face_size) : size_(face_size)
{
    const DirectionCells normals{face_size};
    texels_.resize(2 * normals.pairCount());
    parallelFor(0, static_cast<std::int64_t>(texels_.size()), [&](std::int64_t i) {
        const auto texel = static_cast<std::size_t>(i);
        const glm::dvec3 normal = normals.direction(texel / 2) * (texel % 2 == 0 ? 1.0 : -1.0);
        glm::dvec3 sum(0.0);
        for (std::size_t k = 0; k < light.radiance.size(); ++k) {
            const double cosine = glm::dot(normal, light.direction(k));
            if (cosine > 0.0)
                sum += glm::dvec3(light.radiance[k]) * (cosine * light.cells.solidAngle(k / 2));
        }
        texels_[texel] = Rgb(sum);
    });
}

Rgb IrradianceCube::at(glm::dvec3 n) const
{
    const DirectedPair cell = DirectionCells{size_}.cellAt(n);
    const auto side = static_cast<std::size_t>(size_);
    const auto axis = static_cast<int>(cell.pair / (side * side));
    const auto place = [&](int other) {
        const double at = (n[(axis + other) % 3] / n[axis] + 1.0) * 0.5 * size_ - 0.5;
        return std::clamp(at, 0.0, size_ - 1.0);
    };
    const double x = place(1);
    const double y = place(2);
    const auto i = std::min(static_cast<std::size_t>(x), side - 2);
    const auto j = std::min(static_cast<std::size_t>(y), side - 2);
    const auto tx = static_cast<float>(x - static_cast<double>(i));
    const auto ty = static_cast<float>(y - static_cast<double>(j));
    const auto texel = [&](std::size_t column, std::size_t row) {
        return texels_[2 * ((static_cast<std::size_t>(axis) * side + row) * side + column) +
                       static_cast<std::size_t>(cell.side)];
    };
    return (texel(i, j) * (1.0f - tx) + texel(i + 1, j) * tx) * (1.0f - ty) +
           (texel(i, j + 1) * (1.0f - tx) + texel(i + 1, j + 1) * tx) * ty;
}

Table::Table(const RayScene& rays,
             const LocalFrame& local,
             const TexelLight& light,
             const TableSize& size,
             int stride)
    : size_(size)
{
    const auto count = static_cast<std::int64_t>(size.azimuths) * size.polars * size.shells;
    vectors_.resize(static_cast<std::size_t>(count));
    inside_.resize(vectors_.size());
    std::vector<glm::dvec3> directions;
    for (std::size_t k = 0; k < light.radiance.size(); ++k)
        directions.push_back(light.direction(k));
    const CellLight powers = light.asCellLight();
    std::atomic<std::size_t> traced{0};
    parallelFor(0, (count + stride - 1) / stride, [&](std::int64_t task) {
        const std::int64_t i = task * stride;
        const double phi = 2.0 * pi * static_cast<double>(i % size.azimuths) / size.azimuths;
        const double theta =
            pi * static_cast<double>(i / size.azimuths % size.polars) / (size.polars - 1);
        const double shell = static_cast<double>(i / size.azimuths / size.polars);
        const double rho = size.first_radii *
                           std::pow(size.last_radii / size.first_radii, shell / (size.shells - 1));
        const glm::dvec3 away(
            std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
        const glm::dvec3 x = local.center + away * (rho * local.radius);
        const double cone = coneCosine(rho, 1.0);
        IrradianceVector sum;
        std::size_t tried = 0;
        std::size_t hidden = 0;
        for (std::size_t k = 0; k < directions.size(); ++k) {
            if (-glm::dot(away, directions[k]) < cone) continue;
            ++tried;
            if (!rays.occluded(x, directions[k])) continue;
            ++hidden;
            sum += (k % 2 == 0 ? powers.along : powers.against)[k / 2];
        }
        traced += tried;
        vectors_[static_cast<std::size_t>(i)] = sum;
        inside_[static_cast<std::size_t>(i)] = hidden == directions.size() ? 1 : 0;
    });
    rays_ = traced;
}

IrradianceVector Table::at(glm::vec3 x) const
{
    const double rho = glm::length(glm::dvec3(x));
    const double azimuth = (std::atan2(x.z, x.x) / (2.0 * pi) + 1.0) * size_.azimuths;
    const double polar = std::acos(std::clamp(x.y / rho, -1.0, 1.0)) / pi * (size_.polars - 1);
    const double reach = std::clamp(rho, size_.first_radii, size_.last_radii);
    const double shell = std::log(reach / size_.first_radii) /
                         std::log(size_.last_radii / size_.first_radii) * (size_.shells - 1);
    const int i = static_cast<int>(azimuth);
    const int j = std::min(static_cast<int>(polar), size_.polars - 2);
    const int k = std::min(static_cast<int>(shell), size_.shells - 2);
    IrradianceVector sum;
    double counted = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        const int a = corner & 1;
        const int b = (corner >> 1) & 1;
        const int c = corner >> 2;
        const auto slot = static_cast<std::size_t>(
            ((k + c) * size_.polars + j + b) * size_.azimuths + (i + a) % size_.azimuths);
        if (inside_[slot] != 0) continue;
        const double weight = std::abs(1 - a - (azimuth - i)) * std::abs(1 - b - (polar - j)) *
                              std::abs(1 - c - (shell - k));
        IrradianceVector part = vectors_[slot];
        part *= static_cast<float>(weight);
        sum += part;
        counted += weight;
    }
    if (counted > 0.0) sum *= static_cast<float>(1.0 / counted);
    return sum;
}

double discOverlap(double a, double b, double distance)
{
    if (distance >= a + b) return 0.0;
    const double smaller = std::min(a, b);
    if (distance <= std::abs(a - b)) return pi * smaller * smaller;
    const double from_a = (distance * distance + a * a - b * b) / (2.0 * distance);
    const double from_b = distance - from_a;
    const auto segment = [](double radius, double height) {
        return radius * radius * std::acos(std::clamp(height / radius, -1.0, 1.0)) -
               height * std::sqrt(std::max(0.0, radius * radius - height * height));
    };
    return segment(a, from_a) + segment(b, from_b);
}

Rgb shadowed(const IrradianceCube& cube,
             std::span<const Occluder> occluders,
             glm::dvec3 x,
             glm::dvec3 n,
             const Corrections& corrections)
{
    struct Seen {
        glm::dvec3 towards{0.0};
        double disc = 0.0;  ///< radius of the unit bounding disc
        Rgb hidden{0.0f};
    };
    std::vector<Seen> seen;
    for (const Occluder& o : occluders) {
        const glm::dvec3 to = o.center - x;
        const double height = glm::dot(to, n);
        if (height <= -o.radius) continue;  // case C
        Rgb hidden = o.table->at(glm::vec3(-to / o.radius)).along(glm::vec3(n));
        if (height < o.radius && corrections.partial)  // case B
            hidden *= static_cast<float>((height + o.radius) / (2.0 * o.radius));
        seen.push_back({glm::normalize(to), o.radius / glm::length(to), atLeastZero(hidden)});
    }
    Rgb sum(0.0f);
    for (const Seen& one : seen)
        sum += one.hidden;
    if (corrections.multiple)
        for (std::size_t i = 0; i < seen.size(); ++i)
            for (std::size_t j = i + 1; j < seen.size(); ++j) {
                const Seen& a = seen[i];
                const Seen& b = seen[j];
                const double shared =
                    discOverlap(a.disc, b.disc, glm::length(a.towards - b.towards)) /
                    (pi * (a.disc * a.disc + b.disc * b.disc));
                sum -= static_cast<float>(shared) * (a.hidden + b.hidden);
            }
    return atLeastZero(cube.at(n) - sum);
}

Rgb selfShadowed(const TexelLight& light, const Occluder& self, glm::dvec3 x, glm::dvec3 n)
{
    IrradianceVector seen = light.total();
    seen -= self.table->at(glm::vec3((x - self.center) / self.radius));
    return atLeastZero(seen.along(glm::vec3(n)));
}

Rgb bruteForce(std::span<const RayScene* const> scenes,
               const TexelLight& light,
               glm::dvec3 x,
               glm::dvec3 n)
{
    glm::dvec3 sum(0.0);
    for (std::size_t k = 0; k < light.radiance.size(); ++k) {
        const glm::dvec3 d = light.direction(k);
        const double cosine = glm::dot(n, d);
        if (cosine <= 0.0 || light.radiance[k] == Rgb(0.0f)) continue;
        const bool hidden =
            std::ranges::any_of(scenes, [&](const RayScene* s) { return s->occluded(x, d); });
        if (!hidden)
            sum += glm::dvec3(light.radiance[k]) * (cosine * light.cells.solidAngle(k / 2));
    }
    return Rgb(sum);
}

}  // namespace insitu::baseline
