#include "pipeline/project.h"

#include "pipeline/project_json.h"
#include "pipeline/project_keys.h"
#include "reconstruct/room_bounds.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <span>

namespace insitu {

namespace {

constexpr std::string_view kFormat = "insitu-project";
constexpr int kVersion = 1;

std::vector<ProjectForeground> readForeground(const JsonNode& list,
                                              const std::filesystem::path& folder)
{
    std::vector<ProjectForeground> marks;
    for (std::size_t i = 0; i < list.size(); ++i) {
        const JsonNode node = list.at(i);
        node.expectKeys(keys::kForeground);
        ProjectForeground read;
        if (node.has("polygon_px") == node.has("mask"))
            node.fail("give either polygon_px, an outline, or mask, a picture");
        if (const auto polygon = node.find("polygon_px")) {
            if (polygon->size() < 3) polygon->fail("needs at least three corners");
            for (std::size_t k = 0; k < polygon->size(); ++k)
                read.mark.polygon_px.push_back(polygon->at(k).vec2());
        } else {
            read.mask = existingFile(node.at("mask"), folder);
        }
        if (const auto value = node.find("distance_m")) read.mark.distance_m = value->positive();
        if (const auto value = node.find("feather_px")) read.mark.feather_px = value->number();
        if (const auto value = node.find("refine_px")) read.mark.refine_px = value->integer();
        for (const Finding& problem : read.mark.validate())
            node.fail(problem.message);
        marks.push_back(std::move(read));
    }
    return marks;
}

ProjectWhiteBalance readWhiteBalance(const JsonNode& node)
{
    using Mode = ProjectWhiteBalance::Mode;
    if (!node.value().is_array()) {
        if (!node.value().is_string())
            node.fail(
                "must be \"auto\", \"none\", \"solved\" or three numbers, the photograph's "
                "light over the probe's in red, green and blue");
        const std::string mode = readChoice(node, {"auto", "none", "solved"});
        return {mode == "auto"   ? Mode::Auto
                : mode == "none" ? Mode::None
                                 : Mode::Solved,
                {1, 1, 1}};
    }
    const glm::dvec3 gains = node.vec3();
    for (int c = 0; c < 3; ++c)
        if (!(gains[c] > 1e-3 && gains[c] < 1e3)) node.fail("must be between 0.001 and 1000");
    return {Mode::Given, gains};
}

ProjectLight readLight(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kLight);
    ProjectLight light;
    const auto probe = node.find("probe");
    const auto environment = node.find("environment");
    if (probe && environment) node.fail("has both probe and environment; keep one");
    if (probe) {
        if (const auto center = node.find("center_m"))
            center->fail("belongs inside probe when there is one");
        light.probe = readProbe(*probe, folder);
        light.center_m = light.probe->center_m;
    } else if (environment) {
        light.environment = existingFile(*environment, folder);
        light.center_m = node.at("center_m").vec3();
    } else {
        node.fail("has neither probe nor environment; give one");
    }
    return light;
}

void readCamera(const JsonNode& node, const std::filesystem::path& folder, Project& project)
{
    node.expectKeys(keys::kCamera);
    if (node.has("lines") && node.has("file")) node.fail("has both lines and file; keep one");
    if (const auto lines = node.find("lines")) {
        project.camera_lines = existingFile(*lines, folder);
    } else if (const auto file = node.find("file")) {
        project.camera_file = existingFile(*file, folder);
    } else {
        node.fail("has neither lines nor file: give the marked lines or a solved camera.json");
    }
}

/// An object must stand in the room, when there is one: a misplaced decimal point should not cost a
/// render.
void checkInsideRoom(const JsonNode& objects, const Project& project)
{
    constexpr double kSlackM = 1e-3;
    for (std::size_t i = 0; i < project.objects.size(); ++i) {
        const glm::dvec3 p = project.objects[i].position_m;
        const auto out = reachOutside(project.room, std::span(&p, 1));
        if (out && *out > kSlackM)
            objects.at(i).fail(
                fmt::format("position_m [{}, {}, {}] lies {:.3g} m or more outside the room",
                            p.x,
                            p.y,
                            p.z,
                            *out));
    }
}

}  // namespace

Project readProject(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    root.expectKeys(keys::kProject);
    (void)readChoice(root.at("format"), {kFormat});
    const JsonNode version = root.at("version");
    if (version.integer() != kVersion)
        version.fail(
            fmt::format("is {}; this program reads version {}", version.integer(), kVersion));

    Project project;
    project.file = std::filesystem::absolute(path).lexically_normal();
    const std::filesystem::path folder = project.file.parent_path();
    const JsonNode photo = root.at("photo");
    photo.expectKeys(keys::kPhoto);
    project.photo = {existingFile(photo.at("image"), folder), readExposure(photo)};
    if (const auto balance = photo.find("white_balance"))
        project.white_balance = readWhiteBalance(*balance);
    if (const auto vignetting = photo.find("vignetting")) {
        if (vignetting->value().is_string()) {
            if (vignetting->text() != "auto") vignetting->fail("is neither a number nor \"auto\"");
            project.estimate_vignetting = true;
        } else {
            project.photo_vignetting = vignetting->number();
            if (!(*project.photo_vignetting >= 0.0 && *project.photo_vignetting <= 3.0))
                vignetting->fail("must be in [0, 3]");
        }
    }
    if (const auto focus = photo.find("focus_m")) project.photo_focus_m = focus->positive();
    if (const auto foreground = photo.find("foreground"))
        project.foreground = readForeground(*foreground, folder);
    readCamera(root.at("camera"), folder, project);
    project.light = readLight(root.at("light"), folder);
    const JsonNode objects = root.at("objects");
    for (std::size_t i = 0; i < objects.size(); ++i)
        project.objects.push_back(readObject(objects.at(i), folder));
    if (project.objects.empty()) objects.fail("is empty; name at least one model to insert");
    project.room = readRoomOrFile(root.at("room"), folder);
    checkInsideRoom(objects, project);
    return project;
}

}  // namespace insitu
