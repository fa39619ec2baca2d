#include "capture/bracket.h"
#include "capture/probe_views.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "pipeline/insert.h"

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

/// Light of the probe's picture, and which pixels are only a lower bound (empty: none).
struct ProbePicture {
    Image<Rgb> radiance;
    Image<std::uint8_t> clipped;
};

/// Brackets of encoded photographs need a response; a single radiance file is linear already.
/// The first view's response, once known, is the others'.
ProbePicture probePicture(const ProjectView& view,
                          const std::optional<ResponseCurve>& response,
                          const CaptureOptions& options,
                          CapturedLight& light)
{
    if (view.images.size() == 1 && isRadianceFile(view.images.front().path)) {
        light.response = ResponseCurve::srgb();
        return {readRadiance(view.images.front().path).pixels, {}};
    }
    std::vector<std::filesystem::path> files;
    std::vector<Exposure> exposures;
    for (const ProjectImage& image : view.images) {
        files.push_back(image.path);
        exposures.push_back(image.exposure);
    }
    Bracket bracket = readBracket(files, exposures);
    append(light.findings, std::exchange(bracket.findings, {}));
    light.metadata = bracket.metadata;
    light.radiance_unit_known = true;
    CapturedRadiance captured = captureRadiance(std::move(bracket), response, options);
    append(light.findings, std::move(captured.findings));
    light.response = std::move(captured.response);
    light.response_known = captured.response_known;
    MergeResult& merged = captured.merged;
    ProbePicture picture{std::move(merged.radiance.pixels), {}};
    if (merged.clipped_fraction > 0.0) {
        picture.clipped = std::move(merged.validity);
        for (std::uint8_t& flags : picture.clipped.pixels())
            flags &= kMergeClipped;
    }
    return picture;
}

/// A picture of the whole sphere, and the shares of clipped pixels mapped in the same way.
LightProbe mapSphere(ProbeKind kind, const ProbePicture& picture, int width)
{
    const auto map = [&](const Image<Rgb>& image) {
        return kind == ProbeKind::Angular     ? probeFromAngularMap(image, width)
               : kind == ProbeKind::CubeCross ? probeFromCubeCross(image, width)
                                              : probeFromLatLong(image, width);
    };
    LightProbe probe = map(picture.radiance);
    if (picture.clipped.empty()) return probe;
    Image<Rgb> flags(picture.clipped.width(), picture.clipped.height());
    for (std::size_t i = 0; i < flags.pixelCount(); ++i)
        flags.pixels()[i] = Rgb(picture.clipped.pixels()[i] != 0 ? 1.0f : 0.0f);
    const LightProbe shares = map(flags);
    const Image<Rgb>& mapped = shares.environment.pixels;
    probe.environment.clipped = Image<float>(mapped.width(), mapped.height());
    for (std::size_t i = 0; i < mapped.pixelCount(); ++i)
        probe.environment.clipped.pixels()[i] = mapped.pixels()[i].r;
    return probe;
}

Camera cameraOf(const ProjectView& view, const Camera* photo_camera, const Image<Rgb>& radiance)
{
    if (view.view_position_m)
        return ballCamera(
            view.ball, *view.view_position_m, radiance.width(), radiance.height(), view.view_up);
    INSITU_CHECK(photo_camera != nullptr, "a view of the photograph's camera, which is not given");
    return *photo_camera;
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
    for (const ProjectView& view : probe.views) {
        const bool known = light.response_known;
        pictures.push_back(probePicture(view, response, options, light));
        light.response_known = light.response_known || known;
        if (!response && light.response_known) response = light.response;
    }
    LightProbe made;
    if (probe.kind != ProbeKind::MirrorBall) {
        made = mapSphere(probe.kind, pictures[0], width);
    } else if (probe.views.size() == 1 && !probe.views[0].mask) {
        UnwrapOptions unwrap;
        unwrap.width = width;
        unwrap.crop_origin_px = probe.views[0].crop_origin_px;
        if (!pictures[0].clipped.empty()) unwrap.clipped = &pictures[0].clipped;
        unwrap.distance_to_room = distance_to_room;
        made = unwrapMirrorBall(pictures[0].radiance,
                                probe.views[0].ball,
                                cameraOf(probe.views[0], photo_camera, pictures[0].radiance),
                                unwrap);
    } else {
        std::vector<ProbeView> views;
        for (std::size_t i = 0; i < pictures.size(); ++i) {
            const ProjectView& from = probe.views[i];
            ProbeView view;
            view.camera = cameraOf(from, photo_camera, pictures[i].radiance);
            if (from.mask)
                view.mask = readProbeMask(
                    *from.mask, pictures[i].radiance.width(), pictures[i].radiance.height());
            view.radiance = std::move(pictures[i].radiance);
            view.clipped = std::move(pictures[i].clipped);
            view.ball = from.ball;
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
