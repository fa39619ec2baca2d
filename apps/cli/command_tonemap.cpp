#include "apps/cli/command.h"
#include "composite/tonemap/reinhard.h"
#include "core/io/image_io.h"

namespace insitu::cli {

namespace {

struct TonemapArguments {
    std::filesystem::path input;
    std::filesystem::path output;
    std::string operator_name = "reinhard";
    ReinhardOptions reinhard;
    int bits = 8;
};

void runTonemap(const TonemapArguments& arguments, Context& context)
{
    context.start();
    context.checkOutput(arguments.output);
    if (!isRadianceFile(arguments.input))
        throw InputError(arguments.input.string(),
                         "is not a radiance image; give an .exr, .hdr or .pfm file");
    const auto tone_map = makeReinhard(arguments.reinhard);
    const RadianceImage scene = readRadiance(arguments.input);
    const Image<Rgb> display = tone_map->map(scene.pixels, context.progress());
    writeEncoded(arguments.output, encodeSrgb(display, arguments.bits == 16 ? 65535 : 255));
}

}  // namespace

void registerTonemap(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<TonemapArguments>();
    CLI::App* command =
        app.add_subcommand("tonemap", "Make a radiance image viewable on an ordinary display");
    command->add_option("input", arguments->input, "Radiance image (.exr, .hdr, .pfm)")->required();
    command->add_option("-o,--output", arguments->output, "Picture to write (.png, .jpg)")
        ->required();
    command->add_option("--operator", arguments->operator_name, "Tone mapping operator: reinhard")
        ->check(CLI::IsMember({"reinhard"}))
        ->capture_default_str();
    command->add_option("--key", arguments->reinhard.key, "Where the average luminance lands")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        ->add_option("--white",
                     arguments->reinhard.white,
                     "Smallest scaled luminance shown as white; default: the brightest pixel")
        ->check(CLI::PositiveNumber);
    command->add_option("--bits", arguments->bits, "Bits per channel (16: .png only)")
        ->check(CLI::IsMember({8, 16}))
        ->capture_default_str();
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu tonemap room.exr -o room.png\n"
        "  insitu tonemap night.exr -o night.png --key 0.09 --white 3");
    command->callback([arguments, &context] { runTonemap(*arguments, context); });
}

}  // namespace insitu::cli
