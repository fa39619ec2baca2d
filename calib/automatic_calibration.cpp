#include "calib/automatic_calibration.h"

#include "calib/camera_errors.h"
#include "calib/photo_calibration.h"
#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr double kOriginDown = 0.85;

std::optional<FocalPrior> priorOf(const CalibrationOptions& options)
{
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
    options = withExif(std::move(options), photo);
    const auto exif = priorOf(options);
    RoomLineOptions line_options = automatic.lines;
    if (!line_options.up) line_options.up = options.exif_gravity;
    const auto found = findRoomLines(photo.image, exif, line_options);
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

    widen(found->doubt, result.camera);
    Findings& findings = result.camera.findings;
    findings.push_back(
        {Severity::Info,
         "automatic-lines",
         fmt::format("{} of {} edges follow the room's directions ({}; {:.0f} % by length); "
                     "focal length ± {:.1f} %, rotation ± {:.2f}°, evidence {:.0f} over the next "
                     "best answer; of the angle between x and z the edges alone say {:.0f} ± "
                     "{:.0f}°",
                     found->segments.size(),
                     found->detected,
                     countsOf(found->segments),
                     100.0 * found->explained,
                     100.0 * found->focal_doubt,
                     glm::degrees(found->rotation_doubt),
                     found->margin,
                     90.0 + glm::degrees(found->angle_off),
                     glm::degrees(found->angle_sigma))});
    if (found->second)
        findings.push_back(
            {Severity::Info,
             "automatic-second-directions",
             fmt::format("{} more edges run along a second pair of horizontal directions, turned "
                         "by {:.1f}° (counter-clockwise seen from above): walls or furniture that "
                         "stand askew; they have no part in the answer",
                         found->second->segments,
                         glm::degrees(found->second->turn_rad))});
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
    options = withExif(std::move(options), photo);
    const auto completed = completeStrokes(strokes, photo.image, priorOf(options), line_options);
    AutomaticCalibration result;
    result.lines = completed ? completed->lines : strokes;
    if (completed) options.segment_sigma_px = completed->sigma_px;
    result.camera = calibrateCamera(result.lines, options, source);
    if (completed) {
        widen(completed->doubt, result.camera);
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
