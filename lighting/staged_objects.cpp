#include "lighting/staged_objects.h"

#include "core/check.h"
#include "core/parallel.h"
#include "lighting/fiv_groups.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

using fiv::Block;
using fiv::Group;
using fiv::Occluder;
using fiv::Source;
using fiv::Sum;

/// From the world's axes to the object's.
glm::dvec3 turnedBack(const Placement& placement, glm::dvec3 v)
{
    return v * placement.worldFromModelRotation();
}

/// The silhouette's frame for light along `wanted` instead of its own direction: a place is carried
/// along the light to the plane through the object's centre, and seen there.
SilhouetteFrame sheared(SilhouetteFrame frame, glm::dvec3 own, glm::dvec3 wanted)
{
    const double ahead = glm::dot(own, wanted);
    const auto shear = [&](glm::vec3& axis) {
        const glm::dvec3 a(axis);
        axis = glm::vec3(a - own * (glm::dot(a, wanted) / ahead));
    };
    shear(frame.column_axis);
    shear(frame.row_axis);
    return frame;
}

Occluder cellOccluder(const StagedObject& object, DirectionCells light_cells)
{
    const SilhouetteSet& set = object.atlas->silhouettes;
    Occluder occluder;
    occluder.set = &set;
    for (std::size_t i = 0; i < light_cells.pairCount(); ++i) {
        const glm::dvec3 d = turnedBack(object.placement, light_cells.direction(i));
        const DirectedPair cell = object.atlas->cells().cellAt(d);
        occluder.silhouettes.push_back(static_cast<std::uint32_t>(cell.pair));
        occluder.swapped.push_back(static_cast<std::uint8_t>(cell.side));
        occluder.frames.push_back(
            sheared(set.frames[cell.pair], set.directions[cell.pair], cell.side == 0 ? d : -d));
    }
    return occluder;
}

Occluder fineOccluder(const SilhouetteSet& set)
{
    Occluder occluder;
    occluder.set = &set;
    occluder.frames = set.frames;
    occluder.swapped.assign(set.frames.size(), 0);
    for (std::size_t i = 0; i < set.frames.size(); ++i)
        occluder.silhouettes.push_back(static_cast<std::uint32_t>(i));
    return occluder;
}

}  // namespace

struct ObjectStage::Impl {
    std::vector<StagedObject> objects;
    CellLight light;
    std::vector<SilhouetteSet> fine_sets;
    std::vector<Occluder> cells, fine;

    [[nodiscard]] glm::vec3 localFrom(const StagedObject& object, glm::dvec3 x) const
    {
        const Placement& p = object.placement;
        const glm::dvec3 x_in_model = p.pivot_in_model + turnedBack(p, x - p.position_m) / p.scale;
        return object.atlas->silhouettes.local.localFrom(x_in_model);
    }
    /// Calls take(block, place, i) with the sums of every place.
    template <class Take>
    void sum(Sum kind,
             std::span<const glm::dvec3> places,
             std::span<const glm::vec3> normals,
             glm::vec3 normal,
             float bias,
             const Take& take) const;
};

template <class Take>
void ObjectStage::Impl::sum(Sum kind,
                            std::span<const glm::dvec3> places,
                            std::span<const glm::vec3> normals,
                            glm::vec3 normal,
                            float bias,
                            const Take& take) const
{
    const Source of_cells = fiv::sourceOf(nullptr, light.along, light.against, kind, normal);
    const Source of_fine = fiv::sourceOf(nullptr, light.fine, {}, kind, normal);
    const std::size_t group_places = fiv::placesOfGroup(places.size());
    const std::size_t tasks = (places.size() + group_places - 1) / group_places;
    parallelFor(0, static_cast<std::int64_t>(tasks), [&](std::int64_t task) {
        const std::size_t begin = static_cast<std::size_t>(task) * group_places;
        const std::size_t count = std::min(group_places, places.size() - begin);
        std::vector<Group> groups(objects.size());
        std::vector<glm::vec3> local(count);
        const auto own_normals = normals.empty() ? normals : normals.subspan(begin, count);
        for (std::size_t k = 0; k < objects.size(); ++k) {
            for (std::size_t i = 0; i < count; ++i)
                local[i] = localFrom(objects[k], places[begin + i]);
            groups[k].resize((count + Block::kSize - 1) / Block::kSize);
            for (std::size_t b = 0; b < groups[k].filled(); ++b)
                fiv::fillBlock(groups[k], b, local, own_normals, b * Block::kSize);
        }
        fiv::addHiddenByAny(bestInstructionSet(), kind, of_cells, cells, bias, groups);
        if (!fine.empty())
            fiv::addHiddenByAny(bestInstructionSet(), kind, of_fine, fine, bias, groups);
        for (std::size_t i = 0; i < count; ++i)
            take(groups[0].blocks[i / Block::kSize], begin + i, i % Block::kSize);
    });
}

ObjectStage::ObjectStage(std::span<const StagedObject> objects,
                         CellLight light,
                         DirectionCells cells,
                         const FineSilhouetteOptions& options,
                         Progress& progress)
    : impl_(std::make_unique<Impl>())
{
    requireValid(options.validate(), "fine silhouette options");
    INSITU_CHECK(!objects.empty() && light.along.size() == cells.pairCount(),
                 "{} objects, light of {} pairs",
                 objects.size(),
                 light.along.size());
    impl_->objects.assign(objects.begin(), objects.end());
    impl_->light = std::move(light);
    for (const StagedObject& object : objects)
        impl_->cells.push_back(cellOccluder(object, cells));
    if (impl_->light.fine_directions.empty()) return;
    for (const StagedObject& object : objects) {
        std::vector<glm::dvec3> directions;
        for (const glm::dvec3& d : impl_->light.fine_directions)
            directions.push_back(glm::normalize(turnedBack(object.placement, d)));
        impl_->fine_sets.push_back(drawSilhouettes(
            *object.mesh, directions, options.resolution, options.samples, progress));
    }
    for (const SilhouetteSet& set : impl_->fine_sets)
        impl_->fine.push_back(fineOccluder(set));
}

ObjectStage::~ObjectStage() = default;
ObjectStage::ObjectStage(ObjectStage&&) noexcept = default;
ObjectStage& ObjectStage::operator=(ObjectStage&&) noexcept = default;

void ObjectStage::hiddenVectors(std::span<const glm::dvec3> places,
                                std::span<IrradianceVector> hidden,
                                float bias) const
{
    INSITU_CHECK(places.size() == hidden.size(), "{} for {}", hidden.size(), places.size());
    impl_->sum(Sum::Vectors,
               places,
               {},
               {},
               bias,
               [&](const Block& block, std::size_t place, std::size_t i) {
                   hidden[place] = fiv::vectorOf(block, i);
               });
}

void ObjectStage::hiddenIrradiance(std::span<const glm::dvec3> places,
                                   std::span<const glm::vec3> unit_normals,
                                   std::span<Rgb> hidden,
                                   float bias) const
{
    INSITU_CHECK(places.size() == hidden.size() && places.size() == unit_normals.size(),
                 "{} and {} for {}",
                 hidden.size(),
                 unit_normals.size(),
                 places.size());
    impl_->sum(Sum::PerPlace,
               places,
               unit_normals,
               {},
               bias,
               [&](const Block& block, std::size_t place, std::size_t i) {
                   hidden[place] = fiv::irradianceOf(block, i);
               });
}

void ObjectStage::hiddenIrradiance(std::span<const glm::dvec3> places,
                                   glm::vec3 unit_normal,
                                   std::span<Rgb> hidden,
                                   float bias) const
{
    INSITU_CHECK(places.size() == hidden.size(), "{} for {}", hidden.size(), places.size());
    impl_->sum(Sum::Irradiance,
               places,
               {},
               unit_normal,
               bias,
               [&](const Block& block, std::size_t place, std::size_t i) {
                   hidden[place] = fiv::irradianceOf(block, i);
               });
}

const CellLight& ObjectStage::light() const
{
    return impl_->light;
}

}  // namespace insitu
