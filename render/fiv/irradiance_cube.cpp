#include "render/fiv/irradiance_cube.h"

#include "render/bsdf/ggx_albedo.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Sums kernel(cosine)·light over the directions of the light for each direction of the table, the
/// table's directions innermost so that they are worked on many at a time.
template <class Kernel>
void convolve(const PlaceLight& light, const Kernel& kernel, DirectionTable& table, bool normalise)
{
    const std::size_t count = table.size();
    std::vector<float> x(count), y(count), z(count);
    for (std::size_t i = 0; i < count; ++i) {
        const glm::vec3 d(table.direction(i));
        x[i] = d.x;
        y[i] = d.y;
        z[i] = d.z;
    }
    std::vector<float> red(count), green(count), blue(count), weights(count);
    for (std::size_t cell = 0; cell < light.radiance.size(); ++cell) {
        const Rgb radiance = glm::max(light.radiance[cell] + light.change[cell], Rgb(0.0f));
        const glm::vec3 d = light.geometry->directions[cell];
        const float solid_angle = light.geometry->solid_angles[cell];
        for (std::size_t i = 0; i < count; ++i) {
            const float weight = kernel(x[i] * d.x + y[i] * d.y + z[i] * d.z) * solid_angle;
            red[i] += weight * radiance.r;
            green[i] += weight * radiance.g;
            blue[i] += weight * radiance.b;
            weights[i] += weight;
        }
    }
    for (std::size_t i = 0; i < count; ++i)
        table[i] = Rgb(red[i], green[i], blue[i]) *
                   (normalise ? (weights[i] > 0.0f ? 1.0f / weights[i] : 0.0f) : 1.0f);
}

}  // namespace

DirectionTable::DirectionTable(int face_size)
    : cells_{face_size}, values_(2 * cells_.pairCount(), Rgb(0.0f))
{
}

glm::dvec3 DirectionTable::direction(std::size_t number) const
{
    return cells_.direction(number / 2) * (number % 2 == 0 ? 1.0 : -1.0);
}

Rgb DirectionTable::lookUp(glm::dvec3 d) const
{
    const glm::dvec3 size = glm::abs(d);
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
    const int n = cells_.face_size;
    const auto at = [&](int other) {
        return std::clamp((d[other] / d[axis] + 1.0) * 0.5 * n - 0.5, 0.0, n - 1.0);
    };
    const double column = at((axis + 1) % 3);
    const double row = at((axis + 2) % 3);
    const int c0 = std::min(static_cast<int>(column), std::max(n - 2, 0));
    const int r0 = std::min(static_cast<int>(row), std::max(n - 2, 0));
    const int c1 = std::min(c0 + 1, n - 1);
    const int r1 = std::min(r0 + 1, n - 1);
    const float tx = static_cast<float>(column - c0);
    const float ty = static_cast<float>(row - r0);
    const auto value = [&](int r, int c) {
        return values_[2 * static_cast<std::size_t>((axis * n + r) * n + c) +
                       (d[axis] < 0.0 ? 1 : 0)];
    };
    return (value(r0, c0) * (1.0f - tx) + value(r0, c1) * tx) * (1.0f - ty) +
           (value(r1, c0) * (1.0f - tx) + value(r1, c1) * tx) * ty;
}

DirectionTable irradianceCube(const PlaceLight& light, int face_size)
{
    DirectionTable table(face_size);
    convolve(
        light, [](float cosine) { return std::max(cosine, 0.0f); }, table, false);
    return table;
}

DirectionTable glossyCube(const PlaceLight& light, double roughness, int face_size)
{
    // Half vectors are half as far from the normal as what they mirror: with the viewer along the
    // normal, (h·n)² = (1 + cos)/2. Lobes narrower than the cells are as narrow as these.
    const double alpha = std::max(ggx::alphaFromRoughness(roughness), 1.0 / face_size);
    const float a2 = static_cast<float>(alpha * alpha);
    DirectionTable table(face_size);
    convolve(
        light,
        [a2](float cosine) {
            const float h2 = 0.5f * (1.0f + cosine);
            const float root = h2 * (a2 - 1.0f) + 1.0f;
            return std::max(cosine, 0.0f) * a2 / (root * root);
        },
        table,
        true);
    return table;
}

}  // namespace insitu
