#pragma once

#include "calib/line_segments.h"
#include "core/photo.h"

#include <optional>

namespace insitu {

/// Up in the camera's frame of the upright photograph, as the accelerometer of the telephone that
/// took it says (core/io/exif_acceleration.h).
///
/// sigma_rad is 1.15°, what 20 mg of zero error and an unsteady hand make of it. Nothing when EXIF
/// tells no acceleration, or one that is not within 5 % of g: the telephone was being moved.
[[nodiscard]] std::optional<Gravity> gravityFromExif(const PhotoMetadata& metadata);

}  // namespace insitu
