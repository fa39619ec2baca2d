#include "render/fiv/object_sharing.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr int kRadius = 4;  ///< pixels
constexpr float kSpatialSigma = 2.5f;
/// Deviation of normals between which the hidden share of light changes little.
constexpr float kNormalSigma = 0.3f;
/// The same for lobes, in shares of their alpha: reflected directions turn twice as far.
constexpr float kLobeSigma = 0.3f;
constexpr float kLeastAlpha = 0.02f;
/// Of depth between neighbours, per pixel of distance.
constexpr float kDepthSlope = 0.01f;

/// exp(-factor·x²) of a Gaussian.
float sharpness(float sigma)
{
    return 0.5f / (sigma * sigma);
}

/// What a pixel and its neighbours know together.
struct Shared {
    RayLight rays;
    float weight = 0.0f;
    Rgb gathered{0.0f};
    Rgb glossy{0.0f};
};

class Neighbourhood {
public:
    Neighbourhood(std::span<const ObjectPixel> pixels, int width, int height)
        : pixels_(pixels), number_(width, height, kNone)
    {
        for (std::size_t i = 0; i < pixels.size(); ++i)
            number_(pixels[i].pixel.x, pixels[i].pixel.y) = static_cast<std::uint32_t>(i);
    }

    [[nodiscard]] Shared around(const ObjectPixel& here) const
    {
        const float alpha = std::max(here.roughness * here.roughness, kLeastAlpha);
        const float lobe = sharpness(kLobeSigma * alpha);
        const glm::ivec2 low = glm::max(here.pixel - kRadius, 0);
        const glm::ivec2 high =
            glm::min(here.pixel + kRadius, glm::ivec2(number_.width(), number_.height()) - 1);
        Shared shared;
        for (int y = low.y; y <= high.y; ++y)
            for (int x = low.x; x <= high.x; ++x) {
                if (number_(x, y) == kNone) continue;
                const ObjectPixel& there = pixels_[number_(x, y)];
                if (there.object != here.object) continue;
                const glm::vec2 way(there.pixel - here.pixel);
                const float away2 = glm::dot(way, way);
                const float step = std::abs(there.depth_m / here.depth_m - 1.0f);
                if (step > kDepthSlope * (1.0f + std::sqrt(away2))) continue;
                const glm::vec3 turn = there.normal - here.normal;
                const float near = away2 * sharpness(kSpatialSigma);
                const float turned2 = glm::dot(turn, turn);
                if (there.one_place) {
                    const float weight = std::exp(-near - turned2 * sharpness(kNormalSigma));
                    shared.rays += weight * there.rays;
                    shared.weight += weight;
                }
                if (there.glossy == Rgb(0.0f)) continue;
                const float glossy_weight = std::exp(-near - turned2 * lobe);
                shared.gathered += glossy_weight * there.gathered;
                shared.glossy += glossy_weight * there.glossy;
            }
        return shared;
    }

private:
    static constexpr std::uint32_t kNone = 0xffffffff;
    std::span<const ObjectPixel> pixels_;
    Image<std::uint32_t> number_;
};

}  // namespace

Rgb RayLight::open() const
{
    Rgb share(0.0f);
    for (int c = 0; c < 3; ++c)
        if (all[c] > 0.0f) share[c] = std::clamp(passed[c] / all[c], 0.0f, 1.0f);
    return share;
}

void addShared(std::span<const ObjectPixel> pixels, Image<Rgb>& picture)
{
    constexpr std::int64_t kRun = 1024;
    const Neighbourhood neighbours(pixels, picture.width(), picture.height());
    const auto count = static_cast<std::int64_t>(pixels.size());
    parallelFor(0, (count + kRun - 1) / kRun, [&](std::int64_t run) {
        for (std::int64_t i = run * kRun; i < std::min(count, (run + 1) * kRun); ++i) {
            const ObjectPixel& here = pixels[static_cast<std::size_t>(i)];
            const Shared shared = neighbours.around(here);
            Rgb& radiance = picture(here.pixel.x, here.pixel.y);
            const RayLight rays = here.one_place ? 1.0f / shared.weight * shared.rays : here.rays;
            radiance += here.matt_open * rays.open() + here.matt * rays.sent;
            for (int c = 0; c < 3; ++c)
                if (shared.glossy[c] > 0.0f)
                    radiance[c] += here.glossy[c] * (shared.gathered[c] / shared.glossy[c]);
        }
    });
}

}  // namespace insitu
