// radiance_mesh_truth ROOM_FOLDER…: the energy that the radiance mesh sends back to the probe's
// place, beside what the probe measured there: six normals, worst channel.

#include "core/io/image_io.h"
#include "lighting/radiance_mesh.h"
#include "pipeline/insert.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace insitu {
namespace {

void measure(const std::filesystem::path& folder)
{
    const Project project = readProject(folder / "project.json");
    const Photo photo = readPhoto(project.photo.path);
    const Camera camera = solveCamera(project, photo, true).camera;
    const SceneProxy proxy(project.room);
    InsertOptions options;
    const CapturedLight light = captureLight(project, proxy, camera, options);
    Progress silent;
    options.light.reference_point_m = light.center_m;
    const RoomLight room(
        proxy, light.environment, light.center_m, std::nullopt, options.light, silent);
    for (const double patch_m : {0.4, 0.2, 0.1}) {
        RadianceMeshOptions mesh_options;
        mesh_options.patch_m = patch_m;
        const auto start = std::chrono::steady_clock::now();
        const RadianceMesh mesh =
            makeRadianceMesh(room, light.environment, light.center_m, std::nullopt, mesh_options);
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        fmt::print("{} {:.1f} m: {} patches in {:.2f} s; irradiance off by",
                   folder.filename().string(),
                   patch_m,
                   mesh.patches.size(),
                   seconds);
        for (int axis = 0; axis < 3; ++axis)
            for (const double sign : {1.0, -1.0}) {
                glm::dvec3 normal(0.0);
                normal[axis] = sign;
                const glm::dvec3 wanted = irradiance(light.environment, normal);
                const glm::dvec3 found = irradianceFromMesh(mesh, room, light.center_m, normal);
                double worst = 0.0;
                for (int c = 0; c < 3; ++c)
                    if (std::abs(found[c] / wanted[c] - 1.0) > std::abs(worst))
                        worst = found[c] / wanted[c] - 1.0;
                fmt::print(" {}{} {:+.2f} %", sign > 0 ? "+" : "-", "xyz"[axis], 100.0 * worst);
            }
        fmt::print("\n");
    }
}

}  // namespace
}  // namespace insitu

int main(int count, char** arguments)
{
    try {
        for (int i = 1; i < count; ++i)
            insitu::measure(arguments[i]);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
