#include "render/fiv/object_bounce.h"

#include "core/parallel.h"
#include "lighting/sampling.h"
#include "render/fiv/object_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu {

namespace {

constexpr int kRays = 96;
/// Samples whose normals are less alike than this cosine do not stand for a surface that is met.
constexpr float kSameSide = 0.3f;

}  // namespace

ObjectBounce::ObjectBounce(const ObjectScene& objects, std::span<const ObjectSample> samples)
{
    if (samples.empty()) return;
    spacing2_ = static_cast<float>(samples.front().area);
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;
    for (const ObjectSample& sample : samples) {
        positions.emplace_back(sample.point.position);
        normals.emplace_back(sample.point.geometric_normal);
    }
    const auto nearest = [&](const SurfacePoint& point) {
        const glm::vec3 x(point.position);
        const glm::vec3 n(point.geometric_normal);
        std::uint32_t best = 0;
        float least = std::numeric_limits<float>::max();
        for (std::uint32_t i = 0; i < positions.size(); ++i) {
            const glm::vec3 way = positions[i] - x;
            const float distance = glm::dot(way, way);
            if (distance >= least || glm::dot(normals[i], n) < kSameSide) continue;
            least = distance;
            best = i;
        }
        return best;
    };
    seeing_.resize(samples.size());
    open_.resize(samples.size());
    const auto fraction = [](double value) {
        return static_cast<float>(value - std::floor(value));
    };
    parallelFor(0, static_cast<std::int64_t>(samples.size()), [&](std::int64_t number) {
        const auto i = static_cast<std::size_t>(number);
        Seeing& seeing = seeing_[i];
        seeing.position = positions[i];
        seeing.normal = normals[i];
        const glm::dvec3 normal = samples[i].point.geometric_normal;
        const glm::dvec3 start = objects.leave(samples[i].point, normal);
        const glm::dmat3 to_world = frameFromNormal(normal);
        for (int k = 0; k < kRays; ++k) {
            // Additive recurrence with the plastic number, begun elsewhere at each sample.
            const double shift = 0.6180339887498949 * static_cast<double>(i);
            const glm::dvec3 direction =
                to_world * cosineHemisphere({fraction(shift + 0.7548776662466927 * k),
                                             fraction(shift + 0.5698402909980532 * k)});
            if (const auto point = objects.intersect(start, direction))
                seeing.met.push_back(nearest(*point));
        }
        open_[i] = 1.0f - static_cast<float>(seeing.met.size()) / static_cast<float>(kRays);
        // Where rays meet nothing, what the atlas takes for hidden is the surface's own beginning.
        if (seeing.met.empty()) seeing.met.push_back(static_cast<std::uint32_t>(i));
        seeing.share = static_cast<float>(seeing.met.size()) / static_cast<float>(kRays);
    });
}

void ObjectBounce::update(std::span<const Rgb> sent)
{
    for (Seeing& seeing : seeing_) {
        Rgb sum(0.0f);
        for (const std::uint32_t sample : seeing.met)
            sum += sent[sample];
        seeing.radiance = sum / static_cast<float>(seeing.met.size());
    }
}

Rgb ObjectBounce::at(glm::dvec3 place, glm::dvec3 unit_normal) const
{
    const glm::vec3 x(place);
    const glm::vec3 n(unit_normal);
    Rgb sum(0.0f);
    float weights = 0.0f;
    for (const Seeing& seeing : seeing_) {
        const float alike = glm::dot(seeing.normal, n);
        const glm::vec3 way = seeing.position - x;
        const float spread = glm::dot(way, way) + spacing2_;
        const float weight = alike > 0.0f ? seeing.share * alike * alike / (spread * spread) : 0.0f;
        sum += weight * seeing.radiance;
        weights += weight;
    }
    return weights > 0.0f ? sum / weights : Rgb(0.0f);
}

}  // namespace insitu
