#include "apps/cli/bracket_input.h"
#include "apps/cli/command.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "pipeline/capture_report.h"

#include <algorithm>
#include <cctype>
#include <string>
#include <vector>

namespace insitu::cli {

namespace {

struct MergeArguments {
    BracketArguments bracket;
    std::filesystem::path output;
    std::filesystem::path save_response;
    std::filesystem::path report;
    std::filesystem::path plot;
};

bool isExr(const std::filesystem::path& path)
{
    std::string extension = path.extension().string();
    std::ranges::transform(extension, extension.begin(), [](unsigned char c) {
        return static_cast<char>(std::tolower(c));
    });
    return extension == ".exr";
}

/// OpenEXR holds what the other formats have no place for: variance and validity.
void writeMerged(const std::filesystem::path& path, const MergeResult& merged)
{
    if (!isExr(path)) {
        writeRadiance(path, merged.radiance.pixels);
        return;
    }
    std::vector<ExrChannel> channels;
    addColorLayer(channels, "", merged.radiance.pixels);
    addColorLayer(channels, "variance", merged.variance);
    ExrChannel validity{"validity",
                        Image<float>(merged.validity.width(), merged.validity.height())};
    std::ranges::copy(merged.validity.pixels(), validity.values.pixels().begin());
    channels.push_back(std::move(validity));
    writeLayeredExr(path, channels);
}

void runMerge(const MergeArguments& arguments, Context& context)
{
    context.start();
    for (const auto& path :
         {arguments.output, arguments.save_response, arguments.report, arguments.plot})
        if (!path.empty()) context.checkOutput(path);
    if (!isRadianceFile(arguments.output))
        throw InputError(arguments.output.string(), "radiance is written as .exr, .hdr or .pfm");
    const CapturedRadiance result = mergeArguments(arguments.bracket, context);
    writeMerged(arguments.output, result.merged);
    if (!arguments.save_response.empty())
        writeJson(arguments.save_response, toJson(result.response));
    if (!arguments.report.empty()) writeCaptureReport(arguments.report, result);
    if (!arguments.plot.empty()) writeCapturePlot(arguments.plot, result);
}

}  // namespace

void registerMerge(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<MergeArguments>();
    CLI::App* command =
        app.add_subcommand("merge", "Merge bracketed exposures into one radiance image");
    addBracketOptions(*command, arguments->bracket);
    command
        ->add_option("-o,--output", arguments->output, "Radiance image to write (.exr, .hdr, .pfm)")
        ->required();
    command->add_option(
        "--save-response", arguments->save_response, "Write the response curve (.json)");
    command->add_option("--report",
                        arguments->report,
                        "Also write exposures, response, weights, noise and findings (.json)");
    command->add_option("--plot",
                        arguments->plot,
                        "Also draw response, weights, exposures, deviations and clipping (.svg)");
    context.addCommonOptions(*command);
    command->footer(
        "An .exr also holds the layers variance.R, .G, .B (of the radiance, per pixel) and "
        "validity\n"
        "(bits: 1 clipped, 2 black, 4 a single frame, 8 something excluded, 16 beside clipped "
        "pixels\n"
        "in every frame).\n"
        "Examples:\n"
        "  insitu merge IMG_1.jpg IMG_2.jpg IMG_3.jpg -o room.exr --save-response camera.json\n"
        "  insitu merge a.png b.png --exposures 1/60,1/15 --response camera.json -o room.exr");
    command->callback([arguments, &context] { runMerge(*arguments, context); });
}

}  // namespace insitu::cli
