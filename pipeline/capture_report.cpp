#include "pipeline/capture_report.h"

#include "core/io/json.h"
#include "pipeline/capture_summary.h"

namespace insitu {

namespace {

Json noiseJson(const NoiseModel& noise)
{
    Json channels = Json::array();
    for (const ChannelNoise& channel : noise.channels)
        channels.push_back({{"read_variance", channel.read_variance},
                            {"gain", channel.gain},
                            {"code_variance", channel.code_variance},
                            {"neighbour_correlation", channel.neighbour_correlation}});
    return channels;
}

/// For each channel: levels, and the share of each frame there.
Json weightsJson(const CapturedRadiance& captured)
{
    Json channels = Json::array();
    for (int c = 0; c < 3; ++c) {
        const WeightCurve curve = mergeWeights(captured, c);
        channels.push_back({{"radiance", curve.radiance}, {"weight", curve.weight}});
    }
    return channels;
}

Json deviationsJson(const MergeResult& merged)
{
    Json steps = Json::array();
    for (const DeviationStep& step : mergedDeviations(merged))
        steps.push_back({{"luminance", step.radiance},
                         {"deviation_10", step.low},
                         {"deviation_50", step.median},
                         {"deviation_90", step.high},
                         {"pixels", step.pixels}});
    return steps;
}

Json frameJson(const CapturedFrame& frame)
{
    Json json = {{"image", frame.name},
                 {"nominal_exposure", frame.nominal_exposure},
                 {"used_exposure", frame.used_exposure},
                 {"clipped_fraction", frame.clipped_fraction},
                 {"black_fraction", frame.black_fraction}};
    if (frame.measured_exposure) json["measured_exposure"] = *frame.measured_exposure;
    return json;
}

}  // namespace

void writeCaptureReport(const std::filesystem::path& path, const CapturedRadiance& captured)
{
    Json frames = Json::array();
    for (const CapturedFrame& frame : captured.frames)
        frames.push_back(frameJson(frame));
    const Json report = {{"format", "insitu-capture-report"},
                         {"version", 1},
                         {"exposures", frames},
                         {"response", toJson(captured.response)},
                         {"response_known", captured.response_known},
                         {"held_out_error_codes", captured.held_out_error_codes},
                         {"noise", noiseJson(captured.merged.noise)},
                         {"weights", weightsJson(captured)},
                         {"deviations", deviationsJson(captured.merged)},
                         {"clipped_fraction", captured.merged.clipped_fraction},
                         {"findings", toJson(captured.findings)}};
    writeJson(path, report);
}

}  // namespace insitu
