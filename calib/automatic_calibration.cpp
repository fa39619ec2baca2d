#include "calib/automatic_calibration.h"

#include "calib/exif_focal.h"
#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr double kOriginDown = 0.85;

std::optional<FocalPrior> settleExif(const Photo& photo, CalibrationOptions& options)
{
    if (!options.exif_focal_px) {
        if (const auto exif = focalFromExif(
                photo.metadata, photo.image.codes.width(), photo.image.codes.height())) {
            options.exif_focal_px = exif->focal_px;
            options.exif_focal_sigma = exif->sigma;
        }
    }
    if (!options.exif_focal_px || !options.use_exif) return std::nullopt;
    return FocalPrior{*options.exif_focal_px, options.exif_focal_sigma};
}

std::string joined(const std::vector<std::string>& texts)
{
    std::string all;
    for (const std::string& text : texts)
        all += (all.empty() ? "" : "; ") + text;
    return all;
}

std::string countsOf(const std::vector<LineSegment>& segments)
{
    int counts[3] = {};
    for (const LineSegment& segment : segments)
        ++counts[static_cast<int>(segment.axis)];
    return fmt::format("{} along x, {} along y, {} along z", counts[0], counts[1], counts[2]);
}

/// The pixel that the world's origin is seen at when nobody says: on the floor, if the horizon
/// leaves room for it.
glm::dvec2 usualOrigin(int width, int height)
{
    return {0.5 * width, kOriginDown * height};
}

/// Deviations as large as the doubts, all by one factor, since they hang together.
void widen(CameraEstimate& camera, double focal_doubt, double rotation_doubt)
{
    double factor = 1.0;
    if (camera.focal_sigma_px > 0.0)
        factor = std::max(factor, focal_doubt * camera.camera.focal_px.x / camera.focal_sigma_px);
    if (camera.rotation_sigma_rad > 0.0)
        factor = std::max(factor, rotation_doubt / camera.rotation_sigma_rad);
    camera.focal_sigma_px *= factor;
    camera.principal_sigma_px *= factor;
    camera.division_sigma *= factor;
    camera.rotation_sigma_rad *= factor;
    camera.turn_sigma_rad *= factor;
    camera.position_sigma_m *= factor;
    for (auto& row : camera.covariance)
        for (double& value : row)
            value *= factor * factor;
}

}  // namespace

Findings AutomaticOptions::validate() const
{
    Findings problems = lines.validate();
    const auto check = [&](bool good, const std::string& message) {
        if (!good) problems.push_back({Severity::Error, "automatic-options", message});
    };
    if (origin_px)
        check(std::isfinite(origin_px->x) && std::isfinite(origin_px->y),
              "origin_px must be finite");
    if (camera_height_m)
        check(std::isfinite(*camera_height_m) && *camera_height_m > 0.0,
              fmt::format("camera_height_m is {}, must be positive", *camera_height_m));
    check(std::isfinite(camera_height_sigma_m) && camera_height_sigma_m >= 0.0,
          fmt::format("camera_height_sigma_m is {}, must not be negative", camera_height_sigma_m));
    return problems;
}

AutomaticCalibration calibrateAutomatically(const Photo& photo,
                                            CalibrationOptions options,
                                            const AutomaticOptions& automatic,
                                            const std::string& source)
{
    requireValid(automatic.validate(), "automatic calibration options");
    const auto exif = settleExif(photo, options);
    const auto found = findRoomLines(photo.image, exif, automatic.lines);
    if (!found)
        throw NoAnswerError(source,
                            "the picture has too few straight edges to find the room's directions; "
                            "mark lines by hand (--lines)");
    if (!found->objections.empty() && !automatic.accept_doubtful)
        throw NoAnswerError(
            source,
            fmt::format("automatic calibration cannot vouch for its answer: {}. Mark lines by "
                        "hand (--lines){}, or take the answer all the same (--accept-doubtful)",
                        joined(found->objections),
                        exif ? "" : ", give the focal length (--focal-px)"));

    AutomaticCalibration result{{}, {}, *found};
    LineSet& lines = result.lines;
    lines.width = photo.image.codes.width();
    lines.height = photo.image.codes.height();
    lines.segments = found->segments;
    lines.origin_px = automatic.origin_px.value_or(usualOrigin(lines.width, lines.height));
    lines.camera_height_m = automatic.camera_height_m.value_or(1.0);
    lines.camera_height_sigma_m = automatic.camera_height_m ? automatic.camera_height_sigma_m : 0.0;
    options.segment_sigma_px = found->sigma_px;
    result.camera = calibrateCamera(lines, options, source);

    widen(result.camera, found->focal_doubt, found->rotation_doubt);
    Findings& findings = result.camera.findings;
    findings.push_back(
        {Severity::Info,
         "automatic-lines",
         fmt::format("{} of {} edges follow the room's directions ({}; {:.0f} % by length); "
                     "focal length ± {:.1f} %, rotation ± {:.2f}°, evidence {:.0f} over the next "
                     "best answer",
                     found->segments.size(),
                     found->detected,
                     countsOf(found->segments),
                     100.0 * found->explained,
                     100.0 * found->focal_doubt,
                     glm::degrees(found->rotation_doubt),
                     found->margin)});
    if (!found->objections.empty())
        findings.push_back({Severity::Warning, "automatic-doubtful", joined(found->objections)});
    if (!automatic.origin_px)
        findings.push_back({Severity::Warning,
                            "origin-assumed",
                            fmt::format("the world's origin is put on the floor at pixel ({:.0f}, "
                                        "{:.0f}); give --origin",
                                        lines.origin_px.x,
                                        lines.origin_px.y)});
    if (!automatic.camera_height_m)
        findings.push_back({Severity::Warning,
                            "scale-assumed",
                            "no length is known: the camera's height over the floor is called 1 m; "
                            "give --camera-height"});
    return result;
}

AutomaticCalibration calibrateCompleted(const LineSet& strokes,
                                        const Photo& photo,
                                        CalibrationOptions options,
                                        const RoomLineOptions& line_options,
                                        const std::string& source)
{
    strokes.check(source);
    checkLinesMatchPhoto(strokes, photo.image.codes.width(), photo.image.codes.height(), source);
    if (strokes.distortion.division != 0.0)
        throw InputError(source,
                         "distortion",
                         "edges that the lens bends cannot be followed: leave out --auto, or "
                         "undistort the photograph first");
    const auto exif = settleExif(photo, options);
    const auto completed = completeStrokes(strokes, photo.image, exif, line_options);
    AutomaticCalibration result;
    result.lines = completed ? completed->lines : strokes;
    if (completed) options.segment_sigma_px = completed->sigma_px;
    result.camera = calibrateCamera(result.lines, options, source);
    if (completed) {
        widen(result.camera, completed->focal_doubt, completed->rotation_doubt);
        result.camera.findings.push_back(
            {Severity::Info,
             "lines-completed",
             fmt::format("{} of {} strokes were put onto the edge beside them, {} more edges run "
                         "along the same directions ({})",
                         completed->snapped,
                         strokes.segments.size(),
                         completed->added,
                         countsOf(result.lines.segments))});
    } else {
        result.camera.findings.push_back(
            {Severity::Warning,
             "lines-not-completed",
             "the strokes alone are used: they do not tell the room's directions to within 10°, "
             "so no edge can be said to follow them"});
    }
    return result;
}

}  // namespace insitu
