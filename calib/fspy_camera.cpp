#include "calib/foreign_cameras.h"
#include "core/check.h"
#include "core/io/byte_view.h"
#include "core/io/byte_writer.h"
#include "core/io/file.h"
#include "core/io/json_bytes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

// fSpy's files as its documentation and its own exports describe them: the project is "fspy", then
// version 1, the JSON's size and the picture's size as little-endian uint32, the JSON, the picture.
// Points are in its image plane: origin in the middle, y up, the long side from −1 to 1; so are the
// focal length and the principal point. Matrices map camera (−z forward, y up) to world and back.

namespace insitu::foreign {

namespace {

constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeader = 16;

/// Metres per unit of fSpy's reference distance; 0: it has no unit.
double metresPer(const JsonNode& unit)
{
    const std::string text = unit.text();
    if (text == "No unit") return 0.0;
    if (text == "Millimeters") return 1e-3;
    if (text == "Centimeters") return 1e-2;
    if (text == "Meters") return 1.0;
    if (text == "Kilometers") return 1e3;
    if (text == "Inches") return 0.0254;
    if (text == "Feet") return 0.3048;
    if (text == "Yards") return 0.9144;
    if (text == "Miles") return 1609.344;
    unit.fail(fmt::format("\"{}\" is no unit that fSpy has", text));
}

/// Our pixel of a point of the image plane, for a picture of this size.
glm::dvec2 pixelOf(glm::dvec2 plane, glm::ivec2 size)
{
    const double half = 0.5 * std::max(size.x, size.y);
    return {0.5 * size.x + half * plane.x, 0.5 * size.y - half * plane.y};
}

glm::dvec2 planeOf(glm::dvec2 pixel, glm::ivec2 size)
{
    const double half = 0.5 * std::max(size.x, size.y);
    return {(pixel.x - 0.5 * size.x) / half, (0.5 * size.y - pixel.y) / half};
}

/// Whether the world's z is its upright axis, as in fSpy unless the user chose otherwise: the one
/// of y and z that is nearer to upright in the picture.
bool zIsUp(const GlPose& pose)
{
    return std::abs(pose.axes[1].z) >= std::abs(pose.axes[1].y);
}

Json point(glm::dvec2 at)
{
    return {{"x", at.x}, {"y", at.y}};
}

/// Two lines in the picture, coordinates from 0 to 1 with y down, that run along a direction of the
/// camera's frame.
Json controlLines(const Camera& camera, glm::dvec3 direction)
{
    const glm::dvec2 size(camera.width, camera.height);
    Json lines = Json::array();
    for (const glm::dvec2 place : {glm::dvec2(0.35, 0.3), glm::dvec2(0.65, 0.7)}) {
        const glm::dvec2 from = place * size - camera.principal_px;
        const glm::dvec2 toward = glm::dvec2(direction) * camera.focal_px - from * direction.z;
        const glm::dvec2 to = from + glm::normalize(toward) * 0.25 * std::min(size.x, size.y);
        lines.push_back(
            {point((from + camera.principal_px) / size), point((to + camera.principal_px) / size)});
    }
    return {{"lineSegments", lines}};
}

/// The direction of an axis of our world in the camera's frame (x right, y down, z forward).
glm::dvec3 inCamera(const Camera& camera, glm::dvec3 axis)
{
    return {
        glm::dot(camera.right, axis), -glm::dot(camera.up, axis), glm::dot(camera.forward, axis)};
}

/// "xPositive" for an axis of fSpy's world that points away from the camera.
std::string axisToward(const char* axis, glm::dvec3 in_camera)
{
    return std::string(axis) + (in_camera.z >= 0.0 ? "Positive" : "Negative");
}

/// What fSpy needs beside the camera to open the project and find the same camera again.
Json projectState(const Camera& camera)
{
    // fSpy's x and y are our x and −z.
    const glm::dvec3 x = inCamera(camera, {1, 0, 0});
    const glm::dvec3 y = inCamera(camera, {0, 0, -1});
    const glm::dvec3 z = inCamera(camera, {0, 1, 0});
    const glm::dvec2 size(camera.width, camera.height);
    const auto seen = camera.project(glm::dvec3(0.0));
    const glm::dvec2 origin = seen ? *seen / size : glm::dvec2(0.5, 0.7);
    Json state;
    state["globalSettings"] = {{"calibrationMode", "TwoVanishingPoints"},
                               {"imageOpacity", 0.2},
                               {"overlay3DGuide", "None"}};
    state["calibrationSettingsBase"] = {{"referenceDistanceAxis", nullptr},
                                        {"referenceDistance", 1},
                                        {"referenceDistanceUnit", "Meters"},
                                        {"cameraData",
                                         {{"presetId", nullptr},
                                          {"presetData", nullptr},
                                          {"customSensorWidth", 36},
                                          {"customSensorHeight", 24}}},
                                        {"firstVanishingPointAxis", axisToward("x", x)},
                                        {"secondVanishingPointAxis", axisToward("y", y)}};
    state["calibrationSettings1VP"] = {{"principalPointMode", "Default"},
                                       {"absoluteFocalLength", 24}};
    state["calibrationSettings2VP"] = {{"principalPointMode", "Manual"},
                                       {"quadModeEnabled", false}};
    state["controlPointsStateBase"] = {{"principalPoint", point(camera.principal_px / size)},
                                       {"origin", point(origin)},
                                       {"referenceDistanceAnchor", point(origin)},
                                       {"referenceDistanceHandleOffsets", {0.1, 0.2}},
                                       {"firstVanishingPoint", controlLines(camera, x)}};
    state["controlPointsState1VP"] = {{"horizon", {point({0.2, 0.5}), point({0.8, 0.5})}}};
    state["controlPointsState2VP"] = {{"secondVanishingPoint", controlLines(camera, y)},
                                      {"thirdVanishingPoint", controlLines(camera, z)}};
    state["cameraParameters"] = fspyParameters(camera);
    return state;
}

void append32Little(Bytes& to, std::uint32_t value)
{
    for (int shift = 0; shift < 32; shift += 8)
        to.push_back(static_cast<std::uint8_t>((value >> shift) & 0xFF));
}

}  // namespace

CameraEstimate fspyParameters(const JsonNode& node)
{
    CameraEstimate estimate;
    Camera& camera = estimate.camera;
    const glm::ivec2 size = sizeOf(node.at("imageWidth"), node.at("imageHeight"));
    camera.width = size.x;
    camera.height = size.y;
    const JsonNode principal = node.at("principalPoint");
    camera.principal_px = pixelOf({principal.at("x").number(), principal.at("y").number()}, size);
    const double half = 0.5 * std::max(size.x, size.y);
    if (const auto relative = node.find("relativeFocalLength")) {
        camera.focal_px = glm::dvec2(half * relative->positive());
    } else {
        // Older exports: the angle between the rays to the middles of the left and right edges.
        const double angle = node.at("horizontalFieldOfView").positive();
        if (!(angle < 3.1)) node.at("horizontalFieldOfView").fail("must be below π");
        camera.focal_px = glm::dvec2(0.5 * size.x / std::tan(0.5 * angle));
    }
    const JsonNode transform = node.at("cameraTransform").at("rows");
    GlPose pose = poseOfRows(transform);
    const bool z_up = zIsUp(pose);
    if (z_up) pose = yUpFromZUp(pose);
    setPose(pose, transform, camera);
    estimate.findings.push_back({Severity::Info,
                                 "camera-imported",
                                 fmt::format("from fSpy, whose {} axis is taken for the upright "
                                             "one{}",
                                             z_up ? "z" : "y",
                                             z_up ? "; its (x, y, z) is our (x, z, −y)" : "")});
    return estimate;
}

Json fspyParameters(const Camera& camera)
{
    const glm::ivec2 size(camera.width, camera.height);
    const double half = 0.5 * std::max(size.x, size.y);
    const double focal = 0.5 * (camera.focal_px.x + camera.focal_px.y);
    const GlPose pose = zUpFromYUp(glPose(camera));
    const glm::dmat3 back = glm::transpose(pose.axes);
    // Angles between the rays to the middles of opposite edges.
    const auto angle = [&](glm::dvec2 from, glm::dvec2 to) {
        const glm::dvec3 a(from - camera.principal_px, focal);
        const glm::dvec3 b(to - camera.principal_px, focal);
        return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
    };
    const double w = camera.width;
    const double h = camera.height;
    Json json;
    json["principalPoint"] = point(planeOf(camera.principal_px, size));
    json["viewTransform"] = {{"rows", rowsOf({back, -(back * pose.position)})}};
    json["cameraTransform"] = {{"rows", rowsOf(pose)}};
    json["horizontalFieldOfView"] = angle({0.0, 0.5 * h}, {w, 0.5 * h});
    json["verticalFieldOfView"] = angle({0.5 * w, 0.0}, {0.5 * w, h});
    Json points = Json::array();
    Json axes = Json::array();
    const char* names[] = {"x", "y", "z"};
    const glm::dvec3 ours[] = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
    for (int k = 0; k < 3; ++k) {
        glm::dvec3 d = inCamera(camera, ours[k]);
        axes.push_back(axisToward(names[k], d));
        // fSpy has no points at infinity: ten million half sides away.
        if (std::abs(d.z) < 1e-7) d.z = d.z < 0.0 ? -1e-7 : 1e-7;
        points.push_back(point(planeOf(camera.principal_px + focal * glm::dvec2(d) / d.z, size)));
    }
    json["vanishingPoints"] = points;
    json["vanishingPointAxes"] = axes;
    json["relativeFocalLength"] = focal / half;
    json["imageWidth"] = camera.width;
    json["imageHeight"] = camera.height;
    return json;
}

CameraEstimate readFspyProject(const std::filesystem::path& path)
{
    const std::vector<std::uint8_t> bytes = readFile(path, 1LL << 30);
    const std::string name = path.string();
    const ByteView view(bytes, name, ByteOrder::Little);
    if (!view.startsWith("fspy"))
        throw InputError(name, "byte 0", "is no fSpy project: it does not begin with \"fspy\"");
    if (view.u32(4) != kVersion)
        throw InputError(
            name,
            "byte 4",
            fmt::format("fSpy's version {} is unknown here, only {} is", view.u32(4), kVersion));
    const std::uint32_t json_size = view.u32(8);
    (void)view.slice(kHeader + json_size, view.u32(12));
    const auto text = view.slice(kHeader, json_size);
    const Json json = parseJson({text.begin(), text.end()}, name);
    const JsonNode root(json, name);
    if (!json.is_object()) root.fail("its state is no JSON object");
    const auto parameters = root.find("cameraParameters");
    if (!parameters || parameters->value().is_null())
        root.fail("holds no solved camera: fSpy could not solve it, or saved it before it did");
    CameraEstimate estimate = fspyParameters(*parameters);
    double metres = 0.0;
    if (const auto base = root.find("calibrationSettingsBase"))
        if (const auto unit = base->find("referenceDistanceUnit")) metres = metresPer(*unit);
    if (metres > 0.0)
        estimate.camera.position_m *= metres;
    else
        estimate.findings.push_back({Severity::Warning,
                                     "camera-unit-unknown",
                                     "the fSpy project has no unit of length: its numbers count "
                                     "as metres"});
    return estimate;
}

void writeFspyProject(const std::filesystem::path& path,
                      const Camera& camera,
                      const std::vector<std::uint8_t>& picture_bytes)
{
    if (picture_bytes.empty())
        throw InputError(path.string(),
                         "an fSpy project holds the photograph: give it beside --from, or write "
                         "fSpy's JSON (.fspy.json)");
    const std::string state = projectState(camera).dump();
    Bytes bytes;
    append(bytes, "fspy");
    append32Little(bytes, kVersion);
    append32Little(bytes, static_cast<std::uint32_t>(state.size()));
    append32Little(bytes, static_cast<std::uint32_t>(picture_bytes.size()));
    append(bytes, state);
    append(bytes, picture_bytes);
    writeTextFile(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace insitu::foreign
