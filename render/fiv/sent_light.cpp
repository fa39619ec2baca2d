#include "render/fiv/sent_light.h"

#include "core/parallel.h"
#include "lighting/sampling.h"
#include "render/fiv/object_samples.h"

namespace insitu {

namespace {

constexpr int kRays = 96;

}  // namespace

SentLight::SentLight(const ObjectScene& objects, std::span<const ObjectSample> samples)
{
    if (samples.empty()) return;
    spacing2_ = static_cast<float>(samples.front().area);
    for (const ObjectSample& sample : samples)
        samples_.push_back({glm::vec3(sample.point.position),
                            glm::vec3(sample.point.geometric_normal),
                            Rgb(0.0f)});
    open_.resize(samples.size());
    parallelFor(0, static_cast<std::int64_t>(samples.size()), [&](std::int64_t number) {
        const auto i = static_cast<std::size_t>(number);
        const glm::dvec3 normal = samples[i].point.geometric_normal;
        const glm::dvec3 start = objects.leave(samples[i].point, normal);
        const glm::dmat3 to_world = frameFromNormal(normal);
        int met = 0;
        for (int k = 0; k < kRays; ++k) {
            // Begun elsewhere at each sample.
            const glm::dvec2 begin(0.6180339887498949 * static_cast<double>(i));
            const glm::dvec3 direction = to_world * cosineHemisphere(r2Point(k, begin));
            met += objects.occluded(start, direction) ? 1 : 0;
        }
        open_[i] = 1.0f - static_cast<float>(met) / static_cast<float>(kRays);
    });
}

void SentLight::update(std::span<const Rgb> sent)
{
    for (std::size_t i = 0; i < samples_.size(); ++i)
        samples_[i].sent = sent[i];
}

Rgb SentLight::at(glm::dvec3 place, glm::dvec3 unit_normal) const
{
    const glm::vec3 x(place);
    const glm::vec3 n(unit_normal);
    Rgb sum(0.0f);
    float weights = 0.0f;
    for (const Sample& sample : samples_) {
        const float alike = glm::dot(sample.normal, n);
        const glm::vec3 way = sample.position - x;
        const float spread = glm::dot(way, way) + spacing2_;
        const float weight = alike > 0.0f ? alike * alike / (spread * spread) : 0.0f;
        sum += weight * sample.sent;
        weights += weight;
    }
    return weights > 0.0f ? sum / weights : Rgb(0.0f);
}

}  // namespace insitu
