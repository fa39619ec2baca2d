#pragma once

#include "calib/camera_formats.h"
#include "core/io/json.h"

#include <glm/glm.hpp>

/// Internal to calib/: one pair of functions a format. Not installed.
namespace insitu::foreign {

/// Camera → world as OpenGL, glTF, fSpy and Blender say it: x right, y up, −z forward.
struct GlPose {
    glm::dmat3 axes{1.0};  ///< columns: right, up, backward in the world
    glm::dvec3 position{0.0};
};

[[nodiscard]] GlPose glPose(const Camera& camera);
/// Sets the camera's axes and place. InputError at `node` unless the axes are a rotation (1e-3).
void setPose(const GlPose& pose, const JsonNode& node, Camera& camera);

/// Turns a pose between a world that is Y up and one that is Z up.
[[nodiscard]] GlPose zUpFromYUp(const GlPose& pose);
[[nodiscard]] GlPose yUpFromZUp(const GlPose& pose);

/// Four rows of four numbers, the last 0 0 0 1.
[[nodiscard]] GlPose poseOfRows(const JsonNode& rows);
[[nodiscard]] Json rowsOf(const GlPose& pose);

/// Width and height, 1 to 100 000.
[[nodiscard]] glm::ivec2 sizeOf(const JsonNode& width, const JsonNode& height);
void checkSize(const Camera& camera, const CameraReading& reading, const std::string& file);

[[nodiscard]] CameraEstimate readFspyProject(const std::filesystem::path& path);
[[nodiscard]] CameraEstimate fspyParameters(const JsonNode& node);
[[nodiscard]] Json fspyParameters(const Camera& camera);
void writeFspyProject(const std::filesystem::path& path,
                      const Camera& camera,
                      const std::vector<std::uint8_t>& picture_bytes);

[[nodiscard]] CameraEstimate readColmap(const std::filesystem::path& cameras_file,
                                        const std::string& picture);
[[nodiscard]] Findings writeColmap(const std::filesystem::path& cameras_file,
                                   const Camera& camera,
                                   const std::string& picture_name);

[[nodiscard]] CameraEstimate readGltfCamera(const std::filesystem::path& path,
                                            const CameraReading& reading);
[[nodiscard]] Findings writeGltfCamera(const std::filesystem::path& path, const Camera& camera);

[[nodiscard]] CameraEstimate blenderCamera(const JsonNode& root);
[[nodiscard]] Json blenderCamera(const Camera& camera);

}  // namespace insitu::foreign
