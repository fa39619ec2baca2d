#include "capture/light_probe.h"
#include "capture/probe_checks.h"
#include "capture/texel_average.h"
#include "core/check.h"
#include "core/parallel.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

constexpr int kLargestSide = 8192;

/// A face: what it looks at, and where in the world its picture's right and down point.
struct Face {
    glm::dvec3 forward;
    glm::dvec3 right;
    glm::dvec3 down;
    glm::ivec2 cell;  ///< column and row in the cross
};
using Faces = std::array<Face, 6>;

Faces facesOf(CubeLayout layout)
{
    const glm::dvec3 x(1.0, 0.0, 0.0);
    const glm::dvec3 y(0.0, 1.0, 0.0);
    const glm::dvec3 z(0.0, 0.0, 1.0);
    const Face back =
        layout == CubeLayout::Horizontal ? Face{z, -x, -y, {3, 1}} : Face{z, x, y, {1, 3}};
    return {{{-z, x, -y, {1, 1}},
             {x, z, -y, {2, 1}},
             {-x, -z, -y, {0, 1}},
             {y, x, -z, {1, 0}},
             {-y, x, z, {1, 2}},
             back}};
}

/// Radiance of the cross in a direction; look-ups stay inside their face.
Rgb lookUpCross(const Image<Rgb>& cross, const Faces& faces, int side, glm::dvec3 direction)
{
    const Face& face = *std::ranges::max_element(
        faces, {}, [&](const Face& f) { return glm::dot(f.forward, direction); });
    const double depth = glm::dot(face.forward, direction);
    const glm::dvec2 place =
        0.5 * side *
        (1.0 + glm::dvec2(glm::dot(face.right, direction), glm::dot(face.down, direction)) / depth);
    const glm::dvec2 inside = glm::clamp(place, 0.5, side - 0.5);
    return sampleBilinear(cross, face.cell.x * side + inside.x, face.cell.y * side + inside.y);
}

/// Sub-samples per pixel and axis.
int placesFor(double pixel_radians, double source_radians)
{
    return std::clamp(static_cast<int>(std::ceil(2.0 * pixel_radians / source_radians)), 2, 16);
}

void checkSide(int side)
{
    if (side < 2 || side > kLargestSide)
        throw InputError(
            "light probe",
            fmt::format(
                "a picture of {} pixels a side: at least 2, at most {}", side, kLargestSide));
}

void checkEnvironment(const EnvironmentMap& environment)
{
    detail::checkRadiance(environment.pixels);
}

}  // namespace

LightProbe probeFromCubeCross(const Image<Rgb>& radiance, int width)
{
    detail::checkRadiance(radiance);
    detail::checkMapWidth(width);
    const bool horizontal = radiance.width() > radiance.height();
    const int side = std::max(radiance.width(), radiance.height()) / 4;
    const glm::ivec2 expected =
        horizontal ? glm::ivec2(4 * side, 3 * side) : glm::ivec2(3 * side, 4 * side);
    if (side < 1 || expected != glm::ivec2(radiance.width(), radiance.height()))
        throw InputError("light probe",
                         fmt::format("{}x{} pixels: a cube cross is 4 by 3 or 3 by 4 square faces",
                                     radiance.width(),
                                     radiance.height()));
    const Faces faces = facesOf(horizontal ? CubeLayout::Horizontal : CubeLayout::Vertical);
    // In the middle of a face, where its pixels see the most.
    const double source_radians = 2.0 / side;
    const int map_width = width > 0 ? width : detail::widthForResolution(source_radians);
    const int places = placesFor(2.0 * pi / map_width, source_radians);
    LightProbe probe;
    probe.environment.pixels = detail::averageOverTexels(
        map_width,
        [&](glm::dvec3) { return places; },
        [&](glm::dvec3 direction) { return lookUpCross(radiance, faces, side, direction); });
    return probe;
}

Image<Rgb> cubeCross(const EnvironmentMap& environment, CubeLayout layout, int face)
{
    checkEnvironment(environment);
    checkSide(face);
    const bool horizontal = layout == CubeLayout::Horizontal;
    Image<Rgb> cross((horizontal ? 4 : 3) * face, (horizontal ? 3 : 4) * face);
    const int n = placesFor(2.0 / face, 2.0 * pi / environment.pixels.width());
    const Faces faces = facesOf(layout);
    parallelFor(0, 6 * static_cast<std::int64_t>(face), [&](std::int64_t row) {
        const Face& f = faces[static_cast<std::size_t>(row / face)];
        const int y = static_cast<int>(row % face);
        for (int x = 0; x < face; ++x) {
            glm::dvec3 sum(0.0);
            for (int k = 0; k < n * n; ++k) {
                const glm::dvec2 place(x + (k % n + 0.5) / n, y + (k / n + 0.5) / n);
                const glm::dvec2 uv = 2.0 * place / static_cast<double>(face) - 1.0;
                sum += glm::dvec3(lookUp(
                    environment, glm::normalize(f.forward + uv.x * f.right + uv.y * f.down)));
            }
            cross(f.cell.x * face + x, f.cell.y * face + y) = Rgb(sum / static_cast<double>(n * n));
        }
    });
    return cross;
}

Image<Rgb> angularMap(const EnvironmentMap& environment, int side)
{
    checkEnvironment(environment);
    checkSide(side);
    Image<Rgb> map(side, side);
    const int n = placesFor(2.0 * pi / side, 2.0 * pi / environment.pixels.width());
    parallelFor(0, side, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < side; ++x) {
            glm::dvec3 sum(0.0);
            int inside = 0;
            for (int k = 0; k < n * n; ++k) {
                const double u = 2.0 * (x + (k % n + 0.5) / n) / side - 1.0;
                const double v = 1.0 - 2.0 * (y + (k / n + 0.5) / n) / side;
                const double r = std::hypot(u, v);
                if (r > 1.0) continue;
                const double sine_by_r = r > 1e-12 ? std::sin(pi * r) / r : pi;
                sum += glm::dvec3(lookUp(
                    environment,
                    glm::normalize(glm::dvec3(sine_by_r * u, sine_by_r * v, -std::cos(pi * r)))));
                ++inside;
            }
            if (inside > 0) map(x, y) = Rgb(sum / static_cast<double>(inside));
        }
    });
    return map;
}

}  // namespace insitu
