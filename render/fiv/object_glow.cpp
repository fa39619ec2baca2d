#include "render/fiv/object_glow.h"

#include <numeric>

namespace insitu {

void ObjectGlow::add(glm::dvec3 position, glm::dvec3 normal, double area, Rgb radiance)
{
    const std::size_t lane = count_++ % kLanes;
    if (lane == 0) bundles_.emplace_back();
    Bundle& b = bundles_.back();
    b.x[lane] = static_cast<float>(position.x);
    b.y[lane] = static_cast<float>(position.y);
    b.z[lane] = static_cast<float>(position.z);
    b.normal_x[lane] = static_cast<float>(normal.x);
    b.normal_y[lane] = static_cast<float>(normal.y);
    b.normal_z[lane] = static_cast<float>(normal.z);
    b.area[lane] = static_cast<float>(area);
    b.red[lane] = radiance.r;
    b.green[lane] = radiance.g;
    b.blue[lane] = radiance.b;
}

struct ObjectGlow::Sums {
    Lanes form{}, red{}, green{}, blue{};
};

// Lane by lane, so that the order of sums does not depend on a vector's width.
INSITU_KERNEL void ObjectGlow::sum(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    for (const Bundle& b : bundles_)
        for (std::size_t i = 0; i < kLanes; ++i) {
            const float dx = b.x[i] - x.x;
            const float dy = b.y[i] - x.y;
            const float dz = b.z[i] - x.z;
            const float here = dx * n.x + dy * n.y + dz * n.z;
            const float there = -(dx * b.normal_x[i] + dy * b.normal_y[i] + dz * b.normal_z[i]);
            const float square = dx * dx + dy * dy + dz * dz + 1e-12f;
            const float facing =
                (here > 0.0f ? here : 0.0f) * (there > 0.0f ? there : 0.0f) * b.area[i] / square;
            const float form = facing / (square + b.area[i]);
            sums.form[i] += form;
            sums.red[i] += form * b.red[i];
            sums.green[i] += form * b.green[i];
            sums.blue[i] += form * b.blue[i];
        }
}

#if defined(__x86_64__)
INSITU_TARGET_AVX2 void ObjectGlow::sumAvx2(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    sum(x, n, sums);
}

INSITU_TARGET_AVX512 void ObjectGlow::sumAvx512(glm::vec3 x, glm::vec3 n, Sums& sums) const
{
    sum(x, n, sums);
}
#endif

Rgb ObjectGlow::seenFrom(glm::dvec3 place, glm::dvec3 unit_normal) const
{
    return seenFrom(bestInstructionSet(), place, unit_normal);
}

Rgb ObjectGlow::seenFrom(InstructionSet isa, glm::dvec3 place, glm::dvec3 unit_normal) const
{
    const glm::vec3 x(place);
    const glm::vec3 n(unit_normal);
    Sums sums;
#if defined(__x86_64__)
    if (isa == InstructionSet::Avx512)
        sumAvx512(x, n, sums);
    else if (isa == InstructionSet::Avx2)
        sumAvx2(x, n, sums);
    else
#endif
        sum(x, n, sums);
    const auto total = [](const Lanes& of) { return std::accumulate(of.begin(), of.end(), 0.0f); };
    const float form = total(sums.form);
    return form > 0.0f ? Rgb(total(sums.red), total(sums.green), total(sums.blue)) / form
                       : Rgb(0.0f);
}

}  // namespace insitu
