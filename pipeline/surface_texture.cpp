#include "pipeline/surface_texture.h"

#include "core/color.h"
#include "core/io/image_io.h"
#include "core/parallel.h"
#include "core/random.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr double kTexelsPerMetre = 420.0;
constexpr int kMaxTexels = 4096;

glm::u8vec4 encodeTexel(glm::dvec3 linear)
{
    glm::u8vec4 texel(0, 0, 0, 255);
    for (int c = 0; c < 3; ++c)
        texel[c] = static_cast<glm::u8>(
            std::lround(255.0 * srgbFromLinear(std::clamp(linear[c], 0.0, 1.0))));
    return texel;
}

/// A uniform number for a lattice point: the same wherever it is asked for.
double lattice(std::uint64_t seed, std::int64_t x, std::int64_t y)
{
    return RandomStream(seed, static_cast<std::uint64_t>(x), static_cast<std::uint64_t>(y))
        .uniformDouble();
}

/// Value noise in [0, 1]: lattice values, smoothly interpolated.
double valueNoise(std::uint64_t seed, double x, double y)
{
    const double fx = std::floor(x);
    const double fy = std::floor(y);
    const auto ix = static_cast<std::int64_t>(fx);
    const auto iy = static_cast<std::int64_t>(fy);
    const auto smooth = [](double t) { return t * t * (3.0 - 2.0 * t); };
    const double tx = smooth(x - fx);
    const double ty = smooth(y - fy);
    const double top = std::lerp(lattice(seed, ix, iy), lattice(seed, ix + 1, iy), tx);
    const double bottom = std::lerp(lattice(seed, ix, iy + 1), lattice(seed, ix + 1, iy + 1), tx);
    return std::lerp(top, bottom, ty);
}

/// Brightness of wood at a place: broad figure and fine fibres, both drawn out along the board.
double grain(std::uint64_t board, double across_m, double along_m)
{
    const double warp = 0.012 * valueNoise(board + 1, across_m * 20.0, along_m * 1.5);
    const double figure = valueNoise(board + 2, (across_m + warp) * 90.0, along_m * 1.6);
    const double fibre = valueNoise(board + 3, across_m * 700.0, along_m * 14.0);
    return 1.0 + 0.22 * (figure - 0.5) + 0.14 * (fibre - 0.5);
}

/// Colour of a floor of boards; `across` and `along` in metres.
glm::dvec3 boardColor(const SimulatedSurface& surface,
                      double across,
                      double along,
                      std::uint64_t seed)
{
    const auto column = static_cast<std::int64_t>(std::floor(across / surface.board_width_m));
    const double shift = lattice(seed, column, -1) * surface.board_length_m;
    const double place = (along + shift) / surface.board_length_m;
    const auto row = static_cast<std::int64_t>(std::floor(place));
    const double from_edge = across - static_cast<double>(column) * surface.board_width_m;
    const double edge = std::min(from_edge, surface.board_width_m - from_edge);
    const double end = std::min(place - std::floor(place), 1.0 - (place - std::floor(place))) *
                       surface.board_length_m;

    const double spread = surface.board_variation;
    const double brightness = 1.0 + spread * (lattice(seed + 1, column, row) - 0.5);
    // A darker board is also a redder one: the blue channel falls faster.
    const double hue = 0.5 * spread * (lattice(seed + 2, column, row) - 0.5);
    glm::dvec3 color =
        glm::dvec3(surface.color_linear) * brightness * glm::dvec3(1.0 + hue, 1.0, 1.0 - hue);
    const auto board = static_cast<std::uint64_t>(column * 7919 + row * 104729) + seed;
    color *= grain(board, from_edge, along + shift);
    // Joints 2 mm wide with a soft shoulder.
    const double joint = std::clamp((std::min(edge, end) - 0.001) / 0.002, 0.0, 1.0);
    return color * (0.35 + 0.65 * joint);
}

}  // namespace

Texture boardsTexture(const SimulatedSurface& surface,
                      double width_m,
                      double height_m,
                      std::uint64_t seed)
{
    const auto texels = [](double metres) {
        return std::clamp(static_cast<int>(std::ceil(metres * kTexelsPerMetre)), 1, kMaxTexels);
    };
    Texture texture;
    texture.clamp_s = texture.clamp_t = true;
    texture.texels = Image<glm::u8vec4>(texels(width_m), texels(height_m));
    const int width = texture.texels.width();
    const int height = texture.texels.height();
    parallelFor(0, height, [&](std::int64_t y) {
        const double v = (static_cast<double>(y) + 0.5) / height * height_m;
        for (int x = 0; x < width; ++x) {
            const double u = (x + 0.5) / width * width_m;
            texture.texels(x, static_cast<int>(y)) =
                encodeTexel(surface.boards_along_x ? boardColor(surface, v, u, seed)
                                                   : boardColor(surface, u, v, seed));
        }
    });
    return texture;
}

Texture checkerTexture(const SimulatedSurface& surface)
{
    // 64 texels a field keep the filtered border between two fields narrow.
    constexpr int kField = 64;
    Texture texture;
    texture.texels = Image<glm::u8vec4>(2 * kField, 2 * kField);
    for (int y = 0; y < 2 * kField; ++y)
        for (int x = 0; x < 2 * kField; ++x)
            texture.texels(x, y) = encodeTexel(
                (x < kField) == (y < kField) ? surface.color_linear : surface.second_linear);
    return texture;
}

Texture pictureTexture(const SimulatedSurface& surface)
{
    const Photo photo = developed(readPhoto(surface.picture));
    Texture texture;
    texture.texels = Image<glm::u8vec4>(photo.image.codes.width(), photo.image.codes.height());
    for (int y = 0; y < texture.texels.height(); ++y)
        for (int x = 0; x < texture.texels.width(); ++x) {
            glm::dvec3 linear{0.0};
            for (int c = 0; c < 3; ++c)
                linear[c] = surface.color_linear[c] *
                            linearFromSrgb(static_cast<double>(photo.image.codes(x, y)[c]) /
                                           photo.image.max_code);
            texture.texels(x, y) = encodeTexel(linear);
        }
    return texture;
}

}  // namespace insitu
