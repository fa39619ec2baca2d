#include "apps/cli/command.h"
#include "calib/photo_calibration.h"
#include "core/io/image_io.h"

namespace insitu::cli {

namespace {

struct CalibrateArguments {
    std::filesystem::path photo;
    std::filesystem::path lines;
    std::filesystem::path output;
    std::optional<double> focal_px;
    bool ignore_exif_focal = false;
    CalibrationOptions options;
};

void runCalibrate(const CalibrateArguments& arguments, Context& context)
{
    context.start();
    context.checkOutput(arguments.output);
    CalibrationOptions options = arguments.options;
    options.use_exif = !arguments.ignore_exif_focal;
    if (arguments.focal_px) {
        // A focal length given by hand is meant: what stays open is the lens, not the number.
        options.exif_focal_px = arguments.focal_px;
        options.exif_focal_sigma = 0.01;
    }
    const LineSet lines = readLineSet(arguments.lines);
    const Photo photo = readPhoto(arguments.photo);
    const CameraEstimate estimate = calibratePhoto(lines, photo, options, arguments.lines.string());
    context.print(estimate.findings);
    writeCamera(arguments.output, estimate);
}

}  // namespace

void registerCalibrate(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<CalibrateArguments>();
    CLI::App* command =
        app.add_subcommand("calibrate", "Find the camera from lines marked along the room's axes");
    command->add_option("photo", arguments->photo, "Photograph (.jpg, .png, .tif)")->required();
    command->add_option("--lines", arguments->lines, "Marked lines, origin and scale (.json)")
        ->required();
    command->add_option("-o,--output", arguments->output, "Camera file to write (.json)")
        ->required();
    command
        ->add_option("--segment-sigma-px",
                     arguments->options.segment_sigma_px,
                     "How exactly the ends were marked, standard deviation in pixels")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command
        ->add_option(
            "--focal-px", arguments->focal_px, "Focal length in pixels, in place of EXIF's")
        ->check(CLI::PositiveNumber);
    command->add_flag("--ignore-exif-focal",
                      arguments->ignore_exif_focal,
                      "Use the lines alone where they suffice; EXIF only checks");
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu calibrate room.jpg --lines lines.json -o camera.json\n"
        "  insitu calibrate scan.tif --lines lines.json --focal-px 2150 -o camera.json");
    command->callback([arguments, &context] { runCalibrate(*arguments, context); });
}

}  // namespace insitu::cli
