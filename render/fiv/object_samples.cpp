#include "render/fiv/object_samples.h"

#include "core/parallel.h"
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

std::vector<float> samplesSeen(const FivScene& scene, std::span<const ObjectSample> samples)
{
    const DirectionCells& cells = scene.coarse_cells->cells;
    std::vector<float> seen(cells.pairCount() * samples.size());
    parallelFor(0, static_cast<std::int64_t>(cells.pairCount()), [&](std::int64_t number) {
        const auto pair = static_cast<std::size_t>(number);
        const glm::dvec3 direction = cells.direction(pair);
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const double cosine = glm::dot(samples[i].point.geometric_normal, direction);
            const glm::dvec3 away = cosine > 0.0 ? direction : -direction;
            if (!scene.objects.occluded(scene.objects.leave(samples[i].point, away), away))
                seen[pair * samples.size() + i] = static_cast<float>(cosine * samples[i].area);
        }
    });
    return seen;
}

void setGlow(FivScene& scene,
             std::span<const ObjectSample> samples,
             std::span<const float> seen,
             std::span<const Rgb> irradiance)
{
    const std::size_t pairs = scene.coarse_cells->cells.pairCount();
    std::vector<Rgb> sent(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const SurfaceMaterial& m = samples[i].point.material;
        sent[i] = m.emissive + evenReflectance(m) * irradiance[i] / kPi;
    }
    std::vector<Rgb> glow(2 * pairs, Rgb(0.0f));
    ObjectGlow near;
    // What lies deep in a hollow, or inside, hardly shows to what is outside.
    for (std::size_t i = 0; i < samples.size(); ++i)
        near.add(samples[i].point.position,
                 samples[i].point.geometric_normal,
                 samples[i].area * static_cast<double>(scene.sent.open(i)),
                 sent[i]);
    scene.near = std::move(near);
    scene.sent.update(sent);
    parallelFor(0, static_cast<std::int64_t>(pairs), [&](std::int64_t number) {
        const auto pair = static_cast<std::size_t>(number);
        glm::dvec3 sums[2] = {glm::dvec3(0.0), glm::dvec3(0.0)};
        double weights[2] = {0.0, 0.0};
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const double weight = seen[pair * samples.size() + i];
            // What faces ω is seen by those who look along −ω.
            const int side = weight > 0.0 ? 1 : 0;
            sums[side] += std::abs(weight) * glm::dvec3(sent[i]);
            weights[side] += std::abs(weight);
        }
        for (int side = 0; side < 2; ++side)
            if (weights[side] > 0.0)
                glow[2 * pair + static_cast<std::size_t>(side)] = Rgb(sums[side] / weights[side]);
    });
    scene.glow = std::move(glow);
}

}  // namespace insitu
