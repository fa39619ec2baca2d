#pragma once

#include "calib/camera_solve.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// Cameras of other programs. The formats differ in their axes; ours are those of core/camera.h,
/// and this is the only place that converts.
///
/// | format | files | world | camera | principal point, distortion |
/// |---|---|---|---|---|
/// | ours | `.json` | Y up, metres | | both |
/// | fSpy | `.fspy`; its exported `.fspy.json` | Z up (or Y: see below), its own unit | −z forward
/// | principal point | | COLMAP text | `cameras.txt` with `images.txt` beside | as given | z
/// forward, y down | both | | glTF 2.0 | `.gltf` | Y up, metres | −z forward | none | | Blender |
/// `.blender.json` | Z up, metres | −z forward | principal point (shift) |
///
/// Y up becomes Z up by (x, y, z) → (x, −z, y). An fSpy project may call any axis the upright one:
/// when its z is not the one nearest to upright in the picture but its y is, its axes are taken as
/// they are.

struct CameraReading {
    /// Size of the photograph, for formats that do not say it (glTF). Checked where they do.
    std::optional<glm::ivec2> size_px;
    /// COLMAP: name of the picture whose camera is meant, when there are several. Empty: the first.
    std::string picture;
};

/// The camera in a file of any of these formats, recognised by its name and, for `.json`, by its
/// keys. Standard deviations that a format does not hold are 0. Findings:
///   camera-imported             from which format, in which world
///   camera-several              the file holds more than one; which was taken
///   camera-distortion-ignored   a lens distortion that is not applied, and what it does at a
///   corner camera-unit-unknown         fSpy without a unit: its numbers count as metres
/// InputError: a damaged file (position, cause), an unknown format, no camera in it, numbers that
/// are no camera (not finite, not a rotation), a size that is not the photograph's.
[[nodiscard]] CameraEstimate readCameraFile(const std::filesystem::path& path,
                                            const CameraReading& reading = {});

/// Writes a camera in the format that the name says. `.fspy` takes the photograph's own bytes (a
/// JPEG, PNG or other file as it is) into the file, and draws control lines that give this camera.
/// `cameras.txt` comes with `images.txt` and an empty `points3D.txt` in the same folder.
///
/// picture_name   what the formats that name the picture call it
/// Findings:
///   camera-principal-point-lost  the format has none (glTF); how many pixels that is
///   camera-distortion-lost       the format has none; how far a corner is off without it
///   camera-distortion-converted  the division model became a polynomial; by how much they differ
///   camera-focal-averaged        the format has one focal length; ours differ in x and y
/// InputError: an unknown extension; `.fspy` without picture bytes.
[[nodiscard]] Findings writeCameraFile(const std::filesystem::path& path,
                                       const CameraEstimate& estimate,
                                       const std::string& picture_name,
                                       const std::vector<std::uint8_t>& picture_bytes);

/// The files that writeCameraFile would write, to be checked before the work; InputError for an
/// unknown extension.
[[nodiscard]] std::vector<std::filesystem::path> cameraFilesOf(const std::filesystem::path& path);

}  // namespace insitu
