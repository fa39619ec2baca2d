#pragma once

#include "calib/camera_fit.h"
#include "calib/camera_solve.h"
#include "core/finding.h"

/// Internal to calib/: what a solve has to tell about its answer. Not installed.
namespace insitu::calibration {

inline constexpr double kPercent = 100.0;

/// What the picture says and does not say, with numbers (the list at calibrateCamera).
[[nodiscard]] Findings describeFit(const LineSet& lines,
                                   const Fit& fit,
                                   const CalibrationOptions& options,
                                   const CameraEstimate& estimate);

}  // namespace insitu::calibration
