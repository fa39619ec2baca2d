#pragma once

#include "calib/camera_solve.h"
#include "core/photo.h"

#include <string>

namespace insitu {

/// calibrateCamera for lines marked in `photo`: the picture's size must be that of the lines
/// (InputError), and the EXIF focal length and its standard deviation are taken from the photograph
/// (calib/exif_focal.h) unless `options.exif_focal_px` is given.
[[nodiscard]] CameraEstimate calibratePhoto(const LineSet& lines,
                                            const Photo& photo,
                                            CalibrationOptions options,
                                            const std::string& source);

}  // namespace insitu
