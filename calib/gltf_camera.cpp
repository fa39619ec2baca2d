#include "calib/foreign_cameras.h"
#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

// glTF 2.0, section 3.10: a perspective camera looks along −z with +y up and knows its vertical
// field of view and aspect only; it stands where its node does. Blender's camera data: focal length
// and sensor in millimetres, shift in shares of the sensor's width, world Z up.

namespace insitu::foreign {

namespace {

constexpr std::size_t kMostNodes = 100'000;
constexpr double kSensorMm = 36.0;
/// Principal points nearer to the middle than this are there.
constexpr double kCenteredPx = 1e-6;

glm::dmat4 localMatrix(const JsonNode& node)
{
    if (const auto matrix = node.find("matrix")) {
        if (matrix->size() != 16) matrix->fail("must be 16 numbers");
        glm::dmat4 m(1.0);
        for (std::size_t i = 0; i < 16; ++i)
            m[static_cast<int>(i / 4)][static_cast<int>(i % 4)] = matrix->at(i).number();
        return m;
    }
    glm::dmat4 m(1.0);
    if (const auto rotation = node.find("rotation")) {
        if (rotation->size() != 4) rotation->fail("must be four numbers");
        const glm::dquat q(rotation->at(3).number(),
                           rotation->at(std::size_t{0}).number(),
                           rotation->at(1).number(),
                           rotation->at(2).number());
        if (!(std::abs(glm::length(q) - 1.0) < 1e-3)) rotation->fail("is not of unit length");
        m = glm::mat4_cast(glm::normalize(q));
    }
    if (const auto scale = node.find("scale")) {
        const glm::dvec3 s = scale->vec3();
        for (int c = 0; c < 3; ++c)
            m[c] *= s[c];
    }
    if (const auto translation = node.find("translation"))
        m[3] = glm::dvec4(translation->vec3(), 1.0);
    return m;
}

/// Parent of every node, −1 for roots.
std::vector<int> parentsOf(const JsonNode& nodes)
{
    std::vector<int> parents(nodes.size(), -1);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const auto children = nodes.at(i).find("children");
        if (!children) continue;
        for (std::size_t k = 0; k < children->size(); ++k) {
            const int child = children->at(k).integer();
            if (child < 0 || static_cast<std::size_t>(child) >= parents.size())
                children->at(k).fail("names no node");
            parents[static_cast<std::size_t>(child)] = static_cast<int>(i);
        }
    }
    return parents;
}

glm::dmat4 worldMatrix(const JsonNode& nodes, const std::vector<int>& parents, std::size_t index)
{
    glm::dmat4 m(1.0);
    int at = static_cast<int>(index);
    for (std::size_t steps = 0; at >= 0; ++steps) {
        if (steps > parents.size()) nodes.fail("a node is its own ancestor");
        m = localMatrix(nodes.at(static_cast<std::size_t>(at))) * m;
        at = parents[static_cast<std::size_t>(at)];
    }
    return m;
}

/// The axes without the scale that ancestors may have; a camera ignores it.
GlPose poseOf(const glm::dmat4& m)
{
    GlPose pose{glm::dmat3(m), glm::dvec3(m[3])};
    for (int c = 0; c < 3; ++c)
        pose.axes[c] = glm::normalize(pose.axes[c]);
    return pose;
}

void setLens(const JsonNode& perspective,
             const std::optional<JsonNode>& extras,
             const CameraReading& reading,
             Camera& camera)
{
    const double fov = perspective.at("yfov").positive();
    if (!(fov < 3.1)) perspective.at("yfov").fail("must be below π");
    glm::ivec2 size(0);
    if (extras && extras->has("width") && extras->has("height"))
        size = sizeOf(extras->at("width"), extras->at("height"));
    else if (reading.size_px)
        size = *reading.size_px;
    else
        perspective.fail(
            "a glTF camera does not say how large the picture is; give the photograph");
    camera.width = size.x;
    camera.height = size.y;
    camera.focal_px = glm::dvec2(0.5 * size.y / std::tan(0.5 * fov));
    camera.principal_px = 0.5 * glm::dvec2(size);
    const auto aspect = perspective.find("aspectRatio");
    if (aspect && std::abs(aspect->positive() * size.y / size.x - 1.0) > 0.01)
        aspect->fail(fmt::format("is not that of a {}x{} picture", size.x, size.y));
    if (!extras) return;
    if (const auto principal = extras->find("principal_point_px"))
        camera.principal_px = principal->vec2();
    if (const auto focal = extras->find("focal_px")) {
        camera.focal_px = focal->vec2();
        if (!(camera.focal_px.x > 0.0 && camera.focal_px.y > 0.0))
            focal->fail("focal lengths must be positive");
    }
}

std::optional<JsonNode> ownExtras(const JsonNode& camera)
{
    const auto extras = camera.find("extras");
    if (!extras || !extras->value().is_object()) return std::nullopt;
    return extras->find("insitu");
}

}  // namespace

CameraEstimate readGltfCamera(const std::filesystem::path& path, const CameraReading& reading)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    if (!json.is_object()) root.fail("must be an object");
    const JsonNode cameras = root.at("cameras");
    const JsonNode nodes = root.at("nodes");
    if (nodes.size() > kMostNodes) nodes.fail(fmt::format("more than {} nodes", kMostNodes));
    const std::vector<int> parents = parentsOf(nodes);
    CameraEstimate estimate;
    std::size_t found = 0;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        const auto index = nodes.at(i).find("camera");
        if (!index) continue;
        const int number = index->integer();
        if (number < 0 || static_cast<std::size_t>(number) >= cameras.size())
            index->fail("names no camera");
        if (++found > 1) continue;
        const JsonNode camera = cameras.at(static_cast<std::size_t>(number));
        if (!camera.has("perspective")) camera.fail("is no perspective camera");
        setLens(camera.at("perspective"), ownExtras(camera), reading, estimate.camera);
        setPose(poseOf(worldMatrix(nodes, parents, i)), nodes.at(i), estimate.camera);
    }
    if (found == 0) nodes.fail("no node holds a camera");
    estimate.findings.push_back({Severity::Info, "camera-imported", "from glTF"});
    if (found > 1)
        estimate.findings.push_back(
            {Severity::Warning,
             "camera-several",
             fmt::format("{} nodes hold cameras; that of the first is taken", found)});
    return estimate;
}

Findings writeGltfCamera(const std::filesystem::path& path, const Camera& camera)
{
    const GlPose pose = glPose(camera);
    const glm::dquat q = glm::normalize(glm::quat_cast(pose.axes));
    const double fov = 2.0 * std::atan(0.5 * camera.height / camera.focal_px.y);
    Json json;
    json["asset"] = {{"version", "2.0"}, {"generator", "insitu"}};
    json["scene"] = 0;
    json["scenes"] = {{{"nodes", {0}}}};
    json["nodes"] = {{{"name", "photograph"},
                      {"camera", 0},
                      {"rotation", {q.x, q.y, q.z, q.w}},
                      {"translation", {pose.position.x, pose.position.y, pose.position.z}}}};
    json["cameras"] = {
        {{"name", "photograph"},
         {"type", "perspective"},
         {"perspective",
          {{"yfov", fov},
           {"aspectRatio", camera.width / camera.focal_px.x / (camera.height / camera.focal_px.y)},
           {"znear", 0.01}}},
         {"extras",
          {{"insitu",
            {{"width", camera.width},
             {"height", camera.height},
             {"focal_px", {camera.focal_px.x, camera.focal_px.y}},
             {"principal_point_px", {camera.principal_px.x, camera.principal_px.y}}}}}}}};
    writeJson(path, json);
    const glm::dvec2 off = camera.principal_px - 0.5 * glm::dvec2(camera.width, camera.height);
    if (glm::length(off) < kCenteredPx) return {};
    return {{Severity::Warning,
             "camera-principal-point-lost",
             fmt::format("glTF has no principal point: other programs will see the picture shifted "
                         "by ({:.1f}, {:.1f}) px",
                         off.x,
                         off.y)}};
}

CameraEstimate blenderCamera(const JsonNode& root)
{
    root.expectKeys({"format",
                     "version",
                     "resolution_x",
                     "resolution_y",
                     "pixel_aspect_x",
                     "pixel_aspect_y",
                     "sensor_fit",
                     "sensor_width",
                     "lens",
                     "shift_x",
                     "shift_y",
                     "matrix_world",
                     "note"});
    CameraEstimate estimate;
    Camera& camera = estimate.camera;
    const glm::ivec2 size = sizeOf(root.at("resolution_x"), root.at("resolution_y"));
    camera.width = size.x;
    camera.height = size.y;
    if (const auto fit = root.find("sensor_fit"); fit && fit->text() != "HORIZONTAL")
        fit->fail("must be \"HORIZONTAL\": lens and shift then refer to the picture's width");
    const double sensor = root.has("sensor_width") ? root.at("sensor_width").positive() : kSensorMm;
    const auto number = [&](const char* key, double usual) {
        const auto node = root.find(key);
        return node ? node->number() : usual;
    };
    const double aspect_x = root.has("pixel_aspect_x") ? root.at("pixel_aspect_x").positive() : 1.0;
    const double aspect_y = root.has("pixel_aspect_y") ? root.at("pixel_aspect_y").positive() : 1.0;
    camera.focal_px.x = root.at("lens").positive() / sensor * size.x;
    camera.focal_px.y = camera.focal_px.x * aspect_x / aspect_y;
    camera.principal_px.x = 0.5 * size.x - number("shift_x", 0.0) * size.x;
    // A shift is in shares of the width, in the width's own pixels.
    camera.principal_px.y = 0.5 * size.y + number("shift_y", 0.0) * size.x * aspect_x / aspect_y;
    setPose(yUpFromZUp(poseOfRows(root.at("matrix_world"))), root.at("matrix_world"), camera);
    estimate.findings.push_back(
        {Severity::Info, "camera-imported", "from Blender, whose (x, y, z) is our (x, z, −y)"});
    return estimate;
}

Json blenderCamera(const Camera& camera)
{
    const double ratio = camera.focal_px.x / camera.focal_px.y;
    const double w = camera.width;
    Json json;
    json["format"] = "insitu-blender-camera";
    json["version"] = 1;
    json["resolution_x"] = camera.width;
    json["resolution_y"] = camera.height;
    // Blender wants both to be at least 1.
    json["pixel_aspect_x"] = std::max(1.0, 1.0 / ratio);
    json["pixel_aspect_y"] = std::max(1.0, ratio);
    json["sensor_fit"] = "HORIZONTAL";
    json["sensor_width"] = kSensorMm;
    json["lens"] = camera.focal_px.x / w * kSensorMm;
    json["shift_x"] = 0.5 - camera.principal_px.x / w;
    json["shift_y"] = (camera.principal_px.y - 0.5 * camera.height) * ratio / w;
    json["matrix_world"] = rowsOf(zUpFromYUp(glPose(camera)));
    return json;
}

}  // namespace insitu::foreign
