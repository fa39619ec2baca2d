#include "capture/bracket.h"
#include "capture/clipped_source.h"
#include "capture/probe_views.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "pipeline/insert.h"
#include "pipeline/probe_outline.h"
#include "pipeline/reference_capture.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace insitu {

namespace {

ResponseCurve readResponse(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    ResponseCurve curve = responseFromJson(JsonNode(json, path.string()));
    curve.source = path.filename().string();
    return curve;
}

EnvironmentMap readEnvironment(const std::filesystem::path& path)
{
    EnvironmentMap environment{readRadiance(path).pixels};
    if (environment.pixels.width() != 2 * environment.pixels.height())
        throw InputError(path.string(),
                         fmt::format("is {}x{}; an equirectangular environment is twice as wide as "
                                     "high",
                                     environment.pixels.width(),
                                     environment.pixels.height()));
    return environment;
}

/// Light of the probe's picture, and the part of it that is only a lower bound (empty: none).
struct ProbePicture {
    Image<Rgb> radiance;
    Image<Rgb> clipped;
};

/// Brackets of encoded photographs need a response; a single radiance file is linear already.
/// The first view's response, once known, is the others'.
ProbePicture probePicture(const std::vector<ProjectImage>& images,
                          FrameSizes sizes,
                          const std::optional<ResponseCurve>& response,
                          const CaptureOptions& options,
                          CapturedLight& light)
{
    if (images.size() == 1 && isRadianceFile(images.front().path)) {
        light.response = ResponseCurve::srgb();
        return {readRadiance(images.front().path).pixels, {}};
    }
    std::vector<std::filesystem::path> files;
    std::vector<Exposure> exposures;
    for (const ProjectImage& image : images) {
        files.push_back(image.path);
        exposures.push_back(image.exposure);
    }
    Bracket bracket = readBracket(files, exposures, sizes);
    append(light.findings, std::exchange(bracket.findings, {}));
    light.metadata = bracket.metadata;
    light.radiance_unit_known = true;
    CapturedRadiance captured = captureRadiance(std::move(bracket), response, options);
    append(light.findings, std::move(captured.findings));
    light.response = std::move(captured.response);
    light.response_known = captured.response_known;
    MergeResult& merged = captured.merged;
    Image<Rgb> clipped = clippedPart(merged);
    return {std::move(merged.radiance.pixels), std::move(clipped)};
}

/// The ball as the project gives it, or as its picture shows it.
MirrorBall ballOf(const ProjectView& view, const Image<Rgb>& radiance, Findings& findings)
{
    MirrorBall ball = view.ball;
    if (view.find_outline && !findProbeOutline(radiance, view.crop_origin_px, ball, findings))
        throw NoAnswerError(view.images.front().path.string(),
                            "the outline of the mirror ball was not found in these pictures; give "
                            "the ball's center_px and radius_px");
    return ball;
}

/// A picture of the whole sphere, and its clipped part mapped in the same way.
LightProbe mapSphere(ProbeKind kind, const ProbePicture& picture, int width)
{
    const auto map = [&](const Image<Rgb>& image) {
        return kind == ProbeKind::Angular     ? probeFromAngularMap(image, width)
               : kind == ProbeKind::CubeCross ? probeFromCubeCross(image, width)
                                              : probeFromLatLong(image, width);
    };
    LightProbe probe = map(picture.radiance);
    if (picture.clipped.empty()) return probe;
    probe.environment.clipped = map(picture.clipped).environment.pixels;
    return probe;
}

Camera cameraOf(const ProjectView& view,
                const MirrorBall& ball,
                const Camera* photo_camera,
                const Image<Rgb>& radiance)
{
    if (view.view_position_m)
        return ballCamera(
            ball, *view.view_position_m, radiance.width(), radiance.height(), view.view_up);
    INSITU_CHECK(photo_camera != nullptr, "a view of the photograph's camera, which is not given");
    return *photo_camera;
}

/// Cards and balls in the probe's pictures, or in pictures of their own; numbers as given.
void captureReferences(const ProjectProbe& probe,
                       const ProbePicture& first_view,
                       const MirrorBall& first_ball,
                       const Camera* photo_camera,
                       const std::optional<ResponseCurve>& response,
                       const CaptureOptions& options,
                       CapturedLight& light)
{
    for (const ProjectReference& reference : probe.references) {
        if (reference.kind != ReferenceKind::Card && reference.kind != ReferenceKind::Ball)
            continue;
        if (reference.source == ProjectReference::Source::Photo) continue;
        const bool ball = reference.kind == ReferenceKind::Ball;
        Camera camera;
        ReferenceGroup group;
        if (reference.source == ProjectReference::Source::Probe) {
            const ProjectView& view = probe.views[0];
            if (ball) camera = cameraOf(view, first_ball, photo_camera, first_view.radiance);
            group = measureReference(reference,
                                     {first_view.radiance,
                                      first_view.clipped,
                                      view.crop_origin_px,
                                      &camera,
                                      view.images.front().path.string()},
                                     probe.center_m,
                                     light.findings);
        } else {
            CapturedLight own;
            const ProbePicture picture =
                probePicture(reference.images, FrameSizes::Equal, response, options, own);
            append(light.findings, std::move(own.findings));
            if (ball) {
                MirrorBall outline;
                outline.center_px = reference.center_px;
                outline.radius_px = reference.radius_px;
                outline.radius_m = reference.radius_m;
                outline.center_m = reference.position_m.value_or(probe.center_m);
                camera = ballCamera(outline,
                                    reference.view_position_m,
                                    picture.radiance.width(),
                                    picture.radiance.height(),
                                    reference.view_up);
            }
            group = measureReference(reference,
                                     {picture.radiance,
                                      picture.clipped,
                                      glm::dvec2(0.0),
                                      &camera,
                                      reference.images.front().path.string()},
                                     probe.center_m,
                                     light.findings);
        }
        light.references.push_back(std::move(group));
    }
    for (ReferenceGroup& group : givenReferences(probe.references, probe.center_m))
        light.references.push_back(std::move(group));
}

}  // namespace

CapturedLight captureProbe(
    const ProjectProbe& probe,
    const Camera* photo_camera,
    const std::function<double(glm::dvec3 origin, glm::dvec3 direction)>& distance_to_room,
    const CaptureOptions& options,
    int width)
{
    CapturedLight light;
    light.center_m = probe.center_m;
    std::optional<ResponseCurve> response;
    if (probe.response) response = readResponse(*probe.response);
    std::vector<ProbePicture> pictures;
    std::vector<MirrorBall> balls;
    for (const ProjectView& view : probe.views) {
        const bool known = light.response_known;
        const FrameSizes sizes = view.find_outline ? FrameSizes::HandCut : FrameSizes::Equal;
        pictures.push_back(probePicture(view.images, sizes, response, options, light));
        balls.push_back(ballOf(view, pictures.back().radiance, light.findings));
        light.response_known = light.response_known || known;
        if (!response && light.response_known) response = light.response;
    }
    // Views are merged from what they are moved into; references look at the first one as it was.
    const ProbePicture first = probe.references.empty() ? ProbePicture{} : pictures[0];
    LightProbe made;
    if (probe.kind != ProbeKind::MirrorBall) {
        made = mapSphere(probe.kind, pictures[0], width);
    } else if (probe.views.size() == 1 && !probe.views[0].mask) {
        UnwrapOptions unwrap;
        unwrap.width = width;
        unwrap.crop_origin_px = probe.views[0].crop_origin_px;
        if (!pictures[0].clipped.empty()) unwrap.clipped = &pictures[0].clipped;
        unwrap.distance_to_room = distance_to_room;
        made =
            unwrapMirrorBall(pictures[0].radiance,
                             balls[0],
                             cameraOf(probe.views[0], balls[0], photo_camera, pictures[0].radiance),
                             unwrap);
    } else {
        std::vector<ProbeView> views;
        for (std::size_t i = 0; i < pictures.size(); ++i) {
            const ProjectView& from = probe.views[i];
            ProbeView view;
            view.ball = balls[i];
            view.camera = cameraOf(from, view.ball, photo_camera, pictures[i].radiance);
            if (from.mask)
                view.mask = readProbeMask(
                    *from.mask, pictures[i].radiance.width(), pictures[i].radiance.height());
            view.radiance = std::move(pictures[i].radiance);
            view.clipped = std::move(pictures[i].clipped);
            view.crop_origin_px = from.crop_origin_px;
            views.push_back(std::move(view));
        }
        MergeViewsOptions merge;
        merge.width = width;
        merge.distance_to_room = distance_to_room;
        made = mergeProbeViews(views, merge).probe;
    }
    append(light.findings, std::move(made.findings));
    light.environment = std::move(made.environment);
    captureReferences(probe, first, balls[0], photo_camera, response, options, light);
    return light;
}

CapturedLight captureLight(const Project& project,
                           const SceneProxy& proxy,
                           const Camera& photo_camera,
                           const InsertOptions& options)
{
    if (project.light.environment) {
        CapturedLight light;
        light.environment = readEnvironment(*project.light.environment);
        light.center_m = project.light.center_m;
        return light;
    }
    const auto distance_to_room = [&](glm::dvec3 origin, glm::dvec3 direction) {
        const auto hit = proxy.intersect(origin, direction);
        return hit && !hit->opening ? hit->distance_m : kInfinity;
    };
    return captureProbe(*project.light.probe, &photo_camera, distance_to_room, options.capture);
}

}  // namespace insitu
