#include "apps/cli/command.h"
#include "pipeline/simulate.h"

#include <fmt/format.h>

#include <iostream>

namespace insitu::cli {

namespace {

struct Options {
    std::filesystem::path room;
    std::filesystem::path folder;
    int samples_per_pixel = 0;
    double size = 1.0;
};

void run(const Options& options, bool seed_given, Context& context)
{
    context.start();
    SimulatedRoom room = readSimulatedRoom(options.room);
    if (seed_given) room.seed = context.options.seed;
    if (options.samples_per_pixel > 0)
        for (int* samples : {&room.samples_per_pixel,
                             &room.ball_samples_per_pixel,
                             &room.panorama_samples_per_pixel})
            *samples = options.samples_per_pixel;
    if (options.size < 1.0) room = resized(room, options.size);
    std::filesystem::create_directories(options.folder);
    context.checkOutput(options.folder / "project.json");
    const SimulatedCapture capture = simulate(room, context.progress());
    writeCapture(capture, room, options.folder);
    context.print(capture.findings);
    if (!context.options.quiet) std::cout << (options.folder / "project.json").string() << '\n';
}

}  // namespace

void registerSimulate(CLI::App& app, Context& context)
{
    CLI::App* command =
        app.add_subcommand("simulate", "A capture with known truth from a room file");
    auto options = std::make_shared<Options>();
    command->add_option("room", options->room, "room.json (docs/file_format.md)")->required();
    command->add_option("-o,--output", options->folder, "Folder for the capture")->required();
    command
        ->add_option(
            "--samples", options->samples_per_pixel, "Samples per pixel instead of the file's")
        ->check(CLI::Range(1, 1 << 20));
    command->add_option("--size", options->size, "Smaller pictures: fraction of the file's sizes")
        ->check(CLI::Range(0.01, 1.0));
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu simulate room.json -o capture/\n"
        "  insitu simulate room.json -o trial/ --size 0.25 --samples 32");
    command->callback([options, command, &context] {
        run(*options, command->get_option("--seed")->count() > 0, context);
    });
}

}  // namespace insitu::cli
