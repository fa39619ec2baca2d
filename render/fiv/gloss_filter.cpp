#include "render/fiv/gloss_filter.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kRadius = 4;  ///< pixels
constexpr float kSpatialSigma = 2.5f;
/// Deviation of normals in shares of the lobe's alpha: reflected directions turn twice as far.
constexpr float kNormalSigma = 0.3f;
constexpr float kLeastAlpha = 0.02f;
/// Of depth between neighbours, per pixel of distance.
constexpr float kDepthSlope = 0.01f;

}  // namespace

GlossPixels::GlossPixels(int width, int height)
    : gathered(width, height, Rgb(0.0f)),
      reflectance(width, height, Rgb(0.0f)),
      normal(width, height, glm::vec3(0.0f)),
      roughness(width, height, 0.0f),
      depth_m(width, height, 0.0f),
      object(width, height, 0u)
{
}

void addSmoothedGloss(const GlossPixels& gloss, Image<Rgb>& picture)
{
    const int width = picture.width();
    const int height = picture.height();
    const auto lit = [&](int x, int y) { return gloss.reflectance(x, y) != Rgb(0.0f); };
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (!lit(x, y)) continue;
            const float alpha =
                std::max(gloss.roughness(x, y) * gloss.roughness(x, y), kLeastAlpha);
            const float sharpness = 0.5f / (kNormalSigma * alpha * kNormalSigma * alpha);
            Rgb gathered(0.0f);
            Rgb reflectance(0.0f);
            for (int v = std::max(y - kRadius, 0); v <= std::min(y + kRadius, height - 1); ++v)
                for (int u = std::max(x - kRadius, 0); u <= std::min(x + kRadius, width - 1); ++u) {
                    if (!lit(u, v) || gloss.object(u, v) != gloss.object(x, y)) continue;
                    const auto away2 = static_cast<float>((u - x) * (u - x) + (v - y) * (v - y));
                    const float step = std::abs(gloss.depth_m(u, v) / gloss.depth_m(x, y) - 1.0f);
                    if (step > kDepthSlope * (1.0f + std::sqrt(away2))) continue;
                    const glm::vec3 turned = gloss.normal(u, v) - gloss.normal(x, y);
                    const float weight =
                        std::exp(-away2 * (0.5f / (kSpatialSigma * kSpatialSigma)) -
                                 glm::dot(turned, turned) * sharpness);
                    gathered += weight * gloss.gathered(u, v);
                    reflectance += weight * gloss.reflectance(u, v);
                }
            for (int c = 0; c < 3; ++c)
                if (reflectance[c] > 0.0f)
                    picture(x, y)[c] += gloss.reflectance(x, y)[c] * (gathered[c] / reflectance[c]);
        }
    });
}

}  // namespace insitu
