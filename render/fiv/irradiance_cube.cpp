#include "render/fiv/irradiance_cube.h"

#include <algorithm>
#include <cmath>

namespace insitu {

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
    // Beyond the outermost centres of a face the values go on as they go between the last two.
    const int n = cells_.face_size;
    const auto at = [&](int other) {
        return std::clamp((d[other] / d[axis] + 1.0) * 0.5 * n - 0.5, -0.5, n - 0.5);
    };
    const double column = at((axis + 1) % 3);
    const double row = at((axis + 2) % 3);
    const int c0 = std::clamp(static_cast<int>(column), 0, n - 2);
    const int r0 = std::clamp(static_cast<int>(row), 0, n - 2);
    const int c1 = c0 + 1;
    const int r1 = r0 + 1;
    const float tx = static_cast<float>(column - c0);
    const float ty = static_cast<float>(row - r0);
    const auto value = [&](int r, int c) {
        return values_[2 * static_cast<std::size_t>((axis * n + r) * n + c) +
                       (d[axis] < 0.0 ? 1 : 0)];
    };
    const Rgb above = value(r0, c0) * (1.0f - tx) + value(r0, c1) * tx;
    const Rgb below = value(r1, c0) * (1.0f - tx) + value(r1, c1) * tx;
    return glm::max(above * (1.0f - ty) + below * ty, Rgb(0.0f));
}

DirectionTable irradianceCube(const PlaceLight& light, int face_size)
{
    DirectionTable table(face_size);
    const std::size_t count = table.size();
    std::vector<float> x(count), y(count), z(count);
    for (std::size_t i = 0; i < count; ++i) {
        const glm::vec3 d(table.direction(i));
        x[i] = d.x;
        y[i] = d.y;
        z[i] = d.z;
    }
    // The table's directions innermost, so that they are worked on many at a time.
    std::vector<float> red(count), green(count), blue(count);
    for (std::size_t cell = 0; cell < light.radiance.size(); ++cell) {
        const Rgb radiance = glm::max(light.radiance[cell] + light.change[cell], Rgb(0.0f));
        const glm::vec3 d = light.geometry->directions[cell];
        const float solid_angle = light.geometry->solid_angles[cell];
        for (std::size_t i = 0; i < count; ++i) {
            const float weight = std::max(x[i] * d.x + y[i] * d.y + z[i] * d.z, 0.0f) * solid_angle;
            red[i] += weight * radiance.r;
            green[i] += weight * radiance.g;
            blue[i] += weight * radiance.b;
        }
    }
    for (std::size_t i = 0; i < count; ++i)
        table[i] = {red[i], green[i], blue[i]};
    return table;
}

}  // namespace insitu
