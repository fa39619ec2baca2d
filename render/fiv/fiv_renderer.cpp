#include "render/fiv/fiv_renderer.h"

#include "lighting/sampling.h"
#include "render/cut_outs.h"
#include "render/fiv/object_light.h"
#include "render/fiv/object_pixels.h"
#include "render/fiv/object_samples.h"
#include "render/fiv/receiver_pixels.h"

#include <algorithm>
#include <chrono>
#include <ctime>

namespace insitu {

namespace {

double secondsSince(std::chrono::steady_clock::time_point start)
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Rays in all from each sample of the objects; they have no neighbours to share with.
constexpr int kSampleRays = 64;
/// Parts of cut-out triangles along the longest side of their model: an atlas's samples.
constexpr double kPartsAlong = 128.0;

/// All objects as one mesh, for the atlas: in the coordinates of the first, so that objects that
/// are moved, turned or scaled together keep their atlas.
struct MergedObjects {
    TriangleMesh mesh;
    double largest = 0.0;  ///< diagonal of one object's box
    Placement placement;
    TriangleMesh in_world;
};

MergedObjects merged(const ObjectScene& objects)
{
    MergedObjects all;
    if (objects.objects().empty()) return all;
    all.placement = objects.objects().front().placement;
    for (const ObjectScene::Object& object : objects.objects()) {
        const BoundingBox box = boundingBox(object.model.mesh);
        const glm::dvec3 size = box.max - box.min;
        const double longest = std::max({size.x, size.y, size.z, 1e-12});
        const TriangleMesh own = withoutCutOuts(object.model, longest / kPartsAlong);
        const TriangleMesh mesh = placed(own, relativeTo(all.placement, object.placement));
        const BoundingBox placed_box = boundingBox(mesh);
        all.largest = std::max(all.largest, glm::length(placed_box.max - placed_box.min));
        const auto base = static_cast<std::uint32_t>(all.mesh.positions.size());
        all.mesh.positions.insert(
            all.mesh.positions.end(), mesh.positions.begin(), mesh.positions.end());
        for (const glm::uvec3& triangle : mesh.triangles)
            all.mesh.triangles.push_back(triangle + base);
    }
    all.in_world = placed(all.mesh, all.placement);
    return all;
}

/// Several objects share an atlas that spans them all: as fine for each as for one, within bounds.
int sharedResolution(const MergedObjects& all, int resolution)
{
    if (!(all.largest > 0.0)) return resolution;
    const BoundingBox box = boundingBox(all.mesh);
    const double growth = std::min(glm::length(box.max - box.min) / all.largest, 2.0);
    return std::min(static_cast<int>(resolution * growth), 512);
}

VisibilityAtlas atlasOf(const MergedObjects& merged,
                        const AtlasOptions& options,
                        const FivOptions& fiv,
                        InsertionResult& result,
                        Progress& progress)
{
    CachedAtlas cached;
    if (fiv.atlas_folder.empty())
        cached.atlas = buildVisibilityAtlas(merged.mesh, options, progress);
    else
        cached = cachedVisibilityAtlas(merged.mesh, options, fiv.atlas_folder, progress);
    append(result.findings, cached.findings);
    result.table_bytes += cached.atlas.silhouettes.memoryBytes();
    return placedAtlas(std::move(cached.atlas), merged.placement, merged.in_world);
}

FivScene makeScene(const RoomLight& room,
                   const ObjectScene& objects,
                   const MergedObjects& all,
                   const FivOptions& fiv,
                   bool interreflection,
                   InsertionResult& result,
                   Progress& progress)
{
    const auto start = std::chrono::steady_clock::now();
    const std::clock_t worked = std::clock();
    AtlasOptions fine = fiv.atlas;
    fine.resolution = sharedResolution(all, fine.resolution);
    FivScene scene{room,
                   objects,
                   atlasOf(all, fine, fiv, result, progress),
                   {},
                   {},
                   {},
                   fiv.light,
                   room.cellIrradiance(),
                   {},
                   interreflection};
    result.table_seconds = secondsSince(start);
    result.table_processor_seconds = static_cast<double>(std::clock() - worked) / CLOCKS_PER_SEC;
    scene.cells = std::make_shared<CellGeometry>(scene.atlas.cells());
    scene.coarse_cells =
        std::make_shared<CellGeometry>(DirectionCells{fiv.object_face_size, scene.atlas.axes});
    scene.spots = LightSpots(room, scene.frame().center, LightSpotOptions{});
    for (std::size_t i = 0; i < scene.room_change.size(); ++i)
        scene.room_change[i] = Rgb(0.0f);
    return scene;
}

/// What the objects send to each other and to the room, and what the room sends back: the objects'
/// mean radiance, twice, then the room's change, then the objects again in the changed room. Or
/// only what they emit.
void lightEachOther(FivScene& scene,
                    ObjectShading& shading,
                    ReceiverLight& receivers,
                    const FivOptions& fiv,
                    Progress& progress)
{
    const std::vector<ObjectSample> samples = sampleObjects(scene.objects, fiv.object_samples);
    std::vector<ObjectShading::Place> places;
    for (const ObjectSample& sample : samples) {
        places.push_back(ObjectShading::placeOf(sample.point));
        places.back().normal = sample.point.geometric_normal;
        places.back().shift = r2Point(static_cast<double>(places.size()));
    }
    scene.sent = SentLight(scene.objects, samples);
    std::vector<Rgb> irradiance(samples.size(), Rgb(0.0f));
    if (!scene.interreflection) {
        setSent(scene, samples, irradiance);
        return;
    }
    for (int round = 0; round < 3; ++round) {
        if (round == 2) {
            scene.room_change = roomChange(scene, receivers);
            shading.update();
        }
        const auto received = shading.receive(places, kSampleRays);
        for (std::size_t i = 0; i < received.size(); ++i)
            irradiance[i] = received[i].smooth() + received[i].spots;
        setSent(scene, samples, irradiance);
        progress.checkpoint();
    }
    receivers.update();
}

/// Nothing stands in the room: with is without.
void emptyRoom(const Camera& camera, const RoomLight& room, RenderLayers& layers)
{
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const auto hit =
                room.proxy().intersect(camera.position_m, camera.rayDirection({x + 0.5, y + 0.5}));
            if (!hit || hit->opening) continue;
            layers.irradiance_without(x, y) = layers.irradiance_with(x, y) =
                room.irradianceScale(hit->face, hit->uv) *
                room.cellIrradiance().lookUp(hit->face, hit->uv, Rgb(0.0f));
            layers.probe_radiance(x, y) = room.probeRadiance(hit->face, hit->uv);
        }
}

}  // namespace

InsertionResult renderFiv(const Camera& camera,
                          const RoomLight& room,
                          const ObjectScene& objects,
                          const InsertionOptions& options,
                          Progress& progress)
{
    InsertionResult result;
    result.technique = Technique::Fiv;
    result.layers = emptyLayers(camera.width, camera.height);
    const MergedObjects all = merged(objects);
    if (all.mesh.triangles.empty()) {
        emptyRoom(camera, room, result.layers);
        return result;
    }
    const FivOptions& fiv = options.fiv;
    FivScene scene =
        makeScene(room, objects, all, fiv, options.interreflection.enabled, result, progress);
    ObjectShading shading(scene, fiv.object_node_spacing_m);
    ReceiverLight light(scene, fiv.receiver_node_spacing_m);
    lightEachOther(scene, shading, light, fiv, progress);
    progress.report("fiv", 0.3);

    const auto receivers = renderObjectPixels(camera, scene, shading, result.layers, progress);
    progress.report("fiv", 0.6);
    result.mean_samples = renderReceiverPixels(
        scene, receivers, light, fiv.interpolation_tolerance, result.layers, progress);
    progress.report("fiv", 1.0);
    return result;
}

}  // namespace insitu
