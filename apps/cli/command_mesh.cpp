#include "apps/cli/command.h"
#include "pipeline/radiance_mesh_stage.h"

namespace insitu::cli {

namespace {

struct MeshArguments {
    std::filesystem::path project;
    std::filesystem::path output;
    InsertOptions options;
    RadianceMeshOptions mesh;
};

void runMesh(MeshArguments& arguments, Context& context)
{
    context.start();
    context.checkOutput(arguments.output);
    arguments.options.light.seed = context.options.seed;
    const Project project = readProject(arguments.project);
    const ProjectRadianceMesh made =
        projectRadianceMesh(project, arguments.options, arguments.mesh, context.progress());
    context.print(made.findings);
    writeRadianceMesh(arguments.output, made.mesh);
}

}  // namespace

void registerMesh(CLI::App& app, Context& context)
{
    auto arguments = std::make_shared<MeshArguments>();
    CLI::App* command =
        app.add_subcommand("mesh", "Write a project's light as a mesh of shining triangles");
    command->add_option("project", arguments->project, "Project file (.json)")->required();
    command->add_option("-o,--output", arguments->output, "Mesh to write (.ply, .json)")
        ->required();
    command->add_option("--patch-m", arguments->mesh.patch_m, "Size of a patch in metres")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    context.addCommonOptions(*command);
    command->footer(
        "Examples:\n"
        "  insitu mesh project.json -o light.ply\n"
        "  insitu mesh project.json --patch-m 0.1 -o light.json");
    command->callback([arguments, &context] { runMesh(*arguments, context); });
}

}  // namespace insitu::cli
