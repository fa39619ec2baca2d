#include "capture/bracket.h"
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
ProbePicture probePicture(const ProjectProbe& probe,
                          const InsertOptions& options,
                          CapturedLight& light)
{
    if (probe.images.size() == 1 && isRadianceFile(probe.images.front().path)) {
        light.response = ResponseCurve::srgb();
        return {readRadiance(probe.images.front().path).pixels, {}};
    }
    std::vector<std::filesystem::path> files;
    std::vector<Exposure> exposures;
    for (const ProjectImage& image : probe.images) {
        files.push_back(image.path);
        exposures.push_back(image.exposure);
    }
    Bracket bracket = readBracket(files, exposures);
    append(light.findings, std::exchange(bracket.findings, {}));
    light.metadata = bracket.metadata;
    light.radiance_unit_known = true;
    std::optional<ResponseCurve> response;
    if (probe.response) response = readResponse(*probe.response);
    CapturedRadiance captured = captureRadiance(std::move(bracket), response, options.capture);
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

}  // namespace

CapturedLight captureLight(const Project& project,
                           const SceneProxy& proxy,
                           const Camera& photo_camera,
                           const InsertOptions& options)
{
    CapturedLight light;
    if (project.light.environment) {
        light.environment = readEnvironment(*project.light.environment);
        light.center_m = project.light.center_m;
        return light;
    }
    const ProjectProbe& probe = *project.light.probe;
    light.center_m = probe.center_m;
    const ProbePicture picture = probePicture(probe, options, light);
    const Image<Rgb>& radiance = picture.radiance;
    if (probe.kind == ProbeKind::LatLong) {
        light.environment.pixels = radiance;
        light.environment.clipped = Image<float>(picture.clipped.width(), picture.clipped.height());
        std::ranges::copy(picture.clipped.pixels(), light.environment.clipped.pixels().begin());
        return light;
    }

    UnwrapOptions unwrap;
    unwrap.crop_origin_px = probe.crop_origin_px;
    if (!picture.clipped.empty()) unwrap.clipped = &picture.clipped;
    unwrap.distance_to_room = [&](glm::dvec3 origin, glm::dvec3 direction) {
        const auto hit = proxy.intersect(origin, direction);
        return hit && !hit->opening ? hit->distance_m : kInfinity;
    };
    const Camera camera =
        probe.view_position_m
            ? ballCamera(probe.ball, *probe.view_position_m, radiance.width(), radiance.height())
            : photo_camera;
    LightProbe unwrapped = unwrapMirrorBall(radiance, probe.ball, camera, unwrap);
    append(light.findings, unwrapped.findings);
    light.environment = std::move(unwrapped.environment);
    return light;
}

}  // namespace insitu
