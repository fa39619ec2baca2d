#include "lighting/see_through.h"

#include "core/color.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace insitu {

namespace {

/// Side of the cells that gather the colour of a face, and the reach of a place's surroundings.
constexpr double kCell_m = 0.15;
constexpr double kReach_m = 0.5;
/// Standard deviation of a chromaticity that two pictures of one surface differ by at least.
constexpr double kChromaSigma = 0.05;
constexpr double kSigmas = 3.0;
/// How far, as natural logarithm, the brightness may lie from that of the surroundings: shadow
/// below a box is darker.
constexpr double kDarker = 1.0;
constexpr double kBrighter = 0.4;
/// Half side of the window whose mean is looked at, pixels.
constexpr int kWindow = 2;
/// Share of a box's pixels that may look like what is behind before the two look the same.
constexpr double kSameColor = 0.85;

/// ln(R/G), ln(B/G), ln(luminance).
glm::dvec3 logColor(Rgb color)
{
    const glm::dvec3 c = glm::max(glm::dvec3(color), glm::dvec3(1e-12));
    return {std::log(c.r / c.g), std::log(c.b / c.g), std::log(luminance(Rgb(c)))};
}

/// Sums of colours, from which follow mean and variance.
struct ColorSums {
    double weight = 0.0;
    glm::dvec3 sum{0.0};
    glm::dvec3 square{0.0};
    void add(glm::dvec3 value, double w)
    {
        weight += w;
        sum += w * value;
        square += w * value * value;
    }
    void add(const ColorSums& other, double w)
    {
        weight += w * other.weight;
        sum += w * other.sum;
        square += w * other.square;
    }
};

/// The colours known around every cell of every face that is no box.
FaceGrid<ColorSums> surroundings(const SceneProxy& proxy,
                                 const FaceGrid<Rgb>& radiance,
                                 const std::vector<std::uint8_t>& known)
{
    FaceGrid<ColorSums> cells(proxy, kCell_m);
    for (std::size_t face = 0; face < radiance.faceCount(); ++face)
        for (const std::size_t i : radiance.texelsOf(face))
            if (known[i] && radiance.valid(i))
                cells[cells.texelAt(face, radiance.centerUv(i))].add(logColor(radiance[i]), 1.0);

    FaceGrid<ColorSums> around(proxy, kCell_m);
    for (std::size_t face = 0; face < cells.faceCount(); ++face) {
        if (proxy.faces()[face].solid) continue;
        const auto numbers = cells.texelsOf(face);
        parallelFor(0, static_cast<std::int64_t>(numbers.size()), [&](std::int64_t n) {
            const std::size_t here = numbers[n];
            const glm::dvec3 point = proxy.pointOn(face, cells.centerUv(here));
            for (const std::size_t other : numbers) {
                if (!(cells[other].weight > 0.0)) continue;
                const glm::dvec3 way = proxy.pointOn(face, cells.centerUv(other)) - point;
                const double weight = std::exp(-0.5 * glm::dot(way, way) / (kReach_m * kReach_m));
                if (weight > 1e-4) around[here].add(cells[other], weight);
            }
        });
    }
    return around;
}

bool looksLike(glm::dvec3 color, const ColorSums& known)
{
    if (!(known.weight > 1.0)) return false;
    const glm::dvec3 mean = known.sum / known.weight;
    const glm::dvec3 variance =
        glm::max(known.square / known.weight - mean * mean, glm::dvec3(0.0)) +
        kChromaSigma * kChromaSigma;
    const glm::dvec3 off = color - mean;
    const double distance2 = off.x * off.x / variance.x + off.y * off.y / variance.y;
    const double spread = 2.0 * std::sqrt(variance.z);
    return distance2 < kSigmas * kSigmas && off.z > -kDarker - spread && off.z < kBrighter + spread;
}

Rgb windowMean(const Image<Rgb>& picture, int x, int y)
{
    Rgb sum(0.0f);
    int count = 0;
    for (int qy = std::max(0, y - kWindow); qy <= std::min(picture.height() - 1, y + kWindow); ++qy)
        for (int qx = std::max(0, x - kWindow); qx <= std::min(picture.width() - 1, x + kWindow);
             ++qx) {
            sum += picture(qx, qy);
            ++count;
        }
    return sum / static_cast<float>(count);
}

}  // namespace

std::optional<ProxyHit> intersectBehindBoxes(const SceneProxy& proxy,
                                             glm::dvec3 origin,
                                             glm::dvec3 direction)
{
    double passed = 0.0;
    auto hit = proxy.intersect(origin, direction);
    while (hit && proxy.faces()[hit->face].solid) {
        passed += hit->distance_m;
        hit = proxy.intersect(hit->point, direction);
    }
    if (hit) hit->distance_m += passed;
    return hit;
}

Image<std::uint8_t> findSeeThrough(const Camera& camera,
                                   const Image<Rgb>& photograph,
                                   const SceneProxy& proxy,
                                   const FaceGrid<Rgb>& radiance,
                                   const std::vector<std::uint8_t>& known)
{
    const int width = photograph.width();
    const int height = photograph.height();
    Image<std::uint8_t> through(width, height);
    const FaceGrid<ColorSums> around = surroundings(proxy, radiance, known);
    Image<int> box(width, height, -1);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            const glm::dvec3 direction = camera.rayDirection({x + 0.5, y + 0.5});
            const auto front = proxy.intersect(camera.position_m, direction);
            if (!front || !proxy.faces()[front->face].solid) continue;
            box(x, y) = proxy.faces()[front->face].box;
            const auto behind = intersectBehindBoxes(proxy, camera.position_m, direction);
            if (!behind || behind->opening) continue;
            through(x, y) = looksLike(logColor(windowMean(photograph, x, y)),
                                      around[around.texelAt(behind->face, behind->uv)]);
        }
    });

    // Boxes of the colour of what is behind them stay solid.
    struct Count {
        double pixels = 0.0;
        double through = 0.0;
    };
    std::map<int, Count> boxes;
    for (std::size_t i = 0; i < through.pixelCount(); ++i) {
        if (box.pixels()[i] < 0) continue;
        Count& count = boxes[box.pixels()[i]];
        count.pixels += 1.0;
        count.through += through.pixels()[i];
    }
    for (std::size_t i = 0; i < through.pixelCount(); ++i) {
        if (box.pixels()[i] < 0) continue;
        const Count& count = boxes[box.pixels()[i]];
        if (count.through > kSameColor * count.pixels) through.pixels()[i] = 0;
    }
    return through;
}

}  // namespace insitu
