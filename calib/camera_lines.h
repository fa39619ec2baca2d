#pragma once

#include "calib/camera_solve.h"

#include <string>

/// Internal to calib/. Not installed.
namespace insitu::calibration {

/// calibrateCamera without EXIF's accelerometer. The options are valid.
[[nodiscard]] CameraEstimate calibrateLines(const LineSet& marked,
                                            const CalibrationOptions& options,
                                            const std::string& source);

}  // namespace insitu::calibration
