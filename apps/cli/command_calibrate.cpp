#include "apps/cli/command.h"
#include "calib/automatic_calibration.h"
#include "calib/calibration_overlay.h"
#include "calib/camera_formats.h"
#include "calib/photo_calibration.h"
#include "calib/room_views.h"
#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "pipeline/probe_location.h"

#include <iostream>

namespace insitu::cli {

namespace {

struct CalibrateArguments {
    std::filesystem::path photo;
    std::filesystem::path lines;
    std::filesystem::path from;
    std::filesystem::path views;
    std::string picture;
    std::filesystem::path output;
    std::filesystem::path overlay;
    std::filesystem::path ball_photo;
    double ball_radius_m = 0.0;
    double ball_radius_sigma_m = 0.0;
    std::vector<double> ball_near;
    std::vector<int> board_size;
    MarkerBoard board;
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

/// A camera and the segments it rests on.
struct Calibrated {
    CameraEstimate camera;
    std::vector<LineSegment> segments;
};

/// From another program, by hand, by hand and completed, or by itself.
Calibrated calibrate(const CalibrateArguments& arguments, const std::optional<Photo>& photo)
{
    if (!arguments.from.empty()) {
        CameraReading reading{{}, arguments.picture};
        if (reading.picture.empty()) reading.picture = arguments.photo.filename().string();
        if (photo)
            reading.size_px = glm::ivec2(photo->image.codes.width(), photo->image.codes.height());
        return {readCameraFile(arguments.from, reading), {}};
    }
    const CalibrationOptions options = optionsOf(arguments);
    if (arguments.lines.empty()) {
        AutomaticOptions automatic = arguments.automatic_options;
        if (arguments.origin_px.size() == 2)
            automatic.origin_px = glm::dvec2(arguments.origin_px[0], arguments.origin_px[1]);
        AutomaticCalibration found =
            calibrateAutomatically(*photo, options, automatic, arguments.photo.string());
        return {std::move(found.camera), std::move(found.lines.segments)};
    }
    const LineSet lines = readLineSet(arguments.lines);
    const std::string source = arguments.lines.string();
    if (!arguments.automatic)
        return {calibratePhoto(lines, *photo, options, source), lines.segments};
    AutomaticCalibration found =
        calibrateCompleted(lines, *photo, options, arguments.automatic_options.lines, source);
    return {std::move(found.camera), std::move(found.lines.segments)};
}

Json listOf(glm::dvec3 v)
{
    return Json::array({v.x, v.y, v.z});
}

/// Where the ball stands, as JSON on stdout, in the keys of a project's probe.
void printBall(const CalibrateArguments& arguments,
               const Photo& photo,
               const CameraEstimate& camera,
               Context& context)
{
    std::optional<BallOutline> near;
    if (arguments.ball_near.size() == 3) {
        near.emplace();
        near->center_px = {arguments.ball_near[0], arguments.ball_near[1]};
        near->radius_px = arguments.ball_near[2];
    }
    const Photo picture = developed(readPhoto(arguments.ball_photo));
    const std::string source = arguments.ball_photo.string();
    BallByBoard found;
    if (arguments.board_size.empty()) {
        LocatedBall ball = locateBall(
            picture, camera, arguments.ball_radius_m, arguments.ball_radius_sigma_m, near, source);
        found.outline = ball.outline;
        found.location.ball = ball.place;
        found.findings = std::move(ball.findings);
    } else {
        MarkerBoard board = arguments.board;
        board.columns = arguments.board_size[0];
        board.rows = arguments.board_size[1];
        found = locateBallByBoard(photo,
                                  camera,
                                  picture,
                                  board,
                                  arguments.ball_radius_m,
                                  arguments.ball_radius_sigma_m,
                                  near,
                                  source);
    }
    context.print(found.findings);
    const BallPlace& place = found.location.ball;
    Json json = {{"center_m", listOf(place.center_m)},
                 {"center_m_sigma", listOf(place.sigma_m)},
                 {"center_px", {found.outline.center_px.x, found.outline.center_px.y}},
                 {"radius_px", found.outline.radius_px}};
    if (!arguments.board_size.empty())
        json["view"] = {{"position_m", listOf(found.location.close_up.position_m)}};
    std::cout << json.dump(2) << "\n";
}

/// All photographs of a room at once: a camera file each, named as the view, in a folder.
void joinAll(const CalibrateArguments& arguments, Context& context)
{
    const RoomViews room = readRoomViews(arguments.views);
    std::vector<std::filesystem::path> files;
    for (const RoomView& view : room.views) {
        files.push_back(arguments.output / (view.name + ".json"));
        if (std::filesystem::exists(arguments.output)) context.checkOutput(files.back());
    }
    const JoinedViews joined = joinViews(room, optionsOf(arguments), arguments.views.string());
    context.print(joined.findings);
    std::filesystem::create_directories(arguments.output);
    for (std::size_t i = 0; i < files.size(); ++i)
        writeCamera(files[i], joined.cameras[i]);
}

void runCalibrate(const CalibrateArguments& arguments, Context& context)
{
    context.start();
    if (!arguments.views.empty()) {
        joinAll(arguments, context);
        return;
    }
    if (arguments.from.empty() && arguments.lines.empty() && !arguments.automatic)
        throw CLI::RequiredError("--lines, --auto, --from or --views");
    if (arguments.photo.empty() &&
        (arguments.from.empty() || !arguments.overlay.empty() || !arguments.ball_photo.empty()))
        throw CLI::RequiredError("photo");
    for (const std::filesystem::path& file : cameraFilesOf(arguments.output))
        context.checkOutput(file);
    if (!arguments.overlay.empty()) context.checkOutput(arguments.overlay);
    if (!arguments.ball_photo.empty() && !(arguments.ball_radius_m > 0.0))
        throw CLI::RequiredError("--ball-radius");
    std::optional<Photo> photo;
    std::vector<std::uint8_t> bytes;
    if (!arguments.photo.empty()) {
        photo = readPhotograph(arguments.photo);
        bytes = readFile(arguments.photo, kMaxEncodedBytes);
    }
    const Calibrated found = calibrate(arguments, photo);
    context.print(found.camera.findings);
    if (!arguments.ball_photo.empty()) printBall(arguments, *photo, found.camera, context);
    context.print(writeCameraFile(
        arguments.output, found.camera, arguments.photo.filename().string(), bytes));
    if (!arguments.overlay.empty())
        writeEncoded(arguments.overlay,
                     drawCalibration(photo->image, found.camera, found.segments));
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

/// Where a mirror ball stands in the room.
void addBallOptions(CLI::App& command, CalibrateArguments& arguments)
{
    auto* picture = command.add_option("--locate-ball",
                                       arguments.ball_photo,
                                       "The same view with a mirror ball in it: prints where the "
                                       "ball is in the room, with its uncertainty");
    command.add_option("--ball-radius", arguments.ball_radius_m, "Radius of the ball, metres")
        ->check(CLI::PositiveNumber)
        ->needs(picture);
    command
        .add_option("--ball-radius-sigma",
                    arguments.ball_radius_sigma_m,
                    "Standard deviation of --ball-radius, metres")
        ->check(CLI::NonNegativeNumber)
        ->needs(picture)
        ->capture_default_str();
    command
        .add_option("--ball-near",
                    arguments.ball_near,
                    "Where the ball is seen: x y radius, pixels, within a tenth of the radius "
                    "[searched]")
        ->expected(3)
        ->needs(picture);
    auto* board =
        command.add_option("--board",
                           arguments.board_size,
                           "Columns and rows of a printed board of ArUco markers (4x4_50) "
                           "that both pictures show: --locate-ball may then be a close-up "
                           "by any camera with EXIF");
    board->expected(2)->check(CLI::Range(1, 50))->needs(picture);
    command.add_option("--board-marker", arguments.board.marker_m, "Side of a marker, metres")
        ->check(CLI::PositiveNumber)
        ->needs(board)
        ->capture_default_str();
    command.add_option("--board-gap", arguments.board.gap_m, "Gap between markers, metres")
        ->check(CLI::PositiveNumber)
        ->needs(board)
        ->capture_default_str();
}

}  // namespace

void registerCalibrate(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<CalibrateArguments>();
    CLI::App* command = app.add_subcommand(
        "calibrate", "Find the camera from lines along the room's axes, marked or found");
    command->add_option(
        "photo", arguments->photo, "Photograph (.jpg, .png, .tif); --from may do without");
    command->add_option("--lines", arguments->lines, "Marked lines, origin and scale (.json)");
    command
        ->add_option("--from",
                     arguments->from,
                     "Camera of another program instead of lines: .fspy, .fspy.json, .gltf, "
                     ".blender.json, COLMAP's cameras.txt, or ours")
        ->excludes("--lines");
    command
        ->add_option("--views",
                     arguments->views,
                     "Several photographs of one room (.json): all their cameras in one solve, "
                     "written into the folder -o")
        ->excludes("photo")
        ->excludes("--lines")
        ->excludes("--from");
    command->add_option("--picture", arguments->picture, "With --from cameras.txt: whose camera")
        ->needs("--from");
    command
        ->add_option("-o,--output",
                     arguments->output,
                     "Camera to write; the name's end says how: .json, .fspy, .fspy.json, .gltf, "
                     ".blender.json, cameras.txt")
        ->required();
    command->add_option(
        "--overlay",
        arguments->overlay,
        "Picture (.png, .jpg) of lines, residuals, horizon, floor grid, axes and doubts");
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
    command
        ->add_option(
            "--principal-sigma",
            arguments->options.principal_sigma,
            "How far the optical axis may miss the picture's middle, standard deviation as "
            "a share of the long side; 0: not at all; a crop needs more")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
    command->add_flag("--ignore-exif-focal",
                      arguments->ignore_exif_focal,
                      "Use the lines alone where they suffice; EXIF only checks");
    command->add_flag("--ignore-exif-gravity{false}",
                      arguments->options.use_exif_gravity,
                      "Don't use the accelerometer that telephones (Apple's) write into EXIF");
    addAutomaticOptions(*command, *arguments);
    addBallOptions(*command, *arguments);
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu calibrate room.jpg --lines lines.json -o camera.json\n"
        "  insitu calibrate room.jpg --auto --camera-height 1.5 --origin 2010 1702 -o camera.json\n"
        "  insitu calibrate room.jpg --from room.fspy -o camera.json --overlay check.png\n"
        "  insitu calibrate room.jpg --from camera.json -o camera2.json --locate-ball "
        "with_ball.jpg "
        "--ball-radius 0.06\n"
        "  insitu calibrate --views views.json -o cameras\n"
        "  insitu calibrate scan.tif --lines lines.json --focal-px 2150 -o camera.json");
    command->callback([arguments, &context] { runCalibrate(*arguments, context); });
}

}  // namespace insitu::cli
