#include "apps/cli/command.h"
#include "calib/automatic_calibration.h"
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
    bool automatic = false;
    std::vector<double> origin_px;
    AutomaticOptions automatic_options;
    CalibrationOptions options;
};

CalibrationOptions optionsOf(const CalibrateArguments& arguments)
{
    CalibrationOptions options = arguments.options;
    options.use_exif = !arguments.ignore_exif_focal;
    if (arguments.focal_px) {
        // A focal length given by hand is meant: what stays open is the lens, not the number.
        options.exif_focal_px = arguments.focal_px;
        options.exif_focal_sigma = 0.01;
    }
    return options;
}

/// By hand, by hand and completed, or by itself.
CameraEstimate estimate(const CalibrateArguments& arguments)
{
    const CalibrationOptions options = optionsOf(arguments);
    const Photo photo = readPhoto(arguments.photo);
    if (arguments.lines.empty()) {
        AutomaticOptions automatic = arguments.automatic_options;
        if (arguments.origin_px.size() == 2)
            automatic.origin_px = glm::dvec2(arguments.origin_px[0], arguments.origin_px[1]);
        return calibrateAutomatically(photo, options, automatic, arguments.photo.string()).camera;
    }
    const LineSet lines = readLineSet(arguments.lines);
    if (!arguments.automatic)
        return calibratePhoto(lines, photo, options, arguments.lines.string());
    return calibrateCompleted(
               lines, photo, options, arguments.automatic_options.lines, arguments.lines.string())
        .camera;
}

void runCalibrate(const CalibrateArguments& arguments, Context& context)
{
    context.start();
    if (arguments.lines.empty() && !arguments.automatic)
        throw CLI::RequiredError("--lines or --auto");
    context.checkOutput(arguments.output);
    const CameraEstimate found = estimate(arguments);
    context.print(found.findings);
    writeCamera(arguments.output, found);
}

/// What the photograph itself does not tell an automatic calibration.
void addAutomaticOptions(CLI::App& command, CalibrateArguments& arguments)
{
    AutomaticOptions& automatic = arguments.automatic_options;
    auto* flag = command.add_flag("--auto",
                                  arguments.automatic,
                                  "Find the room's edges in the photograph; with --lines, put the "
                                  "strokes onto edges and complete them");
    command
        .add_option("--origin",
                    arguments.origin_px,
                    "With --auto alone: pixel (x y) of the floor point that becomes the world's "
                    "origin [below the middle]")
        ->expected(2)
        ->needs(flag);
    command
        .add_option("--camera-height",
                    automatic.camera_height_m,
                    "With --auto alone: height of the camera over the floor, metres [called 1]")
        ->check(CLI::PositiveNumber)
        ->needs(flag);
    command
        .add_option("--camera-height-sigma",
                    automatic.camera_height_sigma_m,
                    "Standard deviation of --camera-height, metres")
        ->check(CLI::NonNegativeNumber)
        ->needs(flag)
        ->capture_default_str();
    command
        .add_flag("--accept-doubtful",
                  automatic.accept_doubtful,
                  "With --auto: give the answer, with a warning, even when nothing vouches for it")
        ->needs(flag);
}

}  // namespace

void registerCalibrate(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<CalibrateArguments>();
    CLI::App* command = app.add_subcommand(
        "calibrate", "Find the camera from lines along the room's axes, marked or found");
    command->add_option("photo", arguments->photo, "Photograph (.jpg, .png, .tif)")->required();
    command->add_option("--lines", arguments->lines, "Marked lines, origin and scale (.json)");
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
    addAutomaticOptions(*command, *arguments);
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu calibrate room.jpg --lines lines.json -o camera.json\n"
        "  insitu calibrate room.jpg --auto --camera-height 1.5 --origin 2010 1702 -o camera.json\n"
        "  insitu calibrate scan.tif --lines lines.json --focal-px 2150 -o camera.json");
    command->callback([arguments, &context] { runCalibrate(*arguments, context); });
}

}  // namespace insitu::cli
