#include "calib/camera_formats.h"

#include "calib/foreign_cameras.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

namespace insitu {

namespace foreign {

namespace {

/// Other programs write axes with few digits; what is further off is no rotation.
constexpr double kOrthonormal = 1e-3;
constexpr int kLargestSide = 100'000;
/// (x, y, z) of a world that is Y up → (x, −z, y) of one that is Z up.
const glm::dmat3 kZUpFromYUp(glm::dvec3(1, 0, 0), glm::dvec3(0, 0, 1), glm::dvec3(0, -1, 0));

}  // namespace

GlPose glPose(const Camera& camera)
{
    return {{camera.right, camera.up, -camera.forward}, camera.position_m};
}

void setPose(const GlPose& pose, const JsonNode& node, Camera& camera)
{
    const glm::dmat3 products = glm::transpose(pose.axes) * pose.axes;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (!(std::abs(products[i][j] - (i == j ? 1.0 : 0.0)) <= kOrthonormal))
                node.fail("is no rotation: its axes are not unit vectors at right angles");
    if (glm::determinant(pose.axes) < 0.0) node.fail("is a mirrored camera, not a rotation");
    const glm::dvec3 forward = -glm::normalize(pose.axes[2]);
    camera.right = glm::normalize(glm::cross(forward, pose.axes[1]));
    camera.up = glm::cross(camera.right, forward);
    camera.forward = forward;
    camera.position_m = pose.position;
}

GlPose zUpFromYUp(const GlPose& pose)
{
    return {kZUpFromYUp * pose.axes, kZUpFromYUp * pose.position};
}

GlPose yUpFromZUp(const GlPose& pose)
{
    const glm::dmat3 back = glm::transpose(kZUpFromYUp);
    return {back * pose.axes, back * pose.position};
}

GlPose poseOfRows(const JsonNode& rows)
{
    if (rows.size() != 4) rows.fail("must be four rows of four numbers");
    glm::dmat4 m(1.0);
    for (std::size_t r = 0; r < 4; ++r) {
        const JsonNode row = rows.at(r);
        if (row.size() != 4) row.fail("must be four numbers");
        for (std::size_t c = 0; c < 4; ++c)
            m[static_cast<int>(c)][static_cast<int>(r)] = row.at(c).number();
    }
    for (int c = 0; c < 4; ++c)
        if (std::abs(m[c][3] - (c == 3 ? 1.0 : 0.0)) > kOrthonormal)
            rows.at(3).fail("the last row must be 0, 0, 0, 1");
    return {glm::dmat3(m), glm::dvec3(m[3])};
}

Json rowsOf(const GlPose& pose)
{
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r)
        rows.push_back({pose.axes[0][r], pose.axes[1][r], pose.axes[2][r], pose.position[r]});
    rows.push_back({0.0, 0.0, 0.0, 1.0});
    return rows;
}

glm::ivec2 sizeOf(const JsonNode& width, const JsonNode& height)
{
    const glm::ivec2 size(width.integer(), height.integer());
    if (size.x < 1 || size.x > kLargestSide)
        width.fail(fmt::format("must lie between 1 and {}", kLargestSide));
    if (size.y < 1 || size.y > kLargestSide)
        height.fail(fmt::format("must lie between 1 and {}", kLargestSide));
    return size;
}

void checkSize(const Camera& camera, const CameraReading& reading, const std::string& file)
{
    if (!reading.size_px || *reading.size_px == glm::ivec2(camera.width, camera.height)) return;
    throw InputError(file,
                     fmt::format("is the camera of a {}x{} picture, but the photograph has {}x{} "
                                 "pixels",
                                 camera.width,
                                 camera.height,
                                 reading.size_px->x,
                                 reading.size_px->y));
}

}  // namespace foreign

namespace {

namespace fs = std::filesystem;

enum class Format { Ours, FspyProject, FspyParameters, Colmap, Gltf, Blender, Unknown };

bool endsWith(const std::string& name, const std::string& ending)
{
    return name.size() >= ending.size() &&
           name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

Format formatOf(const fs::path& path)
{
    std::string name = path.filename().string();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
        return static_cast<char>(std::tolower(c));
    });
    if (endsWith(name, ".fspy")) return Format::FspyProject;
    if (endsWith(name, ".fspy.json")) return Format::FspyParameters;
    if (endsWith(name, ".blender.json")) return Format::Blender;
    if (endsWith(name, ".json")) return Format::Ours;
    if (endsWith(name, ".gltf")) return Format::Gltf;
    if (name == "cameras.txt") return Format::Colmap;
    return Format::Unknown;
}

[[noreturn]] void unknownFormat(const fs::path& path)
{
    throw InputError(path.string(),
                     "is no camera file known here: use .json, .fspy, .fspy.json (fSpy's export), "
                     ".blender.json, .gltf or COLMAP's cameras.txt");
}

CameraEstimate readJsonCamera(const fs::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    if (!json.is_object()) root.fail("must be an object");
    if (root.has("cameraTransform")) return foreign::fspyParameters(root);
    if (root.has("matrix_world")) return foreign::blenderCamera(root);
    return readCamera(path);
}

}  // namespace

CameraEstimate readCameraFile(const fs::path& path, const CameraReading& reading)
{
    CameraEstimate estimate;
    switch (formatOf(path)) {
        case Format::Ours:
        case Format::FspyParameters:
        case Format::Blender:
            estimate = readJsonCamera(path);
            break;
        case Format::FspyProject:
            estimate = foreign::readFspyProject(path);
            break;
        case Format::Colmap:
            estimate = foreign::readColmap(path, reading.picture);
            break;
        case Format::Gltf:
            estimate = foreign::readGltfCamera(path, reading);
            break;
        case Format::Unknown:
            unknownFormat(path);
    }
    foreign::checkSize(estimate.camera, reading, path.string());
    return estimate;
}

Findings writeCameraFile(const fs::path& path,
                         const CameraEstimate& estimate,
                         const std::string& picture_name,
                         const std::vector<std::uint8_t>& picture_bytes)
{
    const Camera& camera = estimate.camera;
    const Format format = formatOf(path);
    Findings findings;
    if ((format == Format::FspyProject || format == Format::FspyParameters) &&
        camera.focal_px.x != camera.focal_px.y)
        findings.push_back({Severity::Warning,
                            "camera-focal-averaged",
                            fmt::format("fSpy has one focal length; {:.2f} and {:.2f} px become "
                                        "their mean",
                                        camera.focal_px.x,
                                        camera.focal_px.y)});
    if (camera.division != 0.0 && format != Format::Ours && format != Format::Colmap)
        findings.push_back(
            {Severity::Warning,
             "camera-distortion-lost",
             fmt::format("the format holds no lens distortion: a corner lies {:.1f} px elsewhere "
                         "without it",
                         glm::length(camera.straightened(glm::dvec2(0.0))))});
    switch (format) {
        case Format::Ours:
            writeCamera(path, estimate);
            break;
        case Format::FspyParameters:
            writeJson(path, foreign::fspyParameters(camera));
            break;
        case Format::Blender:
            writeJson(path, foreign::blenderCamera(camera));
            break;
        case Format::FspyProject:
            foreign::writeFspyProject(path, camera, picture_bytes);
            break;
        case Format::Colmap:
            append(findings, foreign::writeColmap(path, camera, picture_name));
            break;
        case Format::Gltf:
            append(findings, foreign::writeGltfCamera(path, camera));
            break;
        case Format::Unknown:
            unknownFormat(path);
    }
    return findings;
}

std::vector<fs::path> cameraFilesOf(const fs::path& path)
{
    const Format format = formatOf(path);
    if (format == Format::Unknown) unknownFormat(path);
    if (format != Format::Colmap) return {path};
    const fs::path folder = path.parent_path();
    return {path, folder / "images.txt", folder / "points3D.txt"};
}

}  // namespace insitu
