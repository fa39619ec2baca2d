#include "pipeline/project.h"

#include "pipeline/project_json.h"
#include "pipeline/project_keys.h"

#include <glm/glm.hpp>

#include <algorithm>

namespace insitu {

namespace {

constexpr std::string_view kFormat = "insitu-project";
constexpr int kVersion = 1;

Exposure readExposure(const JsonNode& node)
{
    Exposure exposure;
    if (const auto value = node.find("exposure_seconds")) exposure.seconds = value->positive();
    if (const auto value = node.find("f_number")) exposure.f_number = value->positive();
    if (const auto value = node.find("iso")) exposure.iso = value->positive();
    return exposure;
}

ProjectImage readImage(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kImage);
    return {existingFile(node.at("image"), folder), readExposure(node)};
}

/// `images` with the exposure members beside it: one time for all or a list, one an image.
std::vector<ProjectImage> readImages(const JsonNode& probe, const std::filesystem::path& folder)
{
    const JsonNode list = probe.at("images");
    if (list.size() == 0) list.fail("is empty; name the pictures of the bracket");

    Exposure common;
    if (const auto value = probe.find("f_number")) common.f_number = value->positive();
    if (const auto value = probe.find("iso")) common.iso = value->positive();
    const auto times = probe.find("exposure_seconds");
    const bool one_each = times && times->value().is_array();
    if (one_each && times->size() != list.size())
        times->fail(fmt::format("has {} times for {} images", times->size(), list.size()));

    std::vector<ProjectImage> images;
    for (std::size_t i = 0; i < list.size(); ++i) {
        const JsonNode item = list.at(i);
        ProjectImage image;
        if (item.value().is_object()) {
            image = readImage(item, folder);
        } else {
            image.path = existingFile(item, folder);
        }
        Exposure& own = image.exposure;
        if (times && !own.seconds)
            own.seconds = one_each ? times->at(i).positive() : times->positive();
        if (!own.f_number) own.f_number = common.f_number;
        if (!own.iso) own.iso = common.iso;
        images.push_back(std::move(image));
    }
    return images;
}

void readBall(const JsonNode& node, ProjectProbe& probe)
{
    node.expectKeys(keys::kBall);
    probe.ball.center_px = node.at("center_px").vec2();
    probe.ball.radius_px = node.at("radius_px").positive();
    probe.ball.radius_m = node.at("radius_m").positive();
    if (const auto value = node.find("reflectance")) {
        probe.ball.reflectance = value->positive();
        (void)readFraction(*value);
    }
    if (const auto value = node.find("crop_origin_px")) probe.crop_origin_px = value->vec2();
}

void readView(const JsonNode& node, ProjectProbe& probe)
{
    if (node.value().is_string()) {
        (void)readChoice(node, {"photo"});
        return;
    }
    if (!node.value().is_object()) node.fail("must be \"photo\" or {\"position_m\": [x, y, z]}");
    node.expectKeys(keys::kView);
    const JsonNode position = node.at("position_m");
    probe.view_position_m = position.vec3();
    const glm::dvec3 to_ball = probe.center_m - *probe.view_position_m;
    const double distance = glm::length(to_ball);
    if (distance <= probe.ball.radius_m)
        position.fail(
            fmt::format("lies {} m from the ball's centre, inside the ball of radius {} m",
                        distance,
                        probe.ball.radius_m));
    // The ball camera keeps world Y up (capture/light_probe.h), so it cannot look along Y.
    if (std::abs(to_ball.y) > 0.9999 * distance)
        position.fail("the ball's camera would look straight up or down, where Y up is undefined");
}

ProjectProbe readProbe(const JsonNode& node, const std::filesystem::path& folder)
{
    node.expectKeys(keys::kProbe);
    ProjectProbe probe;
    const bool ball = readChoice(node.at("kind"), {"mirror-ball", "latlong"}) == "mirror-ball";
    probe.kind = ball ? ProbeKind::MirrorBall : ProbeKind::LatLong;
    const JsonNode center = node.at("center_m");
    if (center.value().is_string()) {
        (void)readChoice(center, {"from-outline"});
        probe.center_from_outline = true;
        if (!ball || !node.at("view").value().is_string())
            center.fail("\"from-outline\" needs a mirror ball with \"view\": \"photo\"");
    } else {
        probe.center_m = center.vec3();
    }
    if (ball) {
        readBall(node.at("ball"), probe);
        probe.ball.center_m = probe.center_m;
        readView(node.at("view"), probe);
    } else {
        for (const char* key : {"ball", "view"})
            if (node.has(key)) node.at(key).fail("belongs to a mirror ball, not to \"latlong\"");
    }
    probe.images = readImages(node, folder);
    if (const auto response = node.find("response"))
        probe.response = existingFile(*response, folder);
    return probe;
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

/// An object must stand in one of the room's boxes, when there are any: a misplaced decimal point
/// should not cost a render.
void checkInsideRoom(const JsonNode& objects, const Project& project)
{
    constexpr double kSlackM = 1e-3;
    const auto room_count = std::count_if(project.room.boxes.begin(),
                                          project.room.boxes.end(),
                                          [](const RoomBox& box) { return !box.solid; });
    if (room_count == 0) return;
    for (std::size_t i = 0; i < project.objects.size(); ++i) {
        const glm::dvec3 p = project.objects[i].position_m;
        const auto holds = [&](const RoomBox& box) {
            return !box.solid && glm::all(glm::greaterThanEqual(p, box.min_m - kSlackM)) &&
                   glm::all(glm::lessThanEqual(p, box.max_m + kSlackM));
        };
        if (std::none_of(project.room.boxes.begin(), project.room.boxes.end(), holds))
            objects.at(i).fail(
                fmt::format("position_m [{}, {}, {}] lies outside the room's box", p.x, p.y, p.z));
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
    project.photo = readImage(root.at("photo"), folder);
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
