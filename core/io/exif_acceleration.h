#pragma once

#include <glm/glm.hpp>

#include <cstdint>
#include <optional>
#include <span>

namespace insitu {

/// What the accelerometer of a telephone showed while it took a picture, in units of g, in the
/// frame of the camera that took the *stored* pixels (x right, y down, z forward; the orientation
/// is not applied yet). At rest it is a unit vector that points up.
///
/// block   raw EXIF ("Exif\0\0…" or a bare TIFF header), as in PhotoMetadata::exif
/// Read from Apple's maker's note (tag 8, three signed fractions): the only widespread one that has
/// all three axes. Nothing when there is none, it is damaged, or the camera on the screen's side
/// took the picture (its stored pixels are turned otherwise). Never throws.
/// Source of the axes: the tag's description in ExifTool and Exiv2 ("as viewed from the front of
/// the phone, positive x is toward the left side, y toward the bottom, z into the face"), and that
/// orientation 1 is the telephone held with its top to the left.
[[nodiscard]] std::optional<glm::dvec3> accelerationFromExif(std::span<const std::uint8_t> block);

}  // namespace insitu
