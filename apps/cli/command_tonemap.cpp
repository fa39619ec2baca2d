#include "apps/cli/command.h"
#include "apps/cli/tonemap_options.h"
#include "composite/tonemap/frame_mapper.h"
#include "composite/tonemap/strips.h"
#include "core/io/encoded_rows.h"
#include "core/io/radiance_rows.h"

#include <cstdint>
#include <memory>
#include <set>
#include <vector>

namespace insitu::cli {

namespace {

namespace fs = std::filesystem;

struct TonemapArguments {
    std::vector<fs::path> inputs;
    fs::path output;
    TonemapOptions tone;
    bool same_curve = false;
    double frames_per_second = 0.0;  ///< 0: no film
    AdaptationOptions adaptation;
    int bits = 8;
};

/// Where each picture goes: the named file, or, of several, one in the named folder each.
std::vector<fs::path> outputsOf(const TonemapArguments& arguments)
{
    if (arguments.inputs.size() == 1) return {arguments.output};
    if (!fs::is_directory(arguments.output))
        throw InputError(arguments.output.string(),
                         "is not a folder; several pictures need one to go to");
    std::vector<fs::path> outputs;
    std::set<fs::path> taken;
    for (const fs::path& input : arguments.inputs) {
        outputs.push_back(arguments.output / input.stem().concat(".png"));
        if (!taken.insert(outputs.back()).second)
            throw InputError(input.string(),
                             "another input has the same name, and so the same output; rename it");
    }
    return outputs;
}

/// Pictures up to this size are read once and kept, larger ones in strips again and again.
constexpr std::int64_t kKeptPixels = 64'000'000;

std::unique_ptr<RadianceRows> openPicture(const fs::path& input)
{
    auto rows = openRadianceRows(input);
    const std::int64_t pixels = std::int64_t{rows->width()} * rows->height();
    if (pixels > kKeptPixels) return rows;
    Image<Rgb> image(rows->width(), rows->height());
    rows->read(0, image);
    return std::make_unique<ImageRows>(std::move(image));
}

/// Of all pictures together; each is read again afterwards, so that one at a time is in memory.
SceneStatistics commonStatistics(const std::vector<fs::path>& inputs, Progress& progress)
{
    SceneStatistics statistics;
    for (const fs::path& input : inputs)
        statistics = statistics.joined(measureRows(*openPicture(input), progress));
    return statistics;
}

void mapPicture(RadianceRows& rows,
                const ToneMapOperator& tone_map,
                const SceneStatistics& statistics,
                const fs::path& output,
                int max_code,
                Progress& progress)
{
    EncodedRowWriter writer(output, {rows.width(), rows.height(), max_code});
    mapRows(
        rows,
        tone_map,
        statistics,
        [&](const Image<Rgb>& display) { writer.write(encodeSrgb(display, max_code)); },
        progress);
    writer.finish();
}

void runTonemap(const TonemapArguments& arguments, const CLI::App& command, Context& context)
{
    context.start();
    if ((arguments.same_curve || arguments.frames_per_second > 0.0) &&
        !arguments.tone.sharesCurves())
        throw CLI::ValidationError(arguments.same_curve ? "--same-curve" : "--frames-per-second",
                                   "operator " + arguments.tone.name() +
                                       " makes its curve from each picture alone; leave one of "
                                       "the two out");
    const std::vector<fs::path> outputs = outputsOf(arguments);
    for (const fs::path& output : outputs)
        context.checkOutput(output);
    for (const fs::path& input : arguments.inputs)
        if (!isRadianceFile(input))
            throw InputError(input.string(),
                             "is not a radiance image; give an .exr, .hdr or .pfm file");
    const auto tone_map = arguments.tone.make(command);
    SceneStatistics common;
    if (arguments.same_curve) common = commonStatistics(arguments.inputs, context.progress());
    const bool film = arguments.frames_per_second > 0.0;
    AdaptationSmoother smoother(arguments.adaptation);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        const auto rows = openPicture(arguments.inputs[i]);
        SceneStatistics statistics =
            arguments.same_curve ? common : measureRows(*rows, context.progress());
        if (film) statistics = smoother.next(statistics, 1.0 / arguments.frames_per_second);
        mapPicture(*rows,
                   *tone_map,
                   statistics,
                   outputs[i],
                   arguments.bits == 16 ? 65535 : 255,
                   context.progress());
    }
}

}  // namespace

void registerTonemap(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<TonemapArguments>();
    CLI::App* command =
        app.add_subcommand("tonemap", "Make radiance images viewable on an ordinary display");
    command->add_option("input", arguments->inputs, "Radiance images (.exr, .hdr, .pfm)")
        ->required();
    command
        ->add_option("-o,--output",
                     arguments->output,
                     "Picture to write (.png, .jpg); of several inputs, the folder for NAME.png")
        ->required();
    arguments->tone.addTo(*command);
    command->add_flag("--same-curve",
                      arguments->same_curve,
                      "One curve for all inputs, made from all of them: the same look");
    command
        ->add_option("--frames-per-second",
                     arguments->frames_per_second,
                     "The inputs are the frames of a film, in order: the look follows them "
                     "without jumps and flicker")
        ->check(CLI::PositiveNumber)
        ->excludes("--same-curve");
    command
        ->add_option("--adaptation-seconds",
                     arguments->adaptation.time_constant_s,
                     "Time after which the look has followed 63 % of a change")
        ->check(CLI::NonNegativeNumber)
        ->needs("--frames-per-second")
        ->capture_default_str();
    command->add_option("--bits", arguments->bits, "Bits per channel (16: .png only)")
        ->check(CLI::IsMember({8, 16}))
        ->capture_default_str();
    context.addCommonOptions(*command);
    command->footer(
        "Black stays black; negative values of a file count as 0, NaN and infinity are refused.\n"
        "Examples:\n"
        "  insitu tonemap room.exr -o room.png --operator ashikhmin\n"
        "  insitu tonemap night.exr -o night.png --key 0.09 --white 3\n"
        "  insitu tonemap night.exr -o night.png --operator histogram --scene-white-cd-m2 0.1\n"
        "  insitu tonemap *.exr -o pictures/ --same-curve\n"
        "  insitu tonemap frame_*.exr -o film/ --frames-per-second 25");
    command->callback(
        [arguments, command, &context] { runTonemap(*arguments, *command, context); });
}

}  // namespace insitu::cli
