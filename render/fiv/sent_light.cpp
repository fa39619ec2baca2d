#include "render/fiv/sent_light.h"

#include "core/parallel.h"
#include "lighting/sampling.h"
#include "render/fiv/object_samples.h"

#include <numeric>

namespace insitu {

namespace {

constexpr int kRays = 96;

}  // namespace

SentLight::SentLight(const ObjectScene& objects, std::span<const ObjectSample> samples)
{
    if (samples.empty()) return;
    spacing2_ = static_cast<float>(samples.front().area);
    bundles_.resize((samples.size() + kLanes - 1) / kLanes);
    for (std::size_t i = 0; i < samples.size(); ++i) {
        Bundle& b = bundles_[i / kLanes];
        const std::size_t lane = i % kLanes;
        const glm::vec3 position(samples[i].point.position);
        const glm::vec3 normal(samples[i].point.geometric_normal);
        b.x[lane] = position.x;
        b.y[lane] = position.y;
        b.z[lane] = position.z;
        b.normal_x[lane] = normal.x;
        b.normal_y[lane] = normal.y;
        b.normal_z[lane] = normal.z;
    }
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
    for (std::size_t i = 0; i < sent.size(); ++i) {
        Bundle& b = bundles_[i / kLanes];
        const std::size_t lane = i % kLanes;
        b.red[lane] = sent[i].r;
        b.green[lane] = sent[i].g;
        b.blue[lane] = sent[i].b;
    }
}

// Lane by lane, so that the order of sums does not depend on a vector's width.
INSITU_KERNEL void SentLight::sum(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    for (const Bundle& b : bundles_)
        for (std::size_t i = 0; i < kLanes; ++i) {
            const float alike = b.normal_x[i] * n.x + b.normal_y[i] * n.y + b.normal_z[i] * n.z;
            const float facing = alike > 0.0f ? alike : 0.0f;
            const float dx = b.x[i] - x.x;
            const float dy = b.y[i] - x.y;
            const float dz = b.z[i] - x.z;
            const float spread = dx * dx + dy * dy + dz * dz + spacing2_;
            const float share = facing / spread;
            const float weight = share * share;
            sums[0][i] += weight;
            sums[1][i] += weight * b.red[i];
            sums[2][i] += weight * b.green[i];
            sums[3][i] += weight * b.blue[i];
        }
}

#if defined(__x86_64__)
INSITU_TARGET_AVX2 void SentLight::sumAvx2(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    sum(x, n, sums);
}

INSITU_TARGET_AVX512 void SentLight::sumAvx512(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    sum(x, n, sums);
}
#endif

Rgb SentLight::at(glm::dvec3 place, glm::dvec3 unit_normal) const
{
    return at(bestInstructionSet(), place, unit_normal);
}

Rgb SentLight::at(InstructionSet isa, glm::dvec3 place, glm::dvec3 unit_normal) const
{
    const glm::vec3 x(place);
    const glm::vec3 n(unit_normal);
    Sums sums{};
#if defined(__x86_64__)
    if (isa == InstructionSet::Avx512)
        sumAvx512(x, n, sums);
    else if (isa == InstructionSet::Avx2)
        sumAvx2(x, n, sums);
    else
#endif
        sum(x, n, sums);
    const auto total = [&](std::size_t k) {
        return std::accumulate(sums[k].begin(), sums[k].end(), 0.0f);
    };
    const float weight = total(0);
    return weight > 0.0f ? Rgb(total(1), total(2), total(3)) / weight : Rgb(0.0f);
}

}  // namespace insitu
