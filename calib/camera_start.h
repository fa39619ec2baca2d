#pragma once

#include "calib/camera_fit.h"
#include "calib/camera_solve.h"

#include <optional>
#include <string>

/// Internal to calib/: where a solve begins. Not installed.
namespace insitu::calibration {

struct Start {
    State state;
    bool x_ambiguous = false;  ///< x runs nearly along the view: its sign is luck
    /// Why there is no camera here: position in the file, and cause. Empty when all is well.
    std::string place;
    std::string complaint;
};

/// Rotation and focal length from the segments, signs by LineSet's convention, lens from traced
/// lines, position from the height or the known lengths. Nothing when no rotation fits.
[[nodiscard]] std::optional<Start> findStart(const LineSet& lines,
                                             const Choice& choice,
                                             const std::string& source);

}  // namespace insitu::calibration
