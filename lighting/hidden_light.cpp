#include "lighting/hidden_light.h"

#include "core/check.h"
#include "core/parallel.h"
#include "lighting/fiv_groups.h"

#include <algorithm>
#include <memory>

namespace insitu {

namespace {

using fiv::Block;
using fiv::Group;
using fiv::Source;
using fiv::Sum;

std::vector<Source> sourcesOf(const ObjectLight& object, Sum sum, glm::vec3 normal)
{
    std::vector<Source> sources;
    sources.push_back(sourceOf(
        &object.atlas->silhouettes, object.light.along, object.light.against, sum, normal));
    if (!object.fine.frames.empty())
        sources.push_back(sourceOf(&object.fine, object.light.fine, {}, sum, normal));
    return sources;
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
    const std::size_t group_places = fiv::placesOfGroup(places.size());
    const std::size_t groups = (places.size() + group_places - 1) / group_places;
    parallelFor(0, static_cast<std::int64_t>(groups), [&](std::int64_t task) {
        const std::size_t begin = static_cast<std::size_t>(task) * group_places;
        const std::size_t end = std::min(begin + group_places, places.size());
        const auto group = std::make_unique<Group>();
        group->resize((end - begin + Block::kSize - 1) / Block::kSize);
        for (std::size_t b = 0; b < group->filled(); ++b)
            fiv::fillBlock(*group, b, places, normals, begin + b * Block::kSize);
        for (const Source& source : sources)
            fiv::addHidden(bestInstructionSet(), sum, source, bias_texels, *group);
        for (std::size_t i = begin; i < end; ++i)
            take(group->blocks[(i - begin) / Block::kSize], i, (i - begin) % Block::kSize);
    });
}

void checkLight(const CornerIrradiance& light, const VisibilityAtlas& atlas)
{
    INSITU_CHECK(light.along.size() == atlas.cells().pairCount() &&
                     light.against.size() == light.along.size(),
                 "light of {} pairs for an atlas of {}",
                 light.along.size(),
                 atlas.cells().pairCount());
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
                  hidden[place] = fiv::vectorOf(block, i);
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
                  hidden[place] = fiv::irradianceOf(block, i);
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
                  hidden[place] = fiv::irradianceOf(block, i);
              });
}

void hiddenIrradiance(const VisibilityAtlas& atlas,
                      const CornerIrradiance& light,
                      std::span<const glm::vec3> places,
                      std::span<const std::array<float, 4>> weights,
                      std::span<HiddenIrradiance> hidden,
                      float bias_texels)
{
    INSITU_CHECK(places.size() == hidden.size() && places.size() == weights.size(),
                 "{} and {} for {}",
                 hidden.size(),
                 weights.size(),
                 places.size());
    checkLight(light, atlas);
    sumHidden({fiv::sourceOfCorners(atlas.silhouettes, light)},
              Sum::Corners,
              places,
              {},
              bias_texels,
              [&](const Block& block, std::size_t place, std::size_t i) {
                  hidden[place] = {Rgb(0.0f), block.sums[12][i] + block.uniform[12]};
                  for (std::size_t corner = 0; corner < 4; ++corner)
                      hidden[place].light +=
                          weights[place][corner] * fiv::irradianceOf(block, i, 3 * corner);
              });
}

}  // namespace insitu
