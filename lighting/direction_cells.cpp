#include "lighting/direction_cells.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

struct Texel {
    int axis = 0, row = 0, column = 0;
};

Texel texelOf(std::size_t pair, int face_size)
{
    const auto n = static_cast<std::size_t>(face_size);
    return {static_cast<int>(pair / (n * n)),
            static_cast<int>(pair / n % n),
            static_cast<int>(pair % n)};
}

/// Solid angle of the rectangle from (0, 0) to (x, y) on the plane at distance 1, with sign.
double cornerSolidAngle(double x, double y)
{
    return std::atan2(x * y, std::sqrt(x * x + y * y + 1.0));
}

}  // namespace

glm::dvec3 DirectionCells::direction(std::size_t pair) const
{
    return directionIn(2 * pair, glm::dvec2(0.5));
}

glm::dvec3 DirectionCells::directionIn(std::size_t cell, glm::dvec2 inside) const
{
    const Texel texel = texelOf(cell / 2, face_size);
    const double side = cell % 2 == 0 ? 1.0 : -1.0;
    glm::dvec3 d(0.0);
    d[texel.axis] = side;
    d[(texel.axis + 1) % 3] = side * (2.0 * (texel.column + inside.x) / face_size - 1.0);
    d[(texel.axis + 2) % 3] = side * (2.0 * (texel.row + inside.y) / face_size - 1.0);
    return axes * glm::normalize(d);
}

double DirectionCells::solidAngle(std::size_t pair) const
{
    const Texel texel = texelOf(pair, face_size);
    const auto edge = [this](int i) { return 2.0 * i / face_size - 1.0; };
    const double x0 = edge(texel.column);
    const double x1 = edge(texel.column + 1);
    const double y0 = edge(texel.row);
    const double y1 = edge(texel.row + 1);
    return cornerSolidAngle(x1, y1) - cornerSolidAngle(x0, y1) - cornerSolidAngle(x1, y0) +
           cornerSolidAngle(x0, y0);
}

DirectedPair DirectionCells::cellAt(glm::dvec3 direction) const
{
    const glm::dvec3 d = direction * axes;
    const glm::dvec3 size = glm::abs(d);
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
    const auto index = [&](int other) {
        const double across = d[other] / d[axis];
        return static_cast<std::size_t>(
            std::clamp(static_cast<int>((across + 1.0) * 0.5 * face_size), 0, face_size - 1));
    };
    const auto n = static_cast<std::size_t>(face_size);
    const std::size_t column = index((axis + 1) % 3);
    const std::size_t row = index((axis + 2) % 3);
    return {(static_cast<std::size_t>(axis) * n + row) * n + column, d[axis] < 0.0 ? 1 : 0};
}

}  // namespace insitu
