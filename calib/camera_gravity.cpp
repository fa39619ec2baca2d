#include "calib/camera_lines.h"
#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// As for EXIF's focal length (calib/camera_solve.cpp).
constexpr double kDisagreementSigmas = 4.0;

glm::dvec3 upInCamera(const CameraEstimate& estimate)
{
    const Camera& camera = estimate.camera;
    return {camera.right.y, -camera.up.y, camera.forward.y};
}

/// How far off up may be: the turns about the two axes at right angles to it, root mean square.
double upSigma(const CameraEstimate& estimate)
{
    const glm::dvec3 up = upInCamera(estimate);
    double square = 0.0;
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column)
            square += ((row == column ? 1.0 : 0.0) - up[row] * up[column]) *
                      estimate.covariance[row][column];
    return std::sqrt(std::max(0.0, 0.5 * square));
}

}  // namespace

CameraEstimate calibrateCamera(const LineSet& marked,
                               const CalibrationOptions& options,
                               const std::string& source)
{
    requireValid(options.validate(), "calibration options");
    if (!options.exif_gravity || marked.gravity)
        return calibration::calibrateLines(marked, options, source);

    const Gravity& gravity = *options.exif_gravity;
    std::optional<CameraEstimate> alone;
    try {
        alone = calibration::calibrateLines(marked, options, source);
    } catch (const NoAnswerError&) {
        // The accelerometer may tell what the lines leave open.
    }
    const double off =
        alone ? std::acos(
                    std::clamp(glm::dot(upInCamera(*alone), glm::normalize(gravity.up)), -1.0, 1.0))
              : 0.0;
    if (alone && off > kDisagreementSigmas * std::hypot(upSigma(*alone), gravity.sigma_rad)) {
        alone->findings.push_back(
            {Severity::Warning,
             "gravity-disagrees-with-exif",
             fmt::format("the y lines and EXIF's accelerometer (± {:.1f}°) put up {:.1f}° apart; "
                         "the lines alone are used. Lines that are not upright in the room, or a "
                         "picture that was turned or straightened?",
                         glm::degrees(gravity.sigma_rad),
                         glm::degrees(off))});
        return *alone;
    }
    LineSet held = marked;
    held.gravity = gravity;
    CameraEstimate estimate = calibration::calibrateLines(held, options, source);
    estimate.findings.push_back(
        {Severity::Info,
         "gravity-from-exif",
         fmt::format(
             "up by EXIF's accelerometer, ± {:.1f}°, is part of the solve{}",
             glm::degrees(gravity.sigma_rad),
             alone ? fmt::format("; the lines alone put it {:.1f}° from there", glm::degrees(off))
                   : ", which the lines alone leave open")});
    return estimate;
}

}  // namespace insitu
