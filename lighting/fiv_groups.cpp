#include "lighting/fiv_groups.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>

namespace insitu::fiv {

namespace {

bool isFinite(glm::vec3 v)
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

}  // namespace

Source sourceOf(const SilhouetteSet* set,
                std::span<const IrradianceVector> along,
                std::span<const IrradianceVector> against,
                Sum sum,
                glm::vec3 normal)
{
    Source source;
    source.set = set;
    source.shines.resize(along.size());
    const auto list = [&](std::span<const IrradianceVector> light, unsigned bit) {
        std::vector<float> flux;
        flux.reserve(light.size() * static_cast<std::size_t>(fluxNumbers(sum)));
        for (std::size_t i = 0; i < light.size(); ++i) {
            bool shines = false;
            for (const glm::vec3& channel : light[i].channels) {
                if (sum == Sum::Irradiance) {
                    flux.push_back(std::max(0.0f, glm::dot(channel, normal)));
                    shines = shines || flux.back() > 0.0f;
                    continue;
                }
                for (int axis = 0; axis < 3; ++axis)
                    flux.push_back(channel[axis]);
                shines = shines || channel != glm::vec3(0.0f);
            }
            if (shines) source.shines[i] = static_cast<std::uint8_t>(source.shines[i] | bit);
        }
        return flux;
    };
    source.along = list(along, 1u);
    source.against = list(against, 2u);
    return source;
}

Source sourceOfCorners(const SilhouetteSet& set, const CornerIrradiance& light)
{
    using Corners = CornerIrradiance::Corners;
    Source source;
    source.set = &set;
    source.shines.resize(light.along.size());
    const auto list =
        [&](const std::vector<Corners>& from, const std::vector<float>& sky, unsigned bit) {
            std::vector<float> flux;
            flux.reserve(from.size() * fluxNumbers(Sum::Corners));
            for (std::size_t i = 0; i < from.size(); ++i) {
                for (const Rgb& corner : from[i])
                    flux.insert(flux.end(), {corner.r, corner.g, corner.b});
                flux.push_back(sky[i]);
                if (from[i] != Corners{} || sky[i] != 0.0f)
                    source.shines[i] = static_cast<std::uint8_t>(source.shines[i] | bit);
            }
            return flux;
        };
    source.along = list(light.along, light.sky_along, 1u);
    source.against = list(light.against, light.sky_against, 2u);
    return source;
}

std::size_t placesOfGroup(std::size_t places)
{
    constexpr std::size_t kGroups = 16;
    constexpr std::size_t kLeast = 16 * Block::kSize;
    constexpr std::size_t kMost = std::size_t{Group::kBlocks} * Block::kSize;
    const std::size_t share = places / kGroups + 1;
    return std::clamp((share + kLeast - 1) / kLeast * kLeast, kLeast, kMost);
}

void fillBlock(Group& group,
               std::size_t index,
               std::span<const glm::vec3> places,
               std::span<const glm::vec3> normals,
               std::size_t begin)
{
    Block& block = group.blocks[index];
    glm::vec3 low = places[std::min(begin, places.size() - 1)];
    glm::vec3 high = low;
    NormalBounds bounds;
    if (!normals.empty()) bounds.low = bounds.high = normals[std::min(begin, places.size() - 1)];
    for (std::size_t i = 0; i < Block::kSize; ++i) {
        const std::size_t from = std::min(begin + i, places.size() - 1);
        const glm::vec3 p = places[from];
        INSITU_CHECK(isFinite(p), "place {} is ({}, {}, {})", from, p.x, p.y, p.z);
        block.x[i] = p.x;
        block.y[i] = p.y;
        block.z[i] = p.z;
        low = glm::min(low, p);
        high = glm::max(high, p);
        if (normals.empty()) continue;
        block.nx[i] = normals[from].x;
        block.ny[i] = normals[from].y;
        block.nz[i] = normals[from].z;
        bounds.low = glm::min(bounds.low, normals[from]);
        bounds.high = glm::max(bounds.high, normals[from]);
    }
    group.normals[index] = bounds;
    NormalBounds& all = group.all_normals;
    if (index == 0) all = bounds;
    all = {glm::min(all.low, bounds.low), glm::max(all.high, bounds.high)};
    std::fill(std::begin(block.uniform), std::end(block.uniform), 0.0f);
    for (auto& row : block.sums)
        std::fill(std::begin(row), std::end(row), 0.0f);
    const glm::vec3 center = 0.5f * (low + high);
    group.x[index] = center.x;
    group.y[index] = center.y;
    group.z[index] = center.z;
    // A little more, for rounding.
    group.radius[index] = 0.5f * glm::length(high - low) * 1.001f + 1e-5f * glm::length(center);
}

}  // namespace insitu::fiv
