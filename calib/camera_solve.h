#pragma once

#include "calib/line_segments.h"
#include "core/camera.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <array>
#include <filesystem>
#include <optional>

namespace insitu {

struct CalibrationOptions {
    /// Focal length from EXIF, pixels; used where the lines leave it open and to cross-check.
    std::optional<double> exif_focal_px;
    /// Relative standard deviation of the EXIF focal length as a prior. Unitless, > 0.
    double exif_focal_sigma = 0.03;
    /// Standard deviation of a marked end point, pixels, > 0.
    double segment_sigma_px = 1.0;
    /// Use the EXIF focal as a prior in the solve. False: lines alone where they suffice.
    bool use_exif = true;
};

/// A camera with what is known about its error (1σ) and what had to be guessed.
struct CameraEstimate {
    Camera camera;
    double focal_sigma_px = 0.0;
    double rotation_sigma_rad = 0.0;  ///< of the rotation's angle
    glm::dvec3 position_sigma_m{0.0};
    double residual_rms_px = 0.0;  ///< segments' end points against their vanishing points
    std::array<std::optional<glm::dvec2>, 3>
        vanishing_points_px;  ///< x, y, z; absent = infinity or unused
    Findings findings;
};

/// Camera from two or three orthogonal vanishing directions. All segments of an axis count.
/// Throws NoAnswerError (naming `source`) when the lines admit no camera: a single axis without a
/// focal length, lines of an axis that do not meet in a direction, no scale.
/// Source: [GibCha03] section 3 eq. 1, [CapTor90]; refined by least squares on end points.
[[nodiscard]] CameraEstimate calibrateCamera(const LineSet& lines,
                                             const CalibrationOptions& options,
                                             const std::string& source);

/// `camera.json` (docs/file_format.md).
void writeCamera(const std::filesystem::path& path, const CameraEstimate& estimate);
[[nodiscard]] CameraEstimate readCamera(const std::filesystem::path& path);

}  // namespace insitu
