#pragma once

#include "calib/line_segments.h"
#include "core/camera.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <array>
#include <filesystem>
#include <optional>
#include <string>

namespace insitu {

struct CalibrationOptions {
    /// Focal length from EXIF, pixels; used where the lines leave it open and to cross-check.
    /// focalFromExif (calib/exif_focal.h) gives it together with its standard deviation.
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
    double rotation_sigma_rad = 0.0;  ///< root mean square angle of the rotation's error
    glm::dvec3 position_sigma_m{0.0};
    double residual_rms_px = 0.0;  ///< segments' end points against their vanishing points
    std::array<std::optional<glm::dvec2>, 3>
        vanishing_points_px;  ///< x, y, z, where straight pixels meet; absent = infinity or unused
    Findings findings;
};

/// Camera from two or three orthogonal vanishing directions. All segments of an axis count.
///
/// Rotation and focal length by maximum likelihood (calib/orientation.h), the EXIF focal length as
/// a prior; then signs: y points up in the picture, x to the right in it, z = x × y (towards the
/// viewer); then the place (calib/metric_scale.h). Square pixels, principal point in the picture's
/// middle; marked points are straightened first when the LineSet says how the lens bends lines.
///
/// Findings:
///   principal-point-assumed     always: the picture's middle is taken
///   focal-from-exif             the lines leave the focal length open (one-point view), EXIF's is
///                               used
///   focal-disagrees-with-exif   lines and EXIF contradict each other; the lines alone are used
///   segments-inconsistent       residuals too large for `segment_sigma_px`; the standard
///                               deviations are those of the larger error that the residuals show
///   calibration-weak            focal length worse than 5 %, rotation worse than 1°, or position
///                               worse than 5 % of the distance to the origin
///   axis-sign-ambiguous         x runs so nearly along the view that "right" is a matter of luck
///   scale-disagrees             see calib/metric_scale.h
/// Throws InputError for a broken LineSet, NoAnswerError (naming `source`) when the lines admit no
/// camera: a single axis, too few segments, an open focal length without EXIF, lines of an axis
/// that do not meet in a direction perpendicular to the others, y segments that run horizontally,
/// an origin above the horizon, no scale.
/// Source: [GibCha03] section 3 eq. 1, [CapTor90]; refined by least squares on end points.
[[nodiscard]] CameraEstimate calibrateCamera(const LineSet& marked,
                                             const CalibrationOptions& options,
                                             const std::string& source);

/// `camera.json` (docs/file_format.md).
void writeCamera(const std::filesystem::path& path, const CameraEstimate& estimate);
/// Reads `camera.json`, ours or another program's: image, focal_px, position_m, right, up and
/// forward are needed, the rest has defaults. InputError when the axes are not orthonormal (1e-3)
/// or left-handed, or a distortion is given that is no division model.
[[nodiscard]] CameraEstimate readCamera(const std::filesystem::path& path);

}  // namespace insitu
