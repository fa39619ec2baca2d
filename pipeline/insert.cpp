#include "pipeline/insert.h"

#include "calib/camera_formats.h"
#include "calib/photo_calibration.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "pipeline/photo_light.h"
#include "pipeline/photo_match.h"
#include "pipeline/probe_location.h"
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

/// Objects into the world; what looks like a wrong scale or place is a finding.
std::vector<ObjectScene::Object> placeObjects(const Project& project, InsertResult& result)
{
    std::vector<ObjectScene::Object> objects;
    for (const ProjectObject& wanted : project.objects) {
        ObjectScene::Object object = loadObject(wanted);
        append(result.findings, object.model.findings);
        const TriangleMesh mesh = placed(object.model.mesh, object.placement);
        const BoundingBox box = boundingBox(mesh);
        if (const auto finding = extentFinding(box, wanted.model.string()))
            result.findings.push_back(*finding);
        const double slack = 0.005;
        const std::vector<glm::dvec3> points(mesh.positions.begin(), mesh.positions.end());
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
        key.add(view.find_outline);
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
            key.add(object.model, object.placement);
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
    result.photo = readPhotograph(project.photo.path);
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
    choosePhotoResponse(project, proxy, result);
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

    matchPhoto(project, proxy, photo_radiance, options.match, result);
    watch.lap("camera match");
    for (const ProjectForeground& foreground : project.foreground)
        putBehindForeground(foregroundOf(foreground, result.photo.image),
                            foreground.mark.distance_m,
                            photo_radiance,
                            result.layers);
    result.composite = compositeDifferential(result.photo.image,
                                             result.photo_response,
                                             result.photo_relative_exposure,
                                             result.layers,
                                             options.composite,
                                             primaries,
                                             result.match.match);
    if (!result.photo.radiance.empty())
        result.composite.linear = radianceOfComposite(result.photo, result.composite);
    append(result.findings, result.composite.findings);
    append(result.findings, cache.findings());
    watch.lap("composite");
    return result;
}

}  // namespace insitu
