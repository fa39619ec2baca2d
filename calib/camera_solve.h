#pragma once

#include "calib/line_segments.h"
#include "core/camera.h"
#include "core/finding.h"

#include <glm/glm.hpp>

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

struct CalibrationOptions {
    /// Focal length from EXIF, pixels; used where the lines leave it open and to cross-check.
    /// focalFromExif (calib/exif_focal.h) gives it together with its standard deviation.
    std::optional<double> exif_focal_px;
    /// Relative standard deviation of the EXIF focal length as a prior. Unitless, > 0.
    double exif_focal_sigma = 0.03;
    /// Up by EXIF's accelerometer (calib/exif_gravity.h): a prior that gives way when the lines
    /// contradict it. A LineSet's own `gravity` comes first.
    std::optional<Gravity> exif_gravity;
    /// Whether calibratePhoto and its like read `exif_gravity` from the photograph.
    bool use_exif_gravity = true;
    /// Standard deviation of a marked coordinate, pixels, > 0.
    double segment_sigma_px = 1.0;
    /// Use the EXIF focal as a prior in the solve. False: lines alone where they suffice.
    bool use_exif = true;
    /// How far the principal point may lie from the picture's middle: standard deviation of each
    /// coordinate as a share of the long side, in [0, 1]. 0: exactly in the middle. 1 % is what
    /// uncropped photographs of ordinary cameras show; a crop needs more. A LineSet's own
    /// `principal_point` comes first.
    double principal_sigma = 0.01;

    /// Every problem at once.
    [[nodiscard]] Findings validate() const;
};

/// Order of the rows of CameraEstimate::covariance: a small turn about the camera's x, y and z
/// (radians, applied last), ln focal, the principal point (px), the lens's division, the position
/// (metres).
enum class CameraUnknown {
    Turn = 0,
    LogFocal = 3,
    Principal = 4,
    Division = 6,
    Position = 7,
    Count = 10
};
using CameraCovariance = std::array<std::array<double, 10>, 10>;

/// A camera with what is known about its error (1σ) and what had to be guessed.
struct CameraEstimate {
    Camera camera;
    double focal_sigma_px = 0.0;
    glm::dvec2 principal_sigma_px{0.0};
    double division_sigma = 0.0;
    double rotation_sigma_rad = 0.0;  ///< root mean square angle of the rotation's error
    glm::dvec3 turn_sigma_rad{0.0};   ///< its parts about the camera's x (pitch), y (yaw), z (roll)
    glm::dvec3 position_sigma_m{0.0};
    /// Zero rows for what was taken as exact. All zero: nothing known (a camera file without it).
    CameraCovariance covariance{};
    double residual_rms_px = 0.0;  ///< segments' end points against their vanishing points
    std::array<std::optional<glm::dvec2>, 3>
        vanishing_points_px;  ///< x, y, z, where straight pixels meet; absent = infinity or unused
    std::vector<std::size_t> outlier_segments;  ///< left out, each named in a finding
    Findings findings;
};

/// Camera from lines along two or three orthogonal directions of a room, and whatever else is known
/// about the picture (LineSet), in one maximum-likelihood solve (calib/camera_system.h): rotation,
/// focal length, principal point (with a prior about the picture's middle), division of the lens,
/// position. Every marked coordinate has an independent error of `segment_sigma_px`; ends of
/// segments of different axes that were marked at the same point are one point. Then signs: y
/// points up in the picture, x to the right in it, z = x × y (towards the viewer). Square pixels.
///
/// The lens's division is an unknown when lines were traced by more than their ends, when the
/// LineSet gives it with a standard deviation, or when straight segments show it by 4 σ.
///
/// Findings:
///   principal-point-assumed     the picture cannot tell where it is; says what that costs
///   principal-point-estimated   the picture tells
///   distortion-assumed, distortion-estimated   the same for the lens
///   segment-outlier             a segment that runs along no such direction; it is left out
///   focal-from-exif             the lines leave the focal length open (one-point view), EXIF's is
///                               used
///   focal-disagrees-with-exif   lines and EXIF contradict each other; the lines alone are used
///   gravity-from-exif           EXIF's accelerometer is part of the solve
///   gravity-disagrees-with-exif the lines put up elsewhere by 4 σ; the lines alone are used
///   segments-inconsistent       residuals too large for `segment_sigma_px`; the standard
///                               deviations are those of the larger error that the residuals show
///   calibration-weak            focal length worse than 5 %, rotation worse than 1°, or position
///                               worse than 5 % of the distance to the origin, even if the
///                               principal point were known
///   axis-sign-ambiguous         x runs so nearly along the view that "right" is a matter of luck
///   scale-disagrees             a known length contradicts the rest and has no say
///   known-length                how well each known length is met, in centimetres
/// Throws InputError for a broken LineSet, NoAnswerError (naming `source`) when the lines admit no
/// camera: a single axis, too few segments, an open focal length (one-point view) without EXIF,
/// rectangle or length that would tell it, lines of an axis that do not meet in a direction
/// perpendicular to the others, y segments that run horizontally, an origin above the horizon, no
/// scale.
/// Source: [GibCha03] section 3 eq. 1, [CapTor90] for what vanishing points tell, [FoeWro16]
/// section 4.8 for the solve.
[[nodiscard]] CameraEstimate calibrateCamera(const LineSet& marked,
                                             const CalibrationOptions& options,
                                             const std::string& source);

/// How far off an object may be that is placed in the picture, metres, 1 σ.
struct PlacementSigma {
    double along_m = 0.0;   ///< on the floor, towards or away from the camera
    double across_m = 0.0;  ///< on the floor, at right angles to that
    double height_m = 0.0;  ///< of a point one metre above it
};

/// The point that the picture shows where the camera believes `point_m` to be, against `point_m`
/// itself, on the horizontal plane through it; and the height of an upright of a metre on it. From
/// the full covariance, to first order. Nothing when the point is not seen, or not from above, or
/// the covariance is unknown.
[[nodiscard]] std::optional<PlacementSigma> placementSigma(const CameraEstimate& estimate,
                                                           glm::dvec3 point_m);

/// `camera.json` (docs/file_format.md).
void writeCamera(const std::filesystem::path& path, const CameraEstimate& estimate);
/// Reads `camera.json`, ours or another program's: image, focal_px, position_m, right, up and
/// forward are needed, the rest has defaults. InputError when the axes are not orthonormal (1e-3)
/// or left-handed, or a distortion is given that is no division model.
[[nodiscard]] CameraEstimate readCamera(const std::filesystem::path& path);

}  // namespace insitu
