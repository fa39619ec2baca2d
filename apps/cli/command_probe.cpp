#include "apps/cli/bracket_input.h"
#include "apps/cli/command.h"
#include "apps/cli/reference_input.h"
#include "capture/clipped_source.h"
#include "capture/light_probe.h"
#include "capture/probe_views.h"
#include "core/io/image_io.h"
#include "pipeline/insert.h"
#include "pipeline/probe_outline.h"
#include "pipeline/reference_capture.h"

#include <algorithm>
#include <array>
#include <optional>

namespace insitu::cli {

namespace {

struct ProbeArguments {
    BracketArguments bracket;
    ReferenceArguments references;
    std::filesystem::path output;
    std::string kind = "mirror-ball";
    std::optional<std::array<double, 2>> center_px;
    std::optional<double> radius_px;
    double radius_m = 0.05;
    double reflectance = 1.0;
    std::array<double, 3> position_m = {0.0, 0.0, 0.0};
    std::optional<std::array<double, 3>> view_position_m;
    std::array<double, 3> up = {0.0, 1.0, 0.0};
    std::filesystem::path mask;
    int width = 0;
};

glm::dvec3 toVec3(const std::array<double, 3>& v)
{
    return {v[0], v[1], v[2]};
}

/// The pictures' light, and the part of it that is only a lower bound (empty: none is known).
struct ProbePicture {
    Image<Rgb> radiance;
    Image<Rgb> clipped;
};

/// One radiance file, or a bracket to be merged.
ProbePicture readProbePicture(const ProbeArguments& arguments, Context& context)
{
    const auto& images = arguments.bracket.images;
    if (images.size() == 1 && isRadianceFile(images.front()))
        return {readRadiance(images.front()).pixels, {}};
    // Cut-outs may differ in size where nobody says where in them the ball is.
    const bool may_differ =
        arguments.kind == "mirror-ball" && !arguments.center_px && !arguments.radius_px;
    const CapturedRadiance captured = mergeArguments(
        arguments.bracket, context, may_differ ? FrameSizes::HandCut : FrameSizes::Equal);
    return {captured.merged.radiance.pixels, clippedPart(captured.merged)};
}

/// Cards, balls and numbers against the environment; scales what is clipped.
Findings applyGiven(const ProbeArguments& arguments,
                    const ProbePicture& picture,
                    const Camera* camera,
                    EnvironmentMap& environment)
{
    const std::vector<ProjectReference> references = referencesOf(arguments.references);
    const glm::dvec3 center(0.0);  // all light is taken to be far
    Findings findings;
    std::vector<ReferenceGroup> groups;
    for (const ProjectReference& reference : references) {
        if (reference.kind == ReferenceKind::Ball && camera == nullptr)
            throw InputError("--grey-ball", "needs a mirror ball beside it, whose camera is known");
        if (reference.kind == ReferenceKind::Card || reference.kind == ReferenceKind::Ball)
            groups.push_back(measureReference(reference,
                                              {picture.radiance,
                                               picture.clipped,
                                               glm::dvec2(0.0),
                                               camera,
                                               arguments.bracket.images.front().string()},
                                              center,
                                              findings));
    }
    for (ReferenceGroup& group : givenReferences(references, center))
        groups.push_back(std::move(group));
    append(findings, applyReferences(groups, environment));
    return findings;
}

/// The outline given, or else found in the picture, or else that of a ball that fills it.
void placeOutline(const Image<Rgb>& radiance,
                  const ProbeArguments& arguments,
                  MirrorBall& ball,
                  Findings& findings)
{
    ball.center_px = 0.5 * glm::dvec2(radiance.width(), radiance.height());
    ball.radius_px = 0.5 * std::min(radiance.width(), radiance.height());
    const bool given = arguments.center_px && arguments.radius_px;
    if (!given && !findProbeOutline(radiance, {}, ball, findings))
        findings.push_back({Severity::Warning,
                            "probe-outline-assumed",
                            "the ball's outline was not found and is taken to fill the picture: " +
                                outlineText(ball) + "; give --center and --radius"});
    if (arguments.center_px)
        ball.center_px = {(*arguments.center_px)[0], (*arguments.center_px)[1]};
    if (arguments.radius_px) ball.radius_px = *arguments.radius_px;
}

/// What was not given is found in the picture, or taken from the usual shot: seen from +z.
LightProbe unwrapBall(const ProbePicture& picture, const ProbeArguments& arguments)
{
    const Image<Rgb>& radiance = picture.radiance;
    MirrorBall ball;
    Findings assumed;
    placeOutline(radiance, arguments, ball, assumed);
    ball.radius_m = arguments.radius_m;
    ball.reflectance = arguments.reflectance;
    ball.center_m = toVec3(arguments.position_m);
    glm::dvec3 view = ball.center_m + glm::dvec3(0.0, 0.0, 20.0 * ball.radius_m);
    if (arguments.view_position_m)
        view = toVec3(*arguments.view_position_m);
    else
        assumed.push_back({Severity::Info,
                           "probe-view-assumed",
                           fmt::format("the camera is taken to be {} m from the ball on its +z "
                                       "side; give --view-position",
                                       20.0 * ball.radius_m)});
    const Camera camera =
        ballCamera(ball, view, radiance.width(), radiance.height(), toVec3(arguments.up));
    LightProbe probe;
    if (arguments.mask.empty()) {
        UnwrapOptions options;
        options.width = arguments.width;
        if (!picture.clipped.empty()) options.clipped = &picture.clipped;
        probe = unwrapMirrorBall(radiance, ball, camera, options);
    } else {
        MergeViewsOptions options;
        options.width = arguments.width;
        ProbeMask mask = readProbeMask(arguments.mask, radiance.width(), radiance.height());
        probe = mergeProbeViews({{radiance, ball, camera, {}, std::move(mask), picture.clipped}},
                                options)
                    .probe;
    }
    append(probe.findings, applyGiven(arguments, picture, &camera, probe.environment));
    append(assumed, std::move(probe.findings));
    probe.findings = std::move(assumed);
    return probe;
}

LightProbe mapSphere(const ProbePicture& picture, const ProbeArguments& arguments)
{
    const auto map = [&](const Image<Rgb>& image) {
        return arguments.kind == "latlong"   ? probeFromLatLong(image, arguments.width)
               : arguments.kind == "angular" ? probeFromAngularMap(image, arguments.width)
                                             : probeFromCubeCross(image, arguments.width);
    };
    LightProbe probe = map(picture.radiance);
    if (!picture.clipped.empty())
        probe.environment.clipped = map(picture.clipped).environment.pixels;
    append(probe.findings, applyGiven(arguments, picture, nullptr, probe.environment));
    return probe;
}

void runProbe(const ProbeArguments& arguments, Context& context)
{
    context.start();
    context.checkOutput(arguments.output);
    if (!isRadianceFile(arguments.output))
        throw InputError(arguments.output.string(), "radiance is written as .exr, .hdr or .pfm");
    const auto& images = arguments.bracket.images;
    if (images.size() == 1 && images.front().extension() == ".json") {
        if (!referencesOf(arguments.references).empty())
            throw InputError(images.front().string(),
                             "holds its own \"references\": add the card, ball and readings there");
        CapturedLight light = captureProbe(
            readProbeFile(images.front()), nullptr, {}, arguments.bracket.capture, arguments.width);
        append(light.findings, applyReferences(light.references, light.environment));
        context.print(light.findings);
        writeRadiance(arguments.output, light.environment.pixels);
        return;
    }
    if (!arguments.mask.empty() && arguments.kind != "mirror-ball")
        throw InputError("--mask", "belongs to a mirror ball");
    (void)referencesOf(arguments.references);  // refused before the work
    const ProbePicture picture = readProbePicture(arguments, context);
    const LightProbe probe = arguments.kind == "mirror-ball" ? unwrapBall(picture, arguments)
                                                             : mapSphere(picture, arguments);
    context.print(probe.findings);
    writeRadiance(arguments.output, probe.environment.pixels);
}

void addBallOptions(CLI::App& command, ProbeArguments& arguments)
{
    command
        .add_option("--center",
                    arguments.center_px,
                    "Centre of the ball's outline, x,y in pixels (default: found)")
        ->delimiter(',');
    command
        .add_option("--radius",
                    arguments.radius_px,
                    "Radius of the ball's outline in pixels (default: found)")
        ->check(CLI::PositiveNumber);
    command.add_option("--radius-m", arguments.radius_m, "Radius of the ball in metres")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    command.add_option("--reflectance", arguments.reflectance, "Reflectance of the ball")
        ->check(CLI::Range(0.01, 1.0))
        ->capture_default_str();
    command
        .add_option(
            "--position", arguments.position_m, "Centre of the ball in the room, x,y,z in metres")
        ->delimiter(',')
        ->capture_default_str();
    command
        .add_option("--view-position",
                    arguments.view_position_m,
                    "Where the camera was, x,y,z in metres (default: on the +z side)")
        ->delimiter(',');
    command
        .add_option("--up",
                    arguments.up,
                    "Direction of the room that is upwards in the picture, x,y,z; of a camera that "
                    "was rolled, or looked straight down")
        ->delimiter(',')
        ->capture_default_str();
    command.add_option("--mask",
                       arguments.mask,
                       "Picture of the same size: what is not black in it (photographer, tripod) "
                       "is not used but painted in");
}

}  // namespace

void registerProbe(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<ProbeArguments>();
    CLI::App* command = app.add_subcommand(
        "probe", "Turn pictures of a light probe into an equirectangular environment");
    addBracketOptions(*command, arguments->bracket);
    command->add_option("-o,--output", arguments->output, "Environment to write (.exr, .hdr, .pfm)")
        ->required();
    command->add_option("--kind", arguments->kind, "mirror-ball, angular, latlong or cube-cross")
        ->check(CLI::IsMember({"mirror-ball", "angular", "latlong", "cube-cross"}))
        ->capture_default_str();
    addBallOptions(*command, *arguments);
    addReferenceOptions(*command, arguments->references);
    command->add_option("--width", arguments->width, "Width of the environment (0: automatic)")
        ->check(CLI::Range(0, 16384))
        ->capture_default_str();
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu probe ball.exr -o env.exr --center 300,300 --radius 260.8\n"
        "  insitu probe probe.json -o env.exr    (several views: docs/file_format.md, probe)\n"
        "  insitu probe ball_1.jpg ball_2.jpg ball_3.jpg -o env.exr --radius-m 0.06\n"
        "  insitu probe ball_*.jpg -o env.exr --card 40,30,60,60 --card-normal 0,0,1\n"
        "  insitu probe angular.hdr --kind angular -o env.exr --width 1024");
    command->callback([arguments, &context] { runProbe(*arguments, context); });
}

}  // namespace insitu::cli
