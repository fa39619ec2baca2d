#include "pipeline/insert.h"

#include "calib/camera_formats.h"
#include "calib/photo_calibration.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "pipeline/photo_match.h"
#include "pipeline/probe_location.h"
#include "pipeline/radiance_mesh_stage.h"
#include "pipeline/reference_capture.h"
#include "pipeline/stage_cache.h"
#include "pipeline/stage_parts.h"
#include "reconstruct/room_bounds.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

namespace insitu {

namespace {

/// Adds the seconds since the last call to the list, under the stage's name.
class Stopwatch {
public:
    explicit Stopwatch(std::vector<StageTime>& times) : times_(times) {}
    void lap(const char* stage, bool from_cache = false)
    {
        const auto now = std::chrono::steady_clock::now();
        const std::clock_t worked = std::clock();
        times_.push_back({stage,
                          std::chrono::duration<double>(now - last_).count(),
                          static_cast<double>(worked - worked_) / CLOCKS_PER_SEC,
                          from_cache});
        last_ = now;
        worked_ = worked;
    }

private:
    std::vector<StageTime>& times_;
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
    std::clock_t worked_ = std::clock();
};

Exposure merged(Exposure exif, const Exposure& given)
{
    if (given.seconds) exif.seconds = given.seconds;
    if (given.f_number) exif.f_number = given.f_number;
    if (given.iso) exif.iso = given.iso;
    return exif;
}

/// A curve with the free scale of recovered ones: exposure 1 at code 128.
ResponseCurve scaledAtMiddle(ResponseCurve curve)
{
    for (auto& table : curve.exposure) {
        const double middle = table[128];
        for (double& value : table)
            value /= middle;
    }
    return curve;
}

/// The photograph is a single exposure: its response is the probe's when one camera took both.
void choosePhotoResponse(const Project& project, InsertResult& result)
{
    const PhotoMetadata& photo = result.photo.metadata;
    const PhotoMetadata& probe = result.light.metadata;
    const Exposure exposure = merged(photo.exposure, project.photo.exposure);
    const bool same_camera = photo.make == probe.make && photo.model == probe.model;
    const bool both_raw = photo.color.transfer_is_response && probe.color.transfer_is_response;
    if (photo.color.transfer_is_response) {
        // Developed from RAW: the curve is known. Light from RAW has the same unit.
        result.photo_response =
            both_raw ? photo.color.transfer : scaledAtMiddle(photo.color.transfer);
    } else if (result.light.response_known && same_camera && sameColors(photo.color, probe.color)) {
        result.photo_response = result.light.response;
    } else {
        result.photo_response = scaledAtMiddle(photo.color.transfer);
        result.findings.push_back(
            {Severity::Warning,
             "photo-response-assumed-srgb",
             !result.light.response_known
                 ? fmt::format("no response was recovered for the photograph's camera: it is "
                               "assumed to be {}",
                               photo.color.transfer.source)
                 : fmt::format("the photograph is from '{} {}' in '{}', the light probe from '{} "
                               "{}' in '{}': the photograph's response is assumed to be {}",
                               photo.make,
                               photo.model,
                               photo.color.name,
                               probe.make,
                               probe.model,
                               probe.color.name,
                               photo.color.transfer.source)});
    }
    const auto relative = exposure.relative();
    if (!relative && result.light.radiance_unit_known)
        throw InputError(project.photo.path.string(),
                         "no exposure time in EXIF; add \"exposure_seconds\" beside \"image\" in "
                         "the project file");
    result.photo_relative_exposure = relative.value_or(1.0);
}

/// The photograph's light, and the same in the light probe's exposure and white balance for the
/// stages that make the room's light from both: nothing where their units cannot be compared.
struct PhotoLight {
    Image<Rgb> taken;
    std::optional<PhotographedRadiance> in_probe_unit;
};

PhotoLight photoLight(const Project& project,
                      const SceneProxy& proxy,
                      const glm::dmat3& primaries,
                      InsertResult& result)
{
    PhotoLight light;
    light.taken = photographedRadiance(
        result.photo.image, result.photo_response, result.photo_relative_exposure, primaries);
    glm::dvec3 clip;
    for (std::size_t c = 0; c < 3; ++c)
        clip[static_cast<int>(c)] =
            result.photo_response.exposure[c][255] / result.photo_relative_exposure;
    const Camera& camera = result.camera.camera;
    result.balance = measurePhotoBalance(
        light.taken, clip, camera, proxy, result.light.environment, result.light.center_m);
    choosePhotoBalance(project.white_balance, result.light.radiance_unit_known, result.balance);
    append(result.findings, std::move(result.balance.findings));
    if (!result.light.radiance_unit_known) return light;
    light.in_probe_unit = {camera, light.taken};
    if (result.balance.used != glm::dvec3(1.0))
        for (Rgb& value : light.in_probe_unit->radiance.pixels())
            value /= Rgb(result.balance.used);
    return light;
}

/// Objects into the world; what looks like a wrong scale or place is a finding.
std::vector<ObjectScene::Object> placeObjects(const Project& project, InsertResult& result)
{
    std::vector<ObjectScene::Object> objects;
    for (const ProjectObject& wanted : project.objects) {
        ObjectScene::Object object{loadPlaced(wanted)};
        append(result.findings, object.model.findings);
        const BoundingBox box = boundingBox(object.model.mesh);
        if (const auto finding = extentFinding(box, wanted.model.string()))
            result.findings.push_back(*finding);
        const double slack = 0.005;
        const auto& positions = object.model.mesh.positions;
        const std::vector<glm::dvec3> points(positions.begin(), positions.end());
        if (const auto out = reachOutside(project.room, points); out && *out > slack)
            result.findings.push_back(
                {Severity::Warning,
                 "object-outside-room",
                 fmt::format("{} reaches {:.2f} m out of the room", wanted.model.string(), *out)});
        objects.push_back(std::move(object));
    }
    return objects;
}

/// captureLight, or what an earlier run made of the same files and numbers.
CapturedLight cachedLight(const Project& project,
                          const SceneProxy& proxy,
                          const Camera& camera,
                          const InsertOptions& options,
                          StageCache& cache,
                          bool& from_cache)
{
    // A file with an environment is read as quickly as the cache.
    if (!project.light.probe) return captureLight(project, proxy, camera, options);
    const ProjectProbe& probe = *project.light.probe;
    ContentKey key("probe");
    key.add(probe.kind, probe.center_m, probe.views.size());
    bool by_photo = false;
    for (const ProjectView& view : probe.views) {
        key.add(view.ball, view.view_position_m, view.view_up, view.crop_origin_px);
        key.add(view.images.size(), view.mask.has_value());
        for (const ProjectImage& image : view.images)
            key.add(image.path.filename().string(), image.exposure).addFile(image.path);
        if (view.mask) key.addFile(*view.mask);
        by_photo = by_photo || !view.view_position_m;
    }
    if (probe.response) key.add(probe.response->filename().string()).addFile(*probe.response);
    for (const ProjectReference& reference : probe.references) {
        key.add(reference);
        for (const ProjectImage& image : reference.images)
            key.addFile(image.path);
    }
    if (by_photo) key.add(camera);
    key.add(proxy.faces(), proxy.openings(), options.capture);
    if (auto kept = cache.find<CapturedLight>(key)) {
        from_cache = true;
        return *std::move(kept);
    }
    CapturedLight light = captureLight(project, proxy, camera, options);
    cache.keep(key, light);
    return light;
}

/// A project's mark, its mask read, as coverage of the photograph.
Image<float> foregroundOf(const ProjectForeground& foreground, const EncodedImage& photo)
{
    ForegroundMark mark = foreground.mark;
    if (foreground.mask) {
        const EncodedImage mask = readPhoto(*foreground.mask).image;
        if (!mask.codes.sameSize(photo.codes))
            throw InputError(foreground.mask->string(),
                             fmt::format("is {}x{}; a mask has the photograph's size, {}x{}",
                                         mask.codes.width(),
                                         mask.codes.height(),
                                         photo.codes.width(),
                                         photo.codes.height()));
        mark.mask = Image<float>(mask.codes.width(), mask.codes.height());
        for (std::size_t i = 0; i < mark.mask.pixelCount(); ++i)
            mark.mask.pixels()[i] =
                static_cast<float>(mask.codes.pixels()[i].g) / static_cast<float>(mask.max_code);
    }
    return foregroundCoverage(mark, photo);
}

glm::dvec3 objectsCenter(const ObjectScene& objects)
{
    glm::dvec3 sum(0.0);
    for (const BoundingBox& box : objects.bounds())
        sum += 0.5 * (box.min + box.max);
    return sum / std::max<double>(1.0, static_cast<double>(objects.bounds().size()));
}

/// What probe, numbers and photograph tell of the light; the last where both share a unit.
std::vector<ReferenceGroup> allReferences(const Project& project,
                                          const std::optional<PhotographedRadiance>& photographed,
                                          InsertResult& result)
{
    std::vector<ReferenceGroup> groups = result.light.references;
    if (!project.light.probe) return groups;
    const std::string name = project.photo.path.string();
    const auto in_photo = [](const ProjectReference& reference) {
        return reference.source == ProjectReference::Source::Photo;
    };
    if (!photographed && std::ranges::any_of(project.light.probe->references, in_photo))
        throw InputError(name,
                         "cannot show a reference: its unit is not the probe's, whose exposures "
                         "are unknown; give \"in\": \"probe\" or images of its own");
    if (!photographed) return groups;
    for (ReferenceGroup& group : photographedReferences(*project.light.probe,
                                                        result.photo.image,
                                                        photographed->radiance,
                                                        photographed->camera,
                                                        name,
                                                        result.findings))
        groups.push_back(std::move(group));
    return groups;
}

/// Room light and render: what takes the time, and is kept whole.
struct RenderStage {
    const Camera& camera;
    const SceneProxy& proxy;
    const CapturedLight& light;
    const std::optional<PhotographedRadiance>& photographed;
    const InsertOptions& options;

    [[nodiscard]] RenderedStage run(std::vector<ObjectScene::Object> objects,
                                    StageCache& cache,
                                    Stopwatch& watch,
                                    Progress& progress) const
    {
        ContentKey key("render");
        key.add(camera, proxy.faces(), proxy.openings(), light.environment, light.center_m);
        key.add(options.light, options.render);
        if (photographed) key.add(photographed->camera, photographed->radiance);
        for (const ObjectScene::Object& object : objects)
            key.add(object.model);
        if (auto kept = cache.find<RenderedStage>(key)) {
            watch.lap("render", /*from_cache=*/true);
            return *std::move(kept);
        }

        const ObjectScene scene(std::move(objects));
        RoomLightOptions light_options = options.light;
        light_options.reference_point_m = objectsCenter(scene);
        const RoomLight room(
            proxy, light.environment, light.center_m, photographed, light_options, progress);
        watch.lap("room light");
        RenderedStage rendered{room.findings(),
                               renderInsertion(camera, room, scene, options.render, progress)};
        // What a time limit cut short is as good as this run was fast.
        if (!rendered.render.stopped_by_time) cache.keep(key, rendered);
        watch.lap("render");
        return rendered;
    }
};

}  // namespace

CameraEstimate solveCamera(const Project& project, const Photo& photo, bool use_exif_focal)
{
    const int width = photo.image.codes.width();
    const int height = photo.image.codes.height();
    const std::filesystem::path source =
        project.camera_lines ? *project.camera_lines : *project.camera_file;
    const auto demandSize = [&](int w, int h) {
        if (w != width || h != height)
            throw InputError(source.string(),
                             fmt::format("is for a picture of {}x{}, {} is {}x{}",
                                         w,
                                         h,
                                         project.photo.path.filename().string(),
                                         width,
                                         height));
    };
    if (project.camera_file) {
        CameraReading reading;
        reading.size_px = glm::ivec2(width, height);
        reading.picture = project.photo.path.filename().string();
        return readCameraFile(source, reading);
    }
    const LineSet lines = readLineSet(source);
    demandSize(lines.width, lines.height);
    CalibrationOptions options;
    options.use_exif = use_exif_focal;
    return calibratePhoto(lines, photo, options, source.string());
}

InsertResult insertObjects(const Project& given, const InsertOptions& options, Progress& progress)
{
    InsertResult result;
    Project project = given;
    Stopwatch watch(result.times);
    result.photo = developed(readPhoto(project.photo.path));
    append(result.findings,
           photoFindings(result.photo.metadata, project.photo.path.filename().string()));
    result.camera = solveCamera(project, result.photo, options.use_exif_focal);
    append(result.findings, result.camera.findings);
    append(result.findings, placeProbeFromOutline(result.camera, project));
    const Camera& camera = result.camera.camera;
    watch.lap("camera");

    std::vector<ObjectScene::Object> objects = placeObjects(project, result);
    watch.lap("models");

    StageCache cache(options.cache_folder);
    const SceneProxy proxy(project.room);
    append(result.findings, proxy.findings());
    bool from_cache = false;
    result.light = cachedLight(project, proxy, camera, options, cache, from_cache);
    append(result.findings, result.light.findings);
    choosePhotoResponse(project, result);
    watch.lap("probe", from_cache);

    const glm::dmat3 primaries = result.photo.metadata.color.rec709_from_linear;
    // The photograph stands in for surfaces the probe did not see.
    const auto [photo_radiance, photographed] = photoLight(project, proxy, primaries, result);
    InsertOptions with_atlases = options;
    if (options.render.fiv.atlas_folder.empty() && !options.cache_folder.empty())
        with_atlases.render.fiv.atlas_folder = options.cache_folder / "atlas";
    with_atlases.light.references = allReferences(project, photographed, result);
    RenderStage stage{camera, proxy, result.light, photographed, with_atlases};
    RenderedStage rendered = stage.run(std::move(objects), cache, watch, progress);
    append(result.findings, std::move(rendered.light_findings));
    result.render = std::move(rendered.render);
    append(result.findings, result.render.findings);
    scaleLight(result.render.layers, result.balance.used);

    for (const ProjectForeground& foreground : project.foreground)
        putBehindForeground(foregroundOf(foreground, result.photo.image),
                            foreground.mark.distance_m,
                            photo_radiance,
                            result.render.layers);
    const Image<float> distance_m = proxyDistance(proxy, camera);
    CameraMatchOptions match = options.match;
    if (project.photo_focus_m) match.focus_m = project.photo_focus_m;
    if (project.photo_vignetting) match.vignetting_a = project.photo_vignetting;
    match.estimate_vignetting = match.estimate_vignetting || project.estimate_vignetting;
    result.match =
        estimateCameraMatch(result.photo.image,
                            result.photo_response,
                            photo_radiance,
                            distance_m,
                            {camera.principal_px, aperturePxM(result.photo.metadata, camera)},
                            match);
    append(result.findings, result.match.findings);
    result.composite = compositeDifferential(result.photo.image,
                                             result.photo_response,
                                             result.photo_relative_exposure,
                                             result.render.layers,
                                             options.composite,
                                             primaries,
                                             result.match.match,
                                             distance_m);
    append(result.findings, result.composite.findings);
    append(result.findings, cache.findings());
    watch.lap("composite");
    return result;
}

ProjectRadianceMesh projectRadianceMesh(const Project& given,
                                        const InsertOptions& options,
                                        const RadianceMeshOptions& mesh_options,
                                        Progress& progress)
{
    InsertResult result;
    Project project = given;
    result.photo = readPhoto(project.photo.path);
    result.camera = solveCamera(project, result.photo, options.use_exif_focal);
    append(result.findings, result.camera.findings);
    append(result.findings, placeProbeFromOutline(result.camera, project));
    const SceneProxy proxy(project.room);
    append(result.findings, proxy.findings());
    result.light = captureLight(project, proxy, result.camera.camera, options);
    append(result.findings, result.light.findings);
    choosePhotoResponse(project, result);
    const std::optional<PhotographedRadiance> photographed =
        photoLight(project, proxy, result.photo.metadata.color.rec709_from_linear, result)
            .in_probe_unit;
    RoomLightOptions light_options = options.light;
    light_options.reference_point_m = project.objects.front().position_m;
    light_options.references = allReferences(project, photographed, result);
    const RoomLight room(proxy,
                         result.light.environment,
                         result.light.center_m,
                         photographed,
                         light_options,
                         progress);
    append(result.findings, room.findings());
    return {makeRadianceMesh(
                room, result.light.environment, result.light.center_m, photographed, mesh_options),
            result.findings};
}

}  // namespace insitu
