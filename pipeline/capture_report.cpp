#include "pipeline/capture_report.h"

#include "core/io/file.h"
#include "core/io/json.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

/// The plot's frame and what it shows: stops around the exposure of the middle code.
constexpr double kLeft = 50.0;
constexpr double kTop = 20.0;
constexpr double kWidth = 520.0;
constexpr double kHeight = 320.0;
constexpr double kLowestStop = -10.0;
constexpr double kHighestStop = 4.0;

double plotX(double stops)
{
    return kLeft + kWidth * (stops - kLowestStop) / (kHighestStop - kLowestStop);
}

double plotY(double code)
{
    return kTop + kHeight * (1.0 - code / 255.0);
}

std::string curvePath(const std::array<double, 256>& table)
{
    std::string path;
    for (std::size_t code = 0; code < table.size(); ++code) {
        const double stops = std::log2(std::max(table[code], 1e-30) / table[128]);
        if (stops < kLowestStop || stops > kHighestStop) continue;
        path += fmt::format("{}{:.2f} {:.2f} ",
                            path.empty() ? "M" : "L",
                            plotX(stops),
                            plotY(static_cast<double>(code)));
    }
    return path;
}

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

}  // namespace

void writeCaptureReport(const std::filesystem::path& path, const CapturedRadiance& captured)
{
    Json frames = Json::array();
    for (const CapturedFrame& frame : captured.frames)
        frames.push_back({{"image", frame.name},
                          {"nominal_exposure", frame.nominal_exposure},
                          {"used_exposure", frame.used_exposure},
                          {"clipped_fraction", frame.clipped_fraction},
                          {"black_fraction", frame.black_fraction}});
    const Json report = {{"format", "insitu-capture-report"},
                         {"version", 1},
                         {"exposures", frames},
                         {"response", toJson(captured.response)},
                         {"response_known", captured.response_known},
                         {"held_out_error_codes", captured.held_out_error_codes},
                         {"noise", noiseJson(captured.merged.noise)},
                         {"clipped_fraction", captured.merged.clipped_fraction},
                         {"findings", toJson(captured.findings)}};
    writeJson(path, report);
}

void writeResponsePlot(const std::filesystem::path& path, const ResponseCurve& response)
{
    constexpr std::array<const char*, 3> kColors = {"#c22", "#292", "#22c"};
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"600\" height=\"400\" "
        "font-family=\"sans-serif\" font-size=\"12\">\n"
        "<rect width=\"600\" height=\"400\" fill=\"white\"/>\n"
        "<text x=\"{}\" y=\"390\">exposure, stops from that of code 128 ({})</text>\n",
        kLeft,
        response.source);
    const auto line = [&](double x0, double y0, double x1, double y1) {
        svg += fmt::format(
            "<path d=\"M{:.1f} {:.1f} L{:.1f} {:.1f}\" stroke=\"#ccc\"/>\n", x0, y0, x1, y1);
    };
    for (double stop = kLowestStop; stop <= kHighestStop; stop += 2.0) {
        line(plotX(stop), plotY(0.0), plotX(stop), plotY(255.0));
        svg += fmt::format(
            "<text x=\"{:.1f}\" y=\"{:.1f}\">{:.0f}</text>\n", plotX(stop) - 6, 360.0, stop);
    }
    for (int code = 0; code <= 255; code += 51) {
        line(kLeft, plotY(code), kLeft + kWidth, plotY(code));
        svg += fmt::format("<text x=\"15\" y=\"{:.1f}\">{}</text>\n", plotY(code) + 4, code);
    }
    for (std::size_t c = 0; c < 3; ++c)
        svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>\n",
                           curvePath(response.exposure[c]),
                           kColors[c]);
    writeTextFile(path, svg + "</svg>\n");
}

}  // namespace insitu
