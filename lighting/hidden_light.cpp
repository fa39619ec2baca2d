#include "lighting/hidden_light.h"

#include "core/check.h"
#include "core/parallel.h"
#include "lighting/fiv_kernel.h"

#include <algorithm>
#include <cmath>
#include <memory>

namespace insitu {

namespace {

using fiv::Block;
using fiv::Group;
using fiv::Source;
using fiv::Sum;

/// Lists the light of directions the way the kernel wants it.
Source sourceOf(const SilhouetteSet& set,
                std::span<const IrradianceVector> along,
                std::span<const IrradianceVector> against,
                Sum sum,
                glm::vec3 normal)
{
    Source source;
    source.set = &set;
    source.shines.resize(set.frames.size());
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

std::vector<Source> sourcesOf(const ObjectLight& object, Sum sum, glm::vec3 normal)
{
    std::vector<Source> sources;
    sources.push_back(
        sourceOf(object.atlas->silhouettes, object.light.along, object.light.against, sum, normal));
    if (!object.fine.frames.empty())
        sources.push_back(sourceOf(object.fine, object.light.fine, {}, sum, normal));
    return sources;
}

bool isFinite(glm::vec3 v)
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Fills a block with the places (and normals) from `begin` on, and the ball around it.
void fillBlock(Group& group,
               std::size_t index,
               std::span<const glm::vec3> places,
               std::span<const glm::vec3> normals,
               std::size_t begin)
{
    Block& block = group.blocks[index];
    glm::vec3 low = places[std::min(begin, places.size() - 1)];
    glm::vec3 high = low;
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
    }
    for (auto& row : block.sums)
        std::fill(std::begin(row), std::end(row), 0.0f);
    const glm::vec3 center = 0.5f * (low + high);
    group.x[index] = center.x;
    group.y[index] = center.y;
    group.z[index] = center.z;
    // A little more, for rounding.
    group.radius[index] = 0.5f * glm::length(high - low) * 1.001f + 1e-5f * glm::length(center);
}

/// Calls take(block, place, i) with the sums of every place.
template <class Take>
void sumHidden(const std::vector<Source>& sources,
               Sum sum,
               std::span<const glm::vec3> places,
               std::span<const glm::vec3> normals,
               float bias_texels,
               const Take& take)
{
    constexpr std::size_t kPlaces = std::size_t{Group::kBlocks} * Block::kSize;
    const std::size_t groups = (places.size() + kPlaces - 1) / kPlaces;
    parallelFor(0, static_cast<std::int64_t>(groups), [&](std::int64_t task) {
        const std::size_t begin = static_cast<std::size_t>(task) * kPlaces;
        const std::size_t end = std::min(begin + kPlaces, places.size());
        const auto group = std::make_unique<Group>();
        group->count = static_cast<int>((end - begin + Block::kSize - 1) / Block::kSize);
        for (std::size_t b = 0; b < Group::kBlocks; ++b)
            fillBlock(*group, b, places, normals, begin + b * Block::kSize);
        for (const Source& source : sources)
            fiv::addHidden(fiv::bestIsa(), sum, source, bias_texels, *group);
        for (std::size_t i = begin; i < end; ++i)
            take(group->blocks[(i - begin) / Block::kSize], i, (i - begin) % Block::kSize);
    });
}

Rgb irradianceAt(const Block& block, std::size_t i)
{
    return {block.sums[0][i], block.sums[1][i], block.sums[2][i]};
}

}  // namespace

Findings FineSilhouetteOptions::validate() const
{
    Findings problems;
    if (resolution < 16 || resolution > 2048)
        problems.push_back({Severity::Error,
                            "fine-silhouette-options",
                            fmt::format("resolution is {}, not in [16, 2048]", resolution)});
    if (samples < 1 || samples > 8)
        problems.push_back({Severity::Error,
                            "fine-silhouette-options",
                            fmt::format("samples is {}, not in [1, 8]", samples)});
    return problems;
}

ObjectLight lightObject(const TriangleMesh& mesh,
                        const VisibilityAtlas& atlas,
                        CellLight light,
                        const FineSilhouetteOptions& options,
                        Progress& progress)
{
    requireValid(options.validate(), "fine silhouette options");
    INSITU_CHECK(light.along.size() == atlas.cells().pairCount() &&
                     light.against.size() == light.along.size() &&
                     light.fine.size() == light.fine_directions.size(),
                 "light of {} pairs for an atlas of {}",
                 light.along.size(),
                 atlas.cells().pairCount());
    ObjectLight object{&atlas, std::move(light), {}};
    if (object.light.fine_directions.empty()) return object;
    object.fine = drawSilhouettes(
        mesh, object.light.fine_directions, options.resolution, options.samples, progress);
    INSITU_CHECK(object.fine.local.radius == object.local().radius &&
                     object.fine.local.center == object.local().center,
                 "another mesh than the atlas's");
    return object;
}

void hiddenVectors(const ObjectLight& object,
                   std::span<const glm::vec3> places,
                   std::span<IrradianceVector> hidden,
                   float bias_texels)
{
    INSITU_CHECK(places.size() == hidden.size(), "{} for {}", hidden.size(), places.size());
    sumHidden(sourcesOf(object, Sum::Vectors, {}),
              Sum::Vectors,
              places,
              {},
              bias_texels,
              [&](const Block& block, std::size_t place, std::size_t i) {
                  for (int c = 0; c < 3; ++c)
                      for (int axis = 0; axis < 3; ++axis)
                          hidden[place].channels[static_cast<std::size_t>(c)][axis] =
                              block.sums[3 * c + axis][i];
              });
}

void hiddenIrradiance(const ObjectLight& object,
                      std::span<const glm::vec3> places,
                      std::span<const glm::vec3> unit_normals,
                      std::span<Rgb> hidden,
                      float bias_texels)
{
    INSITU_CHECK(places.size() == hidden.size() && places.size() == unit_normals.size(),
                 "{} and {} for {}",
                 hidden.size(),
                 unit_normals.size(),
                 places.size());
    sumHidden(sourcesOf(object, Sum::PerPlace, {}),
              Sum::PerPlace,
              places,
              unit_normals,
              bias_texels,
              [&](const Block& block, std::size_t place, std::size_t i) {
                  hidden[place] = irradianceAt(block, i);
              });
}

void hiddenIrradiance(const ObjectLight& object,
                      std::span<const glm::vec3> places,
                      glm::vec3 unit_normal,
                      std::span<Rgb> hidden,
                      float bias_texels)
{
    INSITU_CHECK(places.size() == hidden.size(), "{} for {}", hidden.size(), places.size());
    sumHidden(sourcesOf(object, Sum::Irradiance, unit_normal),
              Sum::Irradiance,
              places,
              {},
              bias_texels,
              [&](const Block& block, std::size_t place, std::size_t i) {
                  hidden[place] = irradianceAt(block, i);
              });
}

}  // namespace insitu
