#include "pipeline/denoise.h"

#include "core/color.h"
#include "core/parallel.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// What the noise does not touch: means over a pixel's first hits.
struct Features {
    glm::vec3 albedo{1.0f};
    glm::vec3 normal{0.0f};
    glm::vec3 position{0.0f};
    float distance = 0.0f;  ///< 0: nothing there
};

/// Reflectance below this is not divided by: black things have no light to speak of.
constexpr float kLeastAlbedo = 0.02f;

Features featuresOf(const ObjectScene& scene, const Camera& camera, int x, int y)
{
    constexpr int kGrid = 4;
    glm::dvec3 albedo{0.0};
    glm::dvec3 normal{0.0};
    glm::dvec3 position{0.0};
    double distance = 0.0;
    int hits = 0;
    for (int i = 0; i < kGrid * kGrid; ++i) {
        const glm::dvec2 pixel{x + (i % kGrid + 0.5) / kGrid, y + (i / kGrid + 0.5) / kGrid};
        const auto hit = scene.intersect(camera.position_m, camera.rayDirection(pixel));
        albedo += hit ? glm::dvec3(hit->material.base_color) : glm::dvec3(1.0);
        if (!hit) continue;
        normal += hit->shading_normal;
        position += hit->position - camera.position_m;
        distance += hit->distance_m;
        ++hits;
    }
    Features features;
    features.albedo = glm::max(glm::vec3(albedo / double(kGrid * kGrid)), glm::vec3(kLeastAlbedo));
    if (hits == 0) return features;
    features.normal = glm::vec3(normal / static_cast<double>(hits));
    features.position = glm::vec3(position / static_cast<double>(hits));
    features.distance = static_cast<float>(distance / hits);
    return features;
}

/// Mean over the 5 x 5 neighbours, or the pixel's own when that is larger: a variance from few
/// samples is itself noisy, and a stray bright sample shows in its own variance.
Image<float> smoothed(const Image<float>& image)
{
    constexpr int kRadius = 2;
    Image<float> result(image.width(), image.height());
    parallelFor(0, image.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < image.width(); ++x) {
            float sum = 0.0f;
            int count = 0;
            for (int sy = std::max(y - kRadius, 0); sy <= std::min(y + kRadius, image.height() - 1);
                 ++sy)
                for (int sx = std::max(x - kRadius, 0);
                     sx <= std::min(x + kRadius, image.width() - 1);
                     ++sx, ++count)
                    sum += image(sx, sy);
            result(x, y) = std::max(image(x, y), sum / static_cast<float>(count));
        }
    });
    return result;
}

/// The state of one picture's filtering.
struct Filter {
    const DenoiseOptions& options;
    Image<Features> features;
    Image<Rgb> light;         ///< radiance / albedo
    Image<float> brightness;  ///< its luminance
    Image<float> variance;    ///< of the brightness

    [[nodiscard]] double patchDistance(int px, int py, int qx, int qy) const;
    [[nodiscard]] double featureDistance(const Features& p, const Features& q) const;
    [[nodiscard]] Rgb filtered(int x, int y) const;
};

/// [RouKnaZwi12] eq. 5, on luminance, without the parts of the patches beyond the border.
double Filter::patchDistance(int px, int py, int qx, int qy) const
{
    const double k2 = options.strength * options.strength;
    const int r = options.patch_radius;
    double sum = 0.0;
    int count = 0;
    for (int dy = -r; dy <= r; ++dy)
        for (int dx = -r; dx <= r; ++dx) {
            const int ax = px + dx, ay = py + dy, bx = qx + dx, by = qy + dy;
            if (std::min({ax, ay, bx, by}) < 0 || std::max(ax, bx) >= light.width() ||
                std::max(ay, by) >= light.height())
                continue;
            const double va = static_cast<double>(variance(ax, ay));
            const double vb = static_cast<double>(variance(bx, by));
            const double difference =
                static_cast<double>(brightness(ax, ay)) - static_cast<double>(brightness(bx, by));
            sum += (difference * difference - (va + std::min(va, vb))) / (1e-12 + k2 * (va + vb));
            ++count;
        }
    return std::max(0.0, sum / count);
}

double Filter::featureDistance(const Features& p, const Features& q) const
{
    if ((p.distance > 0.0f) != (q.distance > 0.0f)) return kInfinity;
    if (!(p.distance > 0.0f)) return 0.0;
    const double normal = static_cast<double>(glm::distance(p.normal, q.normal));
    const double plane = std::abs(static_cast<double>(glm::dot(p.normal, q.position - p.position)));
    const double relative = plane / static_cast<double>(p.distance);
    const auto squared = [](double v) { return v * v; };
    return 0.5 * (squared(normal / options.normal_sigma) + squared(relative / options.plane_sigma));
}

Rgb Filter::filtered(int x, int y) const
{
    constexpr double kNegligible = 12.0;
    const Features& here = features(x, y);
    glm::dvec3 sum{light(x, y)};
    double weight = 1.0;
    const int r = options.window_radius;
    for (int qy = std::max(y - r, 0); qy <= std::min(y + r, light.height() - 1); ++qy)
        for (int qx = std::max(x - r, 0); qx <= std::min(x + r, light.width() - 1); ++qx) {
            if (qx == x && qy == y) continue;
            double distance = featureDistance(here, features(qx, qy));
            if (distance > kNegligible) continue;
            distance += patchDistance(x, y, qx, qy);
            if (distance > kNegligible) continue;
            const double w = std::exp(-distance);
            sum += w * glm::dvec3(light(qx, qy));
            weight += w;
        }
    return Rgb(sum / weight) * here.albedo;
}

}  // namespace

Image<Rgb> denoised(const RenderedImage& noisy,
                    const ObjectScene& scene,
                    const Camera& camera,
                    const DenoiseOptions& options)
{
    const int width = noisy.radiance.width();
    const int height = noisy.radiance.height();
    Filter filter{options,
                  Image<Features>(width, height),
                  Image<Rgb>(width, height),
                  Image<float>(width, height),
                  Image<float>(width, height)};
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            const Features features = featuresOf(scene, camera, x, y);
            const float albedo = luminance(features.albedo);
            filter.features(x, y) = features;
            filter.light(x, y) = noisy.radiance(x, y) / features.albedo;
            filter.brightness(x, y) = luminance(filter.light(x, y));
            filter.variance(x, y) = noisy.variance(x, y) / (albedo * albedo);
        }
    });
    filter.variance = smoothed(filter.variance);

    Image<Rgb> result(width, height);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x)
            result(x, y) = filter.filtered(x, y);
    });
    return result;
}

}  // namespace insitu
