#include "render/bsdf/ggx.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu::ggx {

using std::numbers::pi;

double distribution(glm::dvec3 h, double alpha)
{
    if (!(h.z > 0.0)) return 0.0;
    // [Walter07] eq. 33, with sin² from x and y: exact for the narrowest lobes too.
    const double a2 = alpha * alpha;
    const double stretched = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    return 1.0 / (pi * a2 * stretched * stretched);
}

double masking(glm::dvec3 w, double alpha)
{
    // [Walter07] eq. 34: 2 cos / (cos + sqrt(α² sin² + cos²)).
    const double sin2 = w.x * w.x + w.y * w.y;
    return 2.0 * w.z / (w.z + std::sqrt(alpha * alpha * sin2 + w.z * w.z));
}

double visibility(glm::dvec3 wo, glm::dvec3 wi, double alpha)
{
    // [Heitz14] eq. 99: G2 = 1 / (1 + Λ(wo) + Λ(wi)); dividing by 4 cos_o cos_i gives this.
    const double a2 = alpha * alpha;
    const double root_o = std::sqrt(a2 * (wo.x * wo.x + wo.y * wo.y) + wo.z * wo.z);
    const double root_i = std::sqrt(a2 * (wi.x * wi.x + wi.y * wi.y) + wi.z * wi.z);
    return 0.5 / (wi.z * root_o + wo.z * root_i);
}

glm::dvec3 drawVisibleNormal(glm::dvec3 wo, double alpha, glm::dvec2 u)
{
    // Stretch the view so that the facets become a unit hemisphere.
    const glm::dvec3 view = glm::normalize(glm::dvec3(alpha * wo.x, alpha * wo.y, wo.z));

    // Point on the disc that the hemisphere shows to the view.
    const double length2 = view.x * view.x + view.y * view.y;
    const glm::dvec3 tangent = length2 > 0.0 ? glm::dvec3(-view.y, view.x, 0.0) / std::sqrt(length2)
                                             : glm::dvec3(1.0, 0.0, 0.0);
    const glm::dvec3 bitangent = glm::cross(view, tangent);
    const double radius = std::sqrt(u.x);
    const double angle = 2.0 * pi * u.y;
    const double p1 = radius * std::cos(angle);
    const double blend = 0.5 * (1.0 + view.z);
    const double p2 =
        (1.0 - blend) * std::sqrt(std::max(0.0, 1.0 - p1 * p1)) + blend * radius * std::sin(angle);

    // Lift it onto the hemisphere and undo the stretch.
    const double p3 = std::sqrt(std::max(0.0, 1.0 - p1 * p1 - p2 * p2));
    const glm::dvec3 normal = p1 * tangent + p2 * bitangent + p3 * view;
    return glm::normalize(
        glm::dvec3(alpha * normal.x, alpha * normal.y, std::max(1e-12, normal.z)));
}

}  // namespace insitu::ggx
