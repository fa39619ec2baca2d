#include "pipeline/common_surfaces.h"

#include "core/color.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Pixels that are looked at, about: enough for medians.
constexpr double kPixels = 60000.0;

}  // namespace

std::vector<CommonPixel> commonPixels(const Camera& camera,
                                      const SceneProxy& proxy,
                                      const EnvironmentMap& probe,
                                      glm::dvec3 probe_center_m)
{
    const double count = static_cast<double>(camera.width) * camera.height;
    const int stride = std::max(1, static_cast<int>(std::sqrt(count / kPixels)));
    std::vector<CommonPixel> pixels;
    for (int y = stride / 2; y < camera.height; y += stride)
        for (int x = stride / 2; x < camera.width; x += stride) {
            const auto hit =
                proxy.intersect(camera.position_m, camera.rayDirection({x + 0.5, y + 0.5}));
            if (!hit || hit->opening || proxy.faces()[hit->face].solid) continue;
            const glm::dvec3 way = hit->point - probe_center_m;
            const ProxyFace& face = proxy.faces()[hit->face];
            if ((!face.two_sided && glm::dot(way, face.normal) >= 0.0) ||
                !proxy.mutuallyVisible(probe_center_m, hit->point))
                continue;
            const glm::dvec3 direction = glm::normalize(way);
            const Rgb seen = lookUp(probe, direction);
            if (!(luminance(seen) > 0.0f) || lookUpClipped(probe, direction) != Rgb(0.0f)) continue;
            pixels.push_back({{x, y}, seen, hit->face});
        }
    return pixels;
}

}  // namespace insitu
