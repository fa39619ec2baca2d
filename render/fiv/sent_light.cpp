#include "render/fiv/sent_light.h"

#include "core/parallel.h"
#include "lighting/sampling.h"
#include "render/fiv/object_samples.h"

#include <numbers>
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
            const glm::dvec2 begin(std::numbers::phi * static_cast<double>(i));
            const glm::dvec3 direction = to_world * cosineHemisphere(r2Point(k, begin));
            met += objects.occluded(start, direction) ? 1 : 0;
        }
        open_[i] = 1.0f - static_cast<float>(met) / static_cast<float>(kRays);
        bundles_[i / kLanes].open_area[i % kLanes] = static_cast<float>(samples[i].area) * open_[i];
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
template <SentLight::Weighing kWeighing>
INSITU_KERNEL void SentLight::sum(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    for (const Bundle& b : bundles_)
        for (std::size_t i = 0; i < kLanes; ++i) {
            const float dx = b.x[i] - x.x;
            const float dy = b.y[i] - x.y;
            const float dz = b.z[i] - x.z;
            float weight = 0.0f;
            if constexpr (kWeighing == Weighing::Alike) {
                const float alike = b.normal_x[i] * n.x + b.normal_y[i] * n.y + b.normal_z[i] * n.z;
                const float share =
                    (alike > 0.0f ? alike : 0.0f) / (dx * dx + dy * dy + dz * dz + spacing2_);
                weight = share * share;
            } else {
                const float here = dx * n.x + dy * n.y + dz * n.z;
                const float there = -(dx * b.normal_x[i] + dy * b.normal_y[i] + dz * b.normal_z[i]);
                const float square = dx * dx + dy * dy + dz * dz + 1e-12f;
                weight = (here > 0.0f ? here : 0.0f) * (there > 0.0f ? there : 0.0f) *
                         b.open_area[i] / (square * (square + b.open_area[i]));
            }
            sums[0][i] += weight;
            sums[1][i] += weight * b.red[i];
            sums[2][i] += weight * b.green[i];
            sums[3][i] += weight * b.blue[i];
        }
}

#if defined(__x86_64__)
template <SentLight::Weighing kWeighing>
INSITU_TARGET_AVX2 void SentLight::sumAvx2(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    sum<kWeighing>(x, n, sums);
}

template <SentLight::Weighing kWeighing>
INSITU_TARGET_AVX512 void SentLight::sumAvx512(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    sum<kWeighing>(x, n, sums);
}
#endif

template <SentLight::Weighing kWeighing>
Rgb SentLight::mean(InstructionSet isa, glm::dvec3 place, glm::dvec3 unit_normal) const
{
    const glm::vec3 x(place);
    const glm::vec3 n(unit_normal);
    Sums sums{};
#if defined(__x86_64__)
    if (isa == InstructionSet::Avx512)
        sumAvx512<kWeighing>(x, n, sums);
    else if (isa == InstructionSet::Avx2)
        sumAvx2<kWeighing>(x, n, sums);
    else
#endif
        sum<kWeighing>(x, n, sums);
    const auto total = [&](std::size_t k) {
        return std::accumulate(sums[k].begin(), sums[k].end(), 0.0f);
    };
    const float weight = total(0);
    return weight > 0.0f ? Rgb(total(1), total(2), total(3)) / weight : Rgb(0.0f);
}

Rgb SentLight::at(glm::dvec3 place, glm::dvec3 unit_normal, InstructionSet isa) const
{
    return mean<Weighing::Alike>(isa, place, unit_normal);
}

Rgb SentLight::seenFrom(glm::dvec3 place, glm::dvec3 unit_normal, InstructionSet isa) const
{
    return mean<Weighing::FormFactor>(isa, place, unit_normal);
}

}  // namespace insitu
