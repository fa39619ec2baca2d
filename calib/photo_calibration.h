#pragma once

#include "calib/camera_solve.h"
#include "core/photo.h"

#include <string>

namespace insitu {

/// The options with what the photograph's EXIF tells, where they do not say it themselves: focal
/// length and its standard deviation (calib/exif_focal.h), and up (calib/exif_gravity.h) unless
/// `use_exif_gravity` is false.
[[nodiscard]] CalibrationOptions withExif(CalibrationOptions options, const Photo& photo);

/// calibrateCamera with the photograph's EXIF (withExif) for lines marked in it. InputError when
/// the picture's size is not that of the lines.
[[nodiscard]] CameraEstimate calibratePhoto(const LineSet& lines,
                                            const Photo& photo,
                                            const CalibrationOptions& options,
                                            const std::string& source);

}  // namespace insitu
