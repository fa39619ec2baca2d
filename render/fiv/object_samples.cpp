#include "render/fiv/object_samples.h"

#include "lighting/sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

}  // namespace

std::vector<ObjectSample> sampleObjects(const ObjectScene& objects, int count)
{
    struct Piece {
        std::size_t object = 0;
        std::size_t triangle = 0;
    };
    std::vector<Piece> pieces;
    std::vector<double> areas;
    double total = 0.0;
    for (std::size_t o = 0; o < objects.meshes().size(); ++o) {
        const TriangleMesh& mesh = objects.meshes()[o];
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            const glm::uvec3 corner = mesh.triangles[t];
            const glm::dvec3 a(mesh.positions[corner.x]);
            total += 0.5 * glm::length(glm::cross(glm::dvec3(mesh.positions[corner.y]) - a,
                                                  glm::dvec3(mesh.positions[corner.z]) - a));
            areas.push_back(total);
            pieces.push_back({o, t});
        }
    }
    std::vector<ObjectSample> samples;
    if (!(total > 0.0)) return samples;
    for (int i = 0; i < count; ++i) {
        const double wanted = (i + 0.5) / count * total;
        const auto found = std::lower_bound(areas.begin(), areas.end(), wanted);
        const Piece piece = pieces[static_cast<std::size_t>(
            std::min(found - areas.begin(), static_cast<std::ptrdiff_t>(areas.size()) - 1))];
        const TriangleMesh& mesh = objects.meshes()[piece.object];
        const glm::uvec3 corner = mesh.triangles[piece.triangle];
        const glm::dvec3 a(mesh.positions[corner.x]);
        const glm::dvec3 u = glm::dvec3(mesh.positions[corner.y]) - a;
        const glm::dvec3 v = glm::dvec3(mesh.positions[corner.z]) - a;
        const glm::dvec3 across = glm::cross(u, v);
        if (!(glm::length(across) > 0.0)) continue;
        glm::dvec2 inside = r2Point(i);
        if (inside.x + inside.y > 1.0) inside = 1.0 - inside;
        const glm::dvec3 place = a + inside.x * u + inside.y * v;
        const glm::dvec3 normal = glm::normalize(across);
        const double off = 1e-4 * std::sqrt(total);
        for (const double side : {1.0, -1.0}) {
            const auto point =
                objects.intersect(place + side * off * normal, -side * normal, 2.0 * off);
            if (point) samples.push_back({*point, total / count});
        }
    }
    return samples;
}

void setSent(FivScene& scene,
             std::span<const ObjectSample> samples,
             std::span<const Rgb> irradiance)
{
    std::vector<Rgb> sent(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const SurfaceMaterial& m = samples[i].point.material;
        sent[i] = m.emissive + evenReflectance(m) * irradiance[i] / kPi;
    }
    scene.sent.update(sent);
}

}  // namespace insitu
