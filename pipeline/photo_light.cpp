#include "pipeline/photo_light.h"

#include "pipeline/common_surfaces.h"
#include "pipeline/photo_balance.h"
#include "pipeline/photo_response.h"
#include "pipeline/reference_capture.h"

#include <fmt/format.h>

#include <algorithm>

namespace insitu {

namespace {

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

/// Why the photograph's response is not known.
std::string unknownResponse(const InsertResult& result)
{
    const PhotoMetadata& photo = result.photo.metadata;
    const PhotoMetadata& probe = result.light.metadata;
    if (!result.light.response_known)
        return "no response was recovered for the photograph's camera";
    return fmt::format(
        "the photograph is from '{} {}' in '{}', the light probe from '{} {}' in "
        "'{}'",
        photo.make,
        photo.model,
        photo.color.name,
        probe.make,
        probe.model,
        probe.color.name);
}

/// The profile's curve, or what surfaces of known radiance say against it.
void assumeResponse(const SceneProxy& proxy, InsertResult& result)
{
    const PhotoMetadata& photo = result.photo.metadata;
    result.photo_response = scaledAtMiddle(photo.color.transfer);
    std::string told = "nothing else tells it";
    // Radiance by an assumed curve would only find that curve again; an environment's file holds
    // radiance.
    const bool radiance_known = result.light.response_known || result.light.metadata.make.empty();
    if (radiance_known && photo.color.hasRec709Primaries()) {
        const PhotoResponseEstimate estimate = estimatePhotoResponse(
            result.photo.image,
            result.photo_response,
            commonPixels(
                result.camera.camera, proxy, result.light.environment, result.light.center_m));
        if (estimate.differs) {
            result.photo_response = estimate.curve;
            result.findings.push_back(
                {Severity::Warning,
                 "photo-response-estimated",
                 fmt::format("{}: from {} pixels of surfaces that the light probe sees too, its "
                             "response is {} to the power {:.3f} ± {:.3f}{}; they then agree "
                             "within {:.1f} % instead of {:.1f} %",
                             unknownResponse(result),
                             estimate.pixels,
                             photo.color.transfer.source,
                             estimate.power,
                             estimate.power_sigma,
                             estimate.bend != 0.0 ? fmt::format(", bent by {:.3f} ± {:.3f}",
                                                                estimate.bend,
                                                                estimate.bend_sigma)
                                                  : "",
                             100.0 * estimate.spread,
                             100.0 * estimate.spread_assumed)});
            return;
        }
        told = estimate.power_sigma > 0.0
                   ? fmt::format(
                         "surfaces that the light probe sees too do not contradict it "
                         "(power {:.3f} ± {:.3f})",
                         estimate.power,
                         estimate.power_sigma)
                   : "too few surfaces are seen by the light probe too to tell";
    }
    result.findings.push_back({Severity::Warning,
                               "photo-response-assumed-srgb",
                               fmt::format("{}: its response is assumed to be {}; {}",
                                           unknownResponse(result),
                                           photo.color.transfer.source,
                                           told)});
}

}  // namespace

void choosePhotoResponse(const Project& project, const SceneProxy& proxy, InsertResult& result)
{
    const PhotoMetadata& photo = result.photo.metadata;
    if (!result.photo.radiance.empty()) {
        const Exposure& given = project.photo.exposure;
        if (given.seconds || given.f_number || given.iso)
            throw InputError(project.photo.path.string(),
                             "holds radiance, not codes of an exposure: leave exposure_seconds, "
                             "f_number and iso out of \"photo\"");
        result.photo_response = photo.color.transfer;
        return;
    }
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
        assumeResponse(proxy, result);
    }
    const auto relative = exposure.relative();
    if (!relative && result.light.radiance_unit_known)
        throw InputError(project.photo.path.string(),
                         "no exposure time in EXIF; add \"exposure_seconds\" beside \"image\" in "
                         "the project file");
    result.photo_relative_exposure = relative.value_or(1.0);
}

PhotoLight photoLight(const Project& project,
                      const SceneProxy& proxy,
                      const glm::dmat3& primaries,
                      InsertResult& result)
{
    PhotoLight light;
    light.taken = !result.photo.radiance.empty()
                      ? result.photo.radiance
                      : photographedRadiance(result.photo.image,
                                             result.photo_response,
                                             result.photo_relative_exposure,
                                             primaries);
    glm::dvec3 clip;
    for (std::size_t c = 0; c < 3; ++c)
        clip[static_cast<int>(c)] =
            result.photo_response.exposure[c][255] / result.photo_relative_exposure;
    const Camera& camera = result.camera.camera;
    result.balance = measurePhotoBalance(
        light.taken, clip, camera, proxy, result.light.environment, result.light.center_m);
    // An HDR photograph may be in any unit.
    const bool same_unit = result.light.radiance_unit_known && result.photo.radiance.empty();
    choosePhotoBalance(project.white_balance, same_unit, result.balance);
    append(result.findings, std::move(result.balance.findings));
    if (!same_unit && (result.photo.radiance.empty() || result.balance.pixels == 0)) return light;
    light.in_probe_unit = {camera, light.taken};
    if (result.balance.used != glm::dvec3(1.0))
        for (Rgb& value : light.in_probe_unit->radiance.pixels())
            value /= Rgb(result.balance.used);
    return light;
}

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

}  // namespace insitu
