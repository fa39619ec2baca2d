#include "core/environment_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

glm::dvec2 environmentUvFromDirection(glm::dvec3 d)
{
    const double u = 0.5 + std::atan2(d.x, -d.z) / (2.0 * pi);
    const double v = std::acos(std::clamp(d.y, -1.0, 1.0)) / pi;
    return {u, v};
}

glm::dvec3 environmentDirectionFromUv(glm::dvec2 uv)
{
    const double azimuth = (uv.x - 0.5) * 2.0 * pi;
    const double polar = uv.y * pi;
    const double s = std::sin(polar);
    return {s * std::sin(azimuth), std::cos(polar), -s * std::cos(azimuth)};
}

glm::ivec2 environmentTexelAt(int width, int height, glm::dvec3 unit_direction)
{
    const glm::dvec2 uv = environmentUvFromDirection(unit_direction);
    return {std::clamp(static_cast<int>(uv.x * width), 0, width - 1),
            std::clamp(static_cast<int>(uv.y * height), 0, height - 1)};
}

double environmentTexelSolidAngle(int width, int height, int y)
{
    const double top = std::cos(pi * y / height);
    const double bottom = std::cos(pi * (y + 1) / height);
    return 2.0 * pi / width * (top - bottom);
}

namespace {

Rgb bilinear(const Image<Rgb>& image, glm::dvec3 unit_direction)
{
    const glm::dvec2 uv = environmentUvFromDirection(unit_direction);
    const double x = uv.x * image.width() - 0.5;
    const double y = std::clamp(uv.y * image.height() - 0.5, 0.0, image.height() - 1.0);
    const double x_floor = std::floor(x);
    const int x0 = (static_cast<int>(x_floor) + image.width()) % image.width();
    const int x1 = (x0 + 1) % image.width();
    const int y0 = static_cast<int>(y);
    const int y1 = std::min(y0 + 1, image.height() - 1);
    const float tx = static_cast<float>(x - x_floor);
    const float ty = static_cast<float>(y - y0);
    return (image(x0, y0) * (1.0f - tx) + image(x1, y0) * tx) * (1.0f - ty) +
           (image(x0, y1) * (1.0f - tx) + image(x1, y1) * tx) * ty;
}

}  // namespace

Rgb lookUp(const EnvironmentMap& environment, glm::dvec3 unit_direction)
{
    return bilinear(environment.pixels, unit_direction);
}

Rgb lookUpClipped(const EnvironmentMap& environment, glm::dvec3 unit_direction)
{
    return environment.clipped.empty() ? Rgb(0.0f) : bilinear(environment.clipped, unit_direction);
}

glm::dvec3 irradiance(const EnvironmentMap& environment, glm::dvec3 unit_normal)
{
    const Image<Rgb>& image = environment.pixels;
    glm::dvec3 sum(0.0);
    for (int y = 0; y < image.height(); ++y) {
        const double solid_angle = environmentTexelSolidAngle(image.width(), image.height(), y);
        for (int x = 0; x < image.width(); ++x) {
            const glm::dvec3 d =
                environmentDirectionFromUv({(x + 0.5) / image.width(), (y + 0.5) / image.height()});
            const double cosine = glm::dot(d, unit_normal);
            if (cosine > 0.0) sum += glm::dvec3(image(x, y)) * (cosine * solid_angle);
        }
    }
    return sum;
}

}  // namespace insitu
