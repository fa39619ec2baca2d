#include "calib/camera_solve.h"

#include "calib/lens_distortion.h"
#include "calib/metric_scale.h"
#include "calib/orientation.h"
#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// σ of ln f from which on the lines leave the focal length open.
constexpr double kFocalOpen = 0.2;
/// σ of the rotation, radians, from which on there is no camera.
constexpr double kRotationOpen = 0.2;
constexpr double kWeakFocal = 0.05;
constexpr double kWeakRotation = glm::radians(1.0);
constexpr double kWeakPosition = 0.05;
/// Lines have heavier tails than their linearised deviation: one draw in 200 on truth room a passed
/// 3 σ and lost the better EXIF value. A crop or a wrong 35 mm value is off by far more.
constexpr double kDisagreementSigmas = 4.0;
/// Residuals beyond both are no lines of one direction: multiples of σ, share of the diagonal.
constexpr double kMaxResidualSigmas = 8.0;
constexpr double kMaxResidualShare = 0.01;
/// Component of x to the right in the picture below which its sign is luck.
constexpr double kSignMargin = 0.03;
/// Normal quantile of the test for consistent segments (one in a thousand).
constexpr double kConsistencyQuantile = 3.09;

constexpr double kPercent = 100.0;

void checkOptions(const CalibrationOptions& options)
{
    INSITU_CHECK(options.segment_sigma_px > 0.0, "segment_sigma_px {}", options.segment_sigma_px);
    INSITU_CHECK(options.exif_focal_sigma > 0.0, "exif_focal_sigma {}", options.exif_focal_sigma);
    INSITU_CHECK(!options.exif_focal_px || *options.exif_focal_px > 0.0,
                 "exif_focal_px {}",
                 *options.exif_focal_px);
}

void checkAxes(const LineSet& lines, const std::string& source)
{
    int counts[3] = {};
    for (const LineSegment& segment : lines.segments)
        ++counts[static_cast<int>(segment.axis)];
    const auto marked = std::count_if(counts, counts + 3, [](int count) { return count > 0; });
    if (marked < 2)
        throw NoAnswerError(source,
                            "segments",
                            "segments of at least two axes are needed (have those of " +
                                std::to_string(marked) +
                                "); mark edges along a second direction of the room");
    if (*std::max_element(counts, counts + 3) < 2)
        throw NoAnswerError(source,
                            "segments",
                            "one segment per axis is not enough; mark at least two edges along "
                            "one direction");
}

/// Largest χ² that n degrees of freedom explain (Wilson–Hilferty).
double chiSquaredLimit(double freedom)
{
    const double spread = 2.0 / (9.0 * freedom);
    return freedom * std::pow(1.0 - spread + kConsistencyQuantile * std::sqrt(spread), 3.0);
}

struct Solution {
    OrientationEstimate orientation;
    double sigma_px = 1.0;  ///< of an end point, as given or as large as the residuals show
    bool inconsistent = false;
};

bool consistent(const OrientationEstimate& orientation)
{
    return orientation.freedom < 1.0 ||
           orientation.chi_squared <= chiSquaredLimit(orientation.freedom);
}

/// Solves with common corners; without them when they contradict the lines (ends that only look
/// like a corner). When even then the residuals are too large for the stated error, once more with
/// the larger one, so that the prior gets the weight that it deserves and the covariance is honest.
std::optional<Solution> solve(const LineSet& lines,
                              glm::dvec2 principal_px,
                              double sigma_px,
                              const std::optional<FocalPrior>& prior)
{
    const auto shared = solveOrientation(lines, principal_px, sigma_px, prior);
    if (shared && consistent(*shared)) return Solution{*shared, sigma_px, false};
    const auto separate = solveOrientation(lines, principal_px, sigma_px, prior, Corners::Separate);
    if (!separate) return std::nullopt;
    if (consistent(*separate)) return Solution{*separate, sigma_px, false};
    const double larger = sigma_px * std::sqrt(separate->chi_squared / separate->freedom);
    const auto again = solveOrientation(lines, principal_px, larger, prior, Corners::Separate);
    if (!again) return std::nullopt;
    return Solution{*again, larger, true};
}

/// The lines alone, the lines with EXIF, and which of them is the answer.
struct FocalChoice {
    Solution solution;
    Findings findings;
};

bool focalKnown(const std::optional<Solution>& alone)
{
    return alone && !alone->orientation.focal_at_limit &&
           alone->orientation.lines_focal_sigma < kFocalOpen;
}

Finding disagreement(const OrientationEstimate& alone, const FocalPrior& exif)
{
    return {Severity::Warning,
            "focal-disagrees-with-exif",
            fmt::format("the lines say {:.1f} px ± {:.1f} % focal length, EXIF says {:.1f} px ± "
                        "{:.1f} % ({:+.1f} %); the lines alone are used. Cropped picture, or lines "
                        "that are not at right angles?",
                        alone.focal_px,
                        kPercent * alone.lines_focal_sigma,
                        exif.focal_px,
                        kPercent * exif.sigma,
                        kPercent * (alone.focal_px / exif.focal_px - 1.0))};
}

FocalChoice chooseFocal(const LineSet& lines,
                        glm::dvec2 principal_px,
                        const CalibrationOptions& options,
                        const std::string& source)
{
    const auto alone = solve(lines, principal_px, options.segment_sigma_px, std::nullopt);
    const bool known = focalKnown(alone);
    if (!options.exif_focal_px) {
        if (!alone || alone->orientation.focal_at_limit)
            throw NoAnswerError(source,
                                "segments",
                                "no real focal length fits these lines and there is none in EXIF; "
                                "check that each segment is marked with the right axis, or give "
                                "the focal length");
        if (!known)
            throw NoAnswerError(source,
                                "segments",
                                "the lines leave the focal length open (one-point view or too few "
                                "segments) and there is none in EXIF; mark more edges along a "
                                "second receding direction, or give the focal length");
        return {*alone, {}};
    }
    const FocalPrior exif{*options.exif_focal_px, options.exif_focal_sigma};
    Findings findings;
    if (known) {
        const OrientationEstimate& own = alone->orientation;
        const double off = std::abs(std::log(own.focal_px / exif.focal_px));
        const double expected = std::hypot(own.lines_focal_sigma, exif.sigma);
        const bool contradicts = off > kDisagreementSigmas * expected;
        if (contradicts) findings.push_back(disagreement(own, exif));
        if (contradicts || !options.use_exif) return {*alone, findings};
    }
    const auto both = solve(lines, principal_px, options.segment_sigma_px, exif);
    if (!both)
        throw NoAnswerError(
            source, "segments", "no rotation fits these lines; check the axis of each segment");
    if (!known)
        findings.push_back(
            {Severity::Warning,
             "focal-from-exif",
             fmt::format("the lines leave the focal length open; {:.1f} px ± {:.1f} % from EXIF is "
                         "used",
                         exif.focal_px,
                         kPercent * exif.sigma)});
    return {*both, findings};
}

/// Lines that do not meet in a direction at right angles to the others.
void checkResiduals(const LineSet& lines,
                    const OrientationEstimate& orientation,
                    const CalibrationOptions& options,
                    const std::string& source)
{
    const double limit = std::max(kMaxResidualSigmas * options.segment_sigma_px,
                                  kMaxResidualShare * std::hypot(lines.width, lines.height));
    for (int axis = 0; axis < 3; ++axis) {
        double sum = 0.0;
        int count = 0;
        for (std::size_t i = 0; i < lines.segments.size(); ++i) {
            if (static_cast<int>(lines.segments[i].axis) != axis) continue;
            sum += orientation.distances_px[i] * orientation.distances_px[i];
            ++count;
        }
        const double rms = count > 0 ? std::sqrt(sum / count) : 0.0;
        if (rms > limit)
            throw NoAnswerError(
                source,
                "segments",
                fmt::format("the {} segments do not meet in one direction at right angles to the "
                            "others (their ends are off by {:.1f} px); check their axes",
                            axisName(static_cast<RoomAxis>(axis)),
                            rms));
    }
}

/// Room axes in the camera's frame with the signs of LineSet's convention.
struct SignedAxes {
    glm::dvec3 x, y, z;
};

/// Up is up in the picture. Only a camera that looks nearly straight up or down has no such
/// direction: there the origin, a floor point in front of the camera, decides.
SignedAxes orient(const glm::dmat3& camera_from_world,
                  glm::dvec3 origin_ray,
                  const std::string& source,
                  Findings& findings)
{
    glm::dvec3 up = camera_from_world[1];
    const bool steep = std::abs(up.z) > 0.99;
    if (!steep && std::abs(up.x) > std::sqrt(3.0) * std::abs(up.y))
        throw NoAnswerError(source,
                            "segments",
                            "up would point sideways in the picture: the y segments run "
                            "horizontally, or x and z are not the horizontal directions; check the "
                            "axes, and that the photograph is upright");
    if (steep ? glm::dot(up, origin_ray) > 0.0 : up.y > 0.0) up = -up;
    glm::dvec3 right = camera_from_world[0];
    if (right.x < 0.0) right = -right;
    if (right.x < kSignMargin)
        findings.push_back(
            {Severity::Warning,
             "axis-sign-ambiguous",
             "the x direction runs almost along the view, so that its \"right\" hangs on a hair; "
             "exchange x and z"});
    return {right, up, glm::cross(right, up)};
}

Camera cameraFrom(const LineSet& lines,
                  glm::dvec2 principal_px,
                  double focal_px,
                  const SignedAxes& axes)
{
    Camera camera;
    camera.width = lines.width;
    camera.height = lines.height;
    camera.focal_px = glm::dvec2(focal_px);
    camera.principal_px = principal_px;
    camera.right = glm::dvec3(axes.x.x, axes.y.x, axes.z.x);
    camera.up = -glm::dvec3(axes.x.y, axes.y.y, axes.z.y);
    camera.forward = glm::dvec3(axes.x.z, axes.y.z, axes.z.z);
    return camera;
}

void reportDoubts(const LineSet& lines, const Solution& solution, CameraEstimate& estimate)
{
    const OrientationEstimate& orientation = solution.orientation;
    if (solution.inconsistent) {
        const auto worst =
            std::max_element(orientation.distances_px.begin(), orientation.distances_px.end());
        const auto index = static_cast<std::size_t>(worst - orientation.distances_px.begin());
        estimate.findings.push_back(
            {Severity::Warning,
             "segments-inconsistent",
             fmt::format("the segments miss their vanishing points by {:.2f} px (rms); worst is "
                         "segments[{}] ({}) with {:.2f} px: check its ends and axis, or the lens "
                         "bends lines",
                         estimate.residual_rms_px,
                         index,
                         axisName(lines.segments[index].axis),
                         *worst)});
    }
    const double focal = orientation.focalSigma();
    const double distance = glm::length(estimate.camera.position_m);
    const double place = glm::length(estimate.position_sigma_m) / distance;
    if (focal > kWeakFocal || estimate.rotation_sigma_rad > kWeakRotation || place > kWeakPosition)
        estimate.findings.push_back(
            {Severity::Warning,
             "calibration-weak",
             fmt::format("focal length ± {:.1f} %, rotation ± {:.2f}°, position ± {:.1f} % of the "
                         "distance: mark longer edges, and more of them",
                         kPercent * focal,
                         glm::degrees(estimate.rotation_sigma_rad),
                         kPercent * place)});
    estimate.findings.push_back({Severity::Info,
                                 "principal-point-assumed",
                                 fmt::format("the optical axis is taken to meet the picture's "
                                             "middle ({:.1f}, {:.1f}) px; untrue for cropped or "
                                             "shifted pictures",
                                             estimate.camera.principal_px.x,
                                             estimate.camera.principal_px.y)});
}

std::array<std::optional<glm::dvec2>, 3> vanishingPoints(const LineSet& lines,
                                                         const Camera& camera,
                                                         const SignedAxes& axes)
{
    constexpr double kInfinityPx = 1e6;
    std::array<std::optional<glm::dvec2>, 3> points;
    const glm::dvec3 directions[] = {axes.x, axes.y, axes.z};
    for (const LineSegment& segment : lines.segments) {
        const glm::dvec3 d = directions[static_cast<int>(segment.axis)];
        const glm::dvec2 finite = glm::dvec2(d) * camera.focal_px;
        if (glm::length(finite) < kInfinityPx * std::abs(d.z))
            points[static_cast<std::size_t>(segment.axis)] = finite / d.z + camera.principal_px;
    }
    return points;
}

}  // namespace

CameraEstimate calibrateCamera(const LineSet& marked,
                               const CalibrationOptions& options,
                               const std::string& source)
{
    checkOptions(options);
    marked.check(source);
    const LineSet lines = straightened(marked, source);
    checkAxes(lines, source);
    const glm::dvec2 principal_px = glm::dvec2(lines.width, lines.height) * 0.5;

    FocalChoice choice = chooseFocal(lines, principal_px, options, source);
    const OrientationEstimate& orientation = choice.solution.orientation;
    checkResiduals(lines, orientation, options, source);
    if (!(orientation.rotationSigma() < kRotationOpen))
        throw NoAnswerError(source,
                            "segments",
                            "the lines leave the camera's rotation open; mark more edges along at "
                            "least two directions");

    CameraEstimate estimate;
    estimate.findings = std::move(choice.findings);
    const glm::dvec3 origin_ray((lines.origin_px - principal_px) / orientation.focal_px, 1.0);
    const SignedAxes axes =
        orient(orientation.camera_from_world, origin_ray, source, estimate.findings);
    estimate.camera = cameraFrom(lines, principal_px, orientation.focal_px, axes);
    CameraPlace place =
        placeCamera(lines, estimate.camera, orientation, choice.solution.sigma_px, source);
    estimate.camera.position_m = place.position_m;
    estimate.position_sigma_m = place.position_sigma_m;
    estimate.focal_sigma_px = orientation.focal_px * orientation.focalSigma();
    estimate.rotation_sigma_rad = orientation.rotationSigma();
    double sum = 0.0;
    for (const double distance : orientation.distances_px)
        sum += distance * distance;
    estimate.residual_rms_px =
        std::sqrt(sum / static_cast<double>(orientation.distances_px.size()));
    estimate.vanishing_points_px = vanishingPoints(lines, estimate.camera, axes);
    estimate.camera.division = marked.distortion.division;
    append(estimate.findings, std::move(place.findings));
    reportDoubts(lines, choice.solution, estimate);
    return estimate;
}

}  // namespace insitu
