#include "pipeline/report.h"

#include "core/io/image_io.h"
#include "core/io/json.h"

#include <cmath>
#include <numbers>

namespace insitu {

namespace {

Json cameraJson(const CameraEstimate& estimate)
{
    const Camera& camera = estimate.camera;
    return {{"focal_px", Json::array({camera.focal_px.x, camera.focal_px.y})},
            {"focal_px_sigma", estimate.focal_sigma_px},
            {"position_m", toJson(camera.position_m)},
            {"position_m_sigma", toJson(estimate.position_sigma_m)},
            {"rotation_deg_sigma", estimate.rotation_sigma_rad * 180.0 / std::numbers::pi},
            {"principal_point_px", toJson(camera.principal_px)},
            {"principal_point_px_sigma", toJson(estimate.principal_sigma_px)},
            {"division", camera.division},
            {"division_sigma", estimate.division_sigma},
            {"residual_rms_px", estimate.residual_rms_px}};
}

/// How far off each object may stand, from the camera's covariance; null where that is unknown.
Json placementsJson(const Project& project, const CameraEstimate& estimate)
{
    constexpr double kCentimetres = 100.0;
    Json list = Json::array();
    for (const ProjectObject& object : project.objects) {
        const auto sigma = placementSigma(estimate, object.position_m);
        list.push_back(sigma ? Json{{"along_cm", kCentimetres * sigma->along_m},
                                    {"across_cm", kCentimetres * sigma->across_m},
                                    {"height_cm_per_m", kCentimetres * sigma->height_m}}
                             : Json());
    }
    return list;
}

/// Gains: the photograph's light over the probe's.
Json balanceJson(const PhotoBalance& balance)
{
    Json json = {{"pixels", balance.pixels}, {"used", toJson(balance.used)}};
    if (balance.pixels == 0) return json;
    json["measured"] = toJson(balance.measured);
    json["spread"] = toJson(balance.spread);
    json["color_sigma"] = toJson(balance.color_sigma);
    json["luminance"] = balance.luminance;
    json["luminance_spread"] = balance.luminance_spread;
    return json;
}

/// What of the photograph's camera the objects got, and what was seen but counts as nothing.
Json cameraMatchJson(const CameraMatchEstimate& estimate)
{
    const CameraMatch& match = estimate.match;
    Json grain = Json::array();
    for (int c = 0; c < 3; ++c)
        grain.push_back(match.grain.sigmaAt(c, 118.0));
    return {{"grain_codes_at_middle_grey", grain},
            {"blur_px", match.blur_px},
            {"blur_px_sigma", estimate.blur.sigma_of_sigma_px},
            {"edges", estimate.blur.edges},
            {"magnification_red", match.magnification.r},
            {"magnification_blue", match.magnification.b},
            {"vignetting", match.vignetting.a},
            {"vignetting_sigma",
             std::isfinite(estimate.vignetting.sigma) ? Json(estimate.vignetting.sigma) : Json()},
            {"focus_m", match.depth_of_field ? Json(match.depth_of_field->focus_m) : Json()}};
}

/// null where nothing was sampled.
Json sampledErrorJson(const SampledError& error)
{
    if (error.pixels == 0) return {};
    return {{"pixels", error.pixels}, {"rms", error.rms}, {"upper", error.upper}};
}

}  // namespace

void writeReport(const std::filesystem::path& path,
                 const Project& project,
                 const InsertOptions& options,
                 const InsertResult& result,
                 const std::filesystem::path& picture)
{
    Json times = Json::object();
    Json cached = Json::array();
    for (const StageTime& time : result.times) {
        times[time.stage] = time.seconds;
        if (time.from_cache) cached.push_back(time.stage);
    }
    const Json report = {
        {"format", "insitu-report"},
        {"version", 1},
        {"project", project.file.string()},
        {"picture", picture.string()},
        {"camera", cameraJson(result.camera)},
        {"placement_sigma", placementsJson(project, result.camera)},
        {"light",
         {{"center_m", toJson(result.light.center_m)},
          {"environment_px",
           Json::array({result.light.environment.pixels.width(),
                        result.light.environment.pixels.height()})},
          {"response", result.light.response.source},
          {"photo_response", result.photo_response.source},
          {"photo_relative_exposure", result.photo_relative_exposure},
          {"white_balance", balanceJson(result.balance)}}},
        {"render",
         {{"technique", techniqueName(result.render.technique)},
          {"seed", options.render.seed},
          {"max_samples", options.render.max_samples},
          {"mean_samples", result.render.mean_samples},
          {"stopped_by_time", result.render.stopped_by_time},
          {"ratio_standard_error", result.render.ratio_error},
          {"technique_asked", techniqueName(options.render.technique)},
          {"interreflection", options.render.interreflection.enabled},
          {"fiv_error", sampledErrorJson(result.render.fiv_error)},
          {"no_interreflection_error", sampledErrorJson(result.render.no_interreflection_error)},
          {"table_bytes", result.render.table_bytes},
          {"table_seconds", result.render.table_seconds}}},
        {"composite",
         {{"form", compositeFormName(options.composite.form)},
          {"influence_codes", options.composite.influence_codes},
          {"influence_fraction", result.composite.influence_fraction}}},
        {"camera_match", cameraMatchJson(result.match)},
        {"findings", toJson(result.findings)},
        {"seconds", times},
        {"from_cache", cached}};
    writeJson(path, report);
}

void writeLayers(const std::filesystem::path& path, const InsertResult& result)
{
    std::vector<ExrChannel> channels;
    addColorLayer(channels, "beauty", result.composite.linear);
    // As they lie on the photograph, with its camera's blur and aberration.
    const PhotoLayers& layers = result.layers;
    addColorLayer(channels, "object", layers.object);
    addColorLayer(channels, "irradiance.with", layers.irradiance_with);
    addColorLayer(channels, "irradiance.without", layers.irradiance_without);
    Image<Rgb> ratio(layers.object.width(), layers.object.height(), Rgb(1.0f));
    Image<Rgb> difference(layers.object.width(), layers.object.height());
    Image<float> coverage(layers.object.width(), layers.object.height());
    for (std::size_t i = 0; i < ratio.pixelCount(); ++i) {
        const Rgb with = layers.irradiance_with.pixels()[i];
        const Rgb without = layers.irradiance_without.pixels()[i];
        for (int c = 0; c < 3; ++c)
            if (without[c] > 0.0f) ratio.pixels()[i][c] = with[c] / without[c];
        difference.pixels()[i] = with - without;
        coverage.pixels()[i] = layers.coverage.pixels()[i].g;
    }
    addColorLayer(channels, "shadow.ratio", ratio);
    addColorLayer(channels, "shadow.difference", difference);
    channels.push_back({"object.A", std::move(coverage)});
    channels.push_back({"depth.Z", layers.depth_m});
    channels.push_back({"variance.object.Y", layers.object_variance});
    channels.push_back({"variance.ratio.Y", result.render.layers.ratio_variance});
    Image<float> influence(layers.object.width(), layers.object.height());
    for (std::size_t i = 0; i < influence.pixelCount(); ++i)
        influence.pixels()[i] = result.composite.influence.pixels()[i];
    channels.push_back({"influence.Y", std::move(influence)});
    writeLayeredExr(path, channels);
}

}  // namespace insitu
