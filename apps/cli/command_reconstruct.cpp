#include "apps/cli/command.h"
#include "calib/camera_errors.h"
#include "calib/camera_formats.h"
#include "calib/picture_drawing.h"
#include "core/io/image_io.h"
#include "pipeline/insert.h"
#include "pipeline/project.h"
#include "reconstruct/primitive_library.h"
#include "reconstruct/scene_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace insitu::cli {

namespace {

struct ReconstructArguments {
    std::filesystem::path scene;
    std::filesystem::path camera;
    std::filesystem::path project;
    std::filesystem::path output;
    std::filesystem::path photo;
    std::filesystem::path overlay;
    bool print_primitives = false;
};

/// The edges of a primitive, each once.
void drawEdges(EncodedImage& image,
               const Camera& camera,
               const std::vector<WorldFace>& faces,
               const Ink& ink)
{
    constexpr double kSame_m = 1e-9;
    std::vector<std::pair<glm::dvec3, glm::dvec3>> drawn;
    for (const WorldFace& face : faces)
        for (std::size_t i = 0; i < face.corners_m.size(); ++i) {
            const glm::dvec3 a = face.corners_m[i];
            const glm::dvec3 b = face.corners_m[(i + 1) % face.corners_m.size()];
            // The face on the other side names its corners in the other direction.
            if (std::any_of(drawn.begin(), drawn.end(), [&](const auto& edge) {
                    return glm::distance(edge.first, b) + glm::distance(edge.second, a) < kSame_m;
                }))
                continue;
            drawn.emplace_back(a, b);
            drawWorldLine(image, camera, a, b, ink);
        }
}

/// The room's edges over the photograph, and the marks that it was solved from.
EncodedImage drawOverlay(EncodedImage image,
                         const Camera& camera,
                         const SceneFile& scene,
                         const SceneEstimate& estimate)
{
    Ink ink;
    ink.width_px = std::max(1.5, image.codes.width() / 900.0);
    for (std::size_t i = 0; i < scene.graph.primitives.size(); ++i) {
        const ScenePrimitive& primitive = scene.graph.primitives[i];
        ink.color = primitive.solid ? glm::vec3(1.0f, 0.55f, 0.1f) : glm::vec3(0.1f, 0.75f, 1.0f);
        drawEdges(image, camera, solvedFaces(primitive, estimate.primitives[i]), ink);
    }
    ink.color = {1.0f, 0.1f, 0.6f};
    const double arm = 4.0 * ink.width_px;
    for (const VertexObservation& mark : scene.graph.vertices)
        for (const glm::dvec2 way : {glm::dvec2(arm, 0.0), glm::dvec2(0.0, arm)})
            drawLine(image, mark.pixel - way, mark.pixel + way, ink);
    for (const EdgeObservation& mark : scene.graph.edges)
        drawLine(image, mark.from_px, mark.to_px, ink);
    return image;
}

void runReconstruct(const ReconstructArguments& arguments, Context& context)
{
    context.start();
    if (arguments.print_primitives) {
        fmt::print("{}", builtinPrimitivesText());
        return;
    }
    context.checkOutput(arguments.output);
    if (!arguments.overlay.empty()) context.checkOutput(arguments.overlay);
    std::filesystem::path photo_file = arguments.photo;
    CameraEstimate calibrated;
    if (arguments.project.empty()) {
        calibrated = readCameraFile(arguments.camera);
    } else {
        const Project project = readProject(arguments.project);
        if (photo_file.empty()) photo_file = project.photo.path;
        calibrated = solveCamera(project, readPhotograph(project.photo.path), true);
        context.print(calibrated.findings);
    }
    const Camera& camera = calibrated.camera;
    const SceneFile scene = readScene(arguments.scene);
    SceneSolver solver(scene.graph, camera);
    (void)solver.solve();
    const SceneEstimate estimate = solver.estimate(errorCameras(calibrated));
    context.print(estimate.findings);
    if (!arguments.overlay.empty()) {
        const Photo photo = readPhotograph(photo_file);
        if (photo.image.codes.width() != camera.width ||
            photo.image.codes.height() != camera.height)
            throw InputError(
                photo_file.string(),
                fmt::format("is not of the camera's size, {}x{}", camera.width, camera.height));
        writeEncoded(arguments.overlay, drawOverlay(photo.image, camera, scene, estimate));
    }
    writeReconstruction(arguments.output, scene, estimate);
}

}  // namespace

void registerReconstruct(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<ReconstructArguments>();
    CLI::App* command = app.add_subcommand(
        "reconstruct", "Solve a room of primitives from marks in the photograph");
    CLI::Option* print = command->add_flag(
        "--print-primitives", arguments->print_primitives, "Print the built-in shapes and stop");
    auto* scene = command->add_option(
        "scene", arguments->scene, "Primitives, what holds between them, marks (.json)");
    auto* camera =
        command->add_option("--camera",
                            arguments->camera,
                            "Solved camera (.json, or another format that calibrate --from reads)");
    auto* project = command->add_option(
        "--project", arguments->project, "Project (.json) whose photograph and camera these are");
    project->excludes(camera);
    auto* output = command->add_option("-o,--output", arguments->output, "Room to write (.json)");
    auto* photo = command->add_option(
        "--photo", arguments->photo, "Photograph for --overlay [the project's]");
    auto* overlay = command->add_option(
        "--overlay", arguments->overlay, "Photograph with the room's edges (.png)");
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu reconstruct scene.json --camera camera.json -o room.json\n"
        "  insitu reconstruct scene.json --camera camera.json -o room.json --photo plate.jpg "
        "--overlay edges.png\n"
        "  insitu reconstruct scene.json --project project.json -o room.json --overlay edges.png");
    command->callback([arguments, &context, print, scene, camera, project, output, photo, overlay] {
        if (print->count() == 0)
            for (const CLI::Option* needed : {scene, output})
                if (needed->count() == 0) throw CLI::RequiredError(needed->get_name());
        if (print->count() == 0 && camera->count() + project->count() == 0)
            throw CLI::RequiredError("--camera or --project");
        if (overlay->count() > 0 && photo->count() + project->count() == 0)
            throw CLI::RequiredError("--photo");
        runReconstruct(*arguments, context);
    });
}

}  // namespace insitu::cli
