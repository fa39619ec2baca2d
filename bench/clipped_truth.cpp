// How well the strength of a sun that is clipped in every exposure is recovered.
//
//   clipped_truth [--leave-out N] [--card] ROOM_FOLDER...
//
// A room is a folder with project.json, pano_linear.exr and truth.json, whose "sun" tells direction
// and irradiance. The N shortest exposures of the probe are left out (5 in truth-room-c clip the
// sun); 0 shows what the whole bracket gives. Irradiances are those of a surface that faces the
// sun, over a cone of 4 degrees around it, each channel in the unit of the truth (one scale, the
// median ratio of the panorama's texels). With --card also as solved by a grey card at the probe's
// place: what the panorama says a surface there gets, facing the sun, or up, with no error of its
// own.
#include "core/check.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "lighting/room_light.h"
#include "pipeline/insert.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>
#include <vector>

namespace {

using namespace insitu;
using std::numbers::pi;

constexpr double kCone = 4.0 * pi / 180.0;

struct Sun {
    glm::dvec3 direction{0.0};
    glm::dvec3 irradiance{0.0};
};

Sun readSun(const std::filesystem::path& folder)
{
    const Json json = readJson(folder / "truth.json");
    const JsonNode sun = JsonNode(json, (folder / "truth.json").string()).at("sun");
    return {glm::normalize(sun.at("direction_to_sun_in_world").vec3()),
            sun.at("irradiance_on_a_facing_surface_rgb").vec3()};
}

/// Of a surface at x that faces `towards`, from directions within the cone.
template <class Radiance>
glm::dvec3 coneIrradiance(glm::dvec3 towards, const Radiance& radiance)
{
    constexpr int kRings = 400;
    constexpr int kSectors = 400;
    const glm::dvec3 a = glm::normalize(glm::cross(towards, glm::dvec3(0.3, 1.0, 0.2)));
    const glm::dvec3 b = glm::cross(towards, a);
    glm::dvec3 sum(0.0);
    for (int ring = 0; ring < kRings; ++ring) {
        const double angle = kCone * (ring + 0.5) / kRings;
        const double weight =
            std::sin(angle) * std::cos(angle) * (kCone / kRings) * (2.0 * pi / kSectors);
        for (int sector = 0; sector < kSectors; ++sector) {
            const double around = 2.0 * pi * (sector + 0.5) / kSectors;
            const glm::dvec3 direction =
                std::cos(angle) * towards +
                std::sin(angle) * (std::cos(around) * a + std::sin(around) * b);
            sum += weight * glm::dvec3(radiance(direction));
        }
    }
    return sum;
}

/// Median over directions of truth / measured, per channel.
glm::dvec3 unitScale(const EnvironmentMap& measured, const EnvironmentMap& truth)
{
    glm::dvec3 scale(1.0);
    for (int c = 0; c < 3; ++c) {
        std::vector<double> ratios;
        for (int y = 1; y < 64; ++y)
            for (int x = 0; x < 128; ++x) {
                const glm::dvec3 d = environmentDirectionFromUv({x / 128.0, y / 64.0});
                const double m = lookUp(measured, d)[c];
                if (m > 0.0) ratios.push_back(lookUp(truth, d)[c] / m);
            }
        std::ranges::nth_element(ratios, ratios.begin() + ratios.size() / 2);
        scale[c] = ratios[ratios.size() / 2];
    }
    return scale;
}

void judge(const std::filesystem::path& folder, int leave_out, bool with_card)
{
    const Sun sun = readSun(folder);
    Project project = readProject(folder / "project.json");
    auto& images = project.light.probe->views[0].images;
    std::ranges::sort(images, std::greater<>(), [](const ProjectImage& image) {
        return readPhoto(image.path).metadata.exposure.relative().value_or(0.0);
    });
    if (leave_out < 0 || leave_out >= static_cast<int>(images.size()))
        throw InputError("--leave-out", "leaves no exposure");
    images.resize(images.size() - static_cast<std::size_t>(leave_out));

    const InsertOptions options;
    Progress silent;
    const Photo photo = readPhoto(project.photo.path);
    const Camera camera = solveCamera(project, photo, true).camera;
    const SceneProxy proxy(project.room);
    const CapturedLight light = captureLight(project, proxy, camera, options);
    const RoomLight room(
        proxy, light.environment, light.center_m, std::nullopt, options.light, silent);
    for (const Finding& finding : room.findings())
        if (finding.code.starts_with("light-clipped")) fmt::print("  {}\n", finding.message);

    const EnvironmentMap truth{readRadiance(folder / "pano_linear.exr").pixels};
    const glm::dvec3 scale = unitScale(light.environment, truth);
    const auto probe = [&](glm::dvec3 d) { return lookUp(light.environment, d); };
    const auto fitted = [&](glm::dvec3 d) { return room.incident(light.center_m, d).radiance; };
    const auto panorama = [&](glm::dvec3 d) { return lookUp(truth, d); };
    const auto print = [&](const char* what, glm::dvec3 e) {
        fmt::print("  {:<24} {:8.3f} {:8.3f} {:8.3f}   error % {:+7.2f} {:+7.2f} {:+7.2f}\n",
                   what,
                   e.r,
                   e.g,
                   e.b,
                   100.0 * (e.r / sun.irradiance.r - 1.0),
                   100.0 * (e.g / sun.irradiance.g - 1.0),
                   100.0 * (e.b / sun.irradiance.b - 1.0));
    };
    print("sun, truth", sun.irradiance);
    print("panorama, truth", coneIrradiance(sun.direction, panorama));
    print("probe as merged", scale * coneIrradiance(sun.direction, probe));
    print("room light, fitted", scale * coneIrradiance(sun.direction, fitted));
    if (!with_card) return;
    for (const glm::dvec3& normal : {sun.direction, glm::dvec3(0.0, 1.0, 0.0)}) {
        RoomLightOptions by_card = options.light;
        by_card.references = {
            {.name = "the grey card",
             .places = {{light.center_m, normal, irradiance(truth, normal) / scale, 0.03}}}};
        const RoomLight solved(
            proxy, light.environment, light.center_m, std::nullopt, by_card, silent);
        for (const Finding& finding : solved.findings())
            if (finding.code.starts_with("light-clipped") ||
                finding.code.starts_with("light-reference"))
                fmt::print("  {}\n", finding.message);
        print(normal.y < 1.0 ? "card that faces the sun" : "card that faces up",
              scale * coneIrradiance(sun.direction, [&](glm::dvec3 d) {
                  return solved.incident(light.center_m, d).radiance;
              }));
    }
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app("Strength of a clipped sun against its truth");
    int leave_out = 5;
    bool with_card = false;
    std::vector<std::filesystem::path> rooms;
    app.add_option("--leave-out", leave_out, "Shortest exposures to leave out")
        ->capture_default_str();
    app.add_flag("--card", with_card, "Also by a grey card");
    app.add_option("rooms", rooms, "Folders of truth rooms")->required();
    CLI11_PARSE(app, argc, argv);
    try {
        for (const auto& room : rooms) {
            fmt::print("{}, {} shortest exposures left out\n", room.filename().string(), leave_out);
            judge(room, leave_out, with_card);
        }
    } catch (const std::exception& error) {
        std::cerr << error.what() << "\n";
        return 1;
    }
    return 0;
}
