#include "calib/camera_solve.h"

#include "calib/camera_errors.h"
#include "calib/camera_findings.h"
#include "calib/camera_fit.h"
#include "calib/camera_lines.h"
#include "calib/camera_start.h"
#include "core/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

using calibration::Choice;
using calibration::Fit;
using calibration::kPercent;
using calibration::Matrix;
using calibration::Start;

/// σ of ln f from which on the lines leave the focal length open.
constexpr double kFocalOpen = 0.2;
/// σ of the rotation, radians, from which on there is no camera.
constexpr double kRotationOpen = 0.2;
/// Lines have heavier tails than their linearised deviation: one draw in 200 on truth room a passed
/// 3 σ and lost the better EXIF value. A crop or a wrong 35 mm value is off by far more.
constexpr double kDisagreementSigmas = 4.0;
/// Residuals beyond both are no lines of one direction: multiples of σ, share of the diagonal.
constexpr double kMaxResidualSigmas = 8.0;
constexpr double kMaxResidualShare = 0.01;
/// Prior of a lens about which nothing is said: all that the model is for.
constexpr double kDivisionSigma = 0.15;
/// A lens shows in straight segments from this many standard deviations and equations left on.
constexpr double kDivisionTold = 4.0;
constexpr double kDivisionFreedom = 8.0;

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
    if (!lines.camera_height_m && lines.lengths.empty())
        throw NoAnswerError(
            source, "scale", "no scale: give the camera's height or a known length");
}

bool tracedLines(const LineSet& lines)
{
    return !lines.straight_lines.empty() ||
           std::any_of(lines.segments.begin(), lines.segments.end(), [](const auto& segment) {
               return !segment.via_px.empty();
           });
}

Choice choiceOf(const LineSet& lines, const CalibrationOptions& options)
{
    Choice choice;
    choice.sigma_px = options.segment_sigma_px;
    choice.principal_px = {0.5 * lines.width, 0.5 * lines.height};
    choice.principal_sigma_px = options.principal_sigma * std::max(lines.width, lines.height);
    if (lines.principal_point) {
        choice.principal_px = {lines.principal_point->px.x, lines.principal_point->px.y};
        choice.principal_sigma_px = lines.principal_point->sigma_px;
    }
    if (lines.distortion.sigma > 0.0)
        choice.division_sigma = lines.distortion.sigma;
    else if (lines.distortion.division == 0.0 && tracedLines(lines))
        choice.division_sigma = kDivisionSigma;
    return choice;
}

/// A solve and what led to it.
struct Solved {
    Start start;
    std::optional<Fit> fit;  ///< nothing when there is a complaint or no solve converges

    [[nodiscard]] double focal() const { return std::exp(fit->solution.state.log_focal); }
    [[nodiscard]] double focalSigma() const
    {
        const Matrix covariance = fit->covariance();
        return std::sqrt(covariance(calibration::kLogFocal, calibration::kLogFocal));
    }
    [[nodiscard]] bool focalAtLimit(const LineSet& lines) const
    {
        const double relative = focal() / std::max(lines.width, lines.height);
        return relative < 1.02 * kShortestFocal || relative > 0.98 * kLongestFocal;
    }
    [[nodiscard]] bool focalKnown(const LineSet& lines) const
    {
        return fit && !focalAtLimit(lines) && focalSigma() < kFocalOpen;
    }
};

/// The lens as given or traced, or as straight segments show it when they do so clearly.
Solved solveWith(const LineSet& lines, Choice choice, const std::string& source)
{
    const auto start = calibration::findStart(lines, choice, source);
    if (!start) return {};
    Solved solved{*start, std::nullopt};
    if (!start->complaint.empty()) return solved;
    solved.fit = calibration::fit(lines, start->state, choice);
    const bool asked = choice.division_sigma || lines.distortion.division != 0.0;
    if (!solved.fit || asked || solved.fit->freedom < kDivisionFreedom) return solved;
    if (calibration::divisionScore(*solved.fit) < kDivisionTold) return solved;
    choice.division_sigma = kDivisionSigma;
    auto bent = calibration::fit(lines, solved.fit->solution.state, choice);
    if (!bent) return solved;
    const double sigma =
        std::sqrt(bent->covariance()(calibration::kDivision, calibration::kDivision));
    if (std::abs(bent->solution.state.division) > kDivisionTold * sigma)
        solved.fit = std::move(bent);
    return solved;
}

Finding disagreement(const Solved& alone, const FocalPrior& exif)
{
    return {Severity::Warning,
            "focal-disagrees-with-exif",
            fmt::format("the lines say {:.1f} px ± {:.1f} % focal length, EXIF says {:.1f} px ± "
                        "{:.1f} % ({:+.1f} %); the lines alone are used. Cropped picture, or lines "
                        "that are not at right angles?",
                        alone.focal(),
                        kPercent * alone.focalSigma(),
                        exif.focal_px,
                        kPercent * exif.sigma,
                        kPercent * (alone.focal() / exif.focal_px - 1.0))};
}

/// Lines that do not meet in a direction at right angles to the others.
void checkResiduals(const LineSet& lines,
                    const Fit& fit,
                    const CalibrationOptions& options,
                    const std::string& source)
{
    const double limit = std::max(kMaxResidualSigmas * options.segment_sigma_px,
                                  kMaxResidualShare * std::hypot(lines.width, lines.height));
    for (int axis = 0; axis < 3; ++axis) {
        double sum = 0.0;
        int count = 0;
        for (std::size_t i = 0; i < lines.segments.size(); ++i) {
            if (static_cast<int>(lines.segments[i].axis) != axis || !fit.choice.used_segments[i])
                continue;
            const double distance = calibration::endDistance(lines, i, fit.solution.state);
            sum += distance * distance;
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

[[noreturn]] void failWithoutFocal(const LineSet& lines,
                                   const Solved& alone,
                                   const CalibrationOptions& options,
                                   const std::string& source)
{
    if (!alone.start.complaint.empty())
        throw NoAnswerError(source, alone.start.place, alone.start.complaint);
    if (alone.fit) checkResiduals(lines, *alone.fit, options, source);
    if (!alone.fit || alone.focalAtLimit(lines))
        throw NoAnswerError(source,
                            "segments",
                            "no real focal length fits these lines and there is none in EXIF; "
                            "check that each segment is marked with the right axis, or give the "
                            "focal length");
    throw NoAnswerError(source,
                        "segments",
                        "the lines leave the focal length open (one-point view or too few "
                        "segments) and there is none in EXIF; mark more edges along a second "
                        "receding direction, a rectangle of known ratio or a known length that "
                        "recedes, or give the focal length");
}

/// The lines alone, the lines with EXIF, and which of them is the answer.
Solved chooseFocal(const LineSet& lines,
                   const CalibrationOptions& options,
                   const std::string& source,
                   Findings& findings)
{
    Choice choice = choiceOf(lines, options);
    Solved alone = solveWith(lines, choice, source);
    const bool known = alone.focalKnown(lines);
    if (!options.exif_focal_px) {
        if (!known) failWithoutFocal(lines, alone, options, source);
        return alone;
    }
    const FocalPrior exif{*options.exif_focal_px, options.exif_focal_sigma};
    if (known) {
        const double off = std::abs(std::log(alone.focal() / exif.focal_px));
        const double expected = std::hypot(alone.focalSigma(), exif.sigma);
        const bool contradicts = off > kDisagreementSigmas * expected;
        if (contradicts) findings.push_back(disagreement(alone, exif));
        if (contradicts || !options.use_exif) return alone;
    }
    choice.focal = exif;
    Solved both = solveWith(lines, choice, source);
    if (!both.start.complaint.empty())
        throw NoAnswerError(source, both.start.place, both.start.complaint);
    if (!both.fit)
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
    return both;
}

Camera cameraFrom(const LineSet& lines, const calibration::State& state)
{
    const auto row = [&](int i) {
        const Eigen::RowVector3d r = state.camera_from_world.row(i);
        return glm::dvec3(r[0], r[1], r[2]);
    };
    Camera camera;
    camera.width = lines.width;
    camera.height = lines.height;
    camera.focal_px = glm::dvec2(std::exp(state.log_focal));
    camera.principal_px = {state.principal_px.x(), state.principal_px.y()};
    camera.position_m = {state.position_m.x(), state.position_m.y(), state.position_m.z()};
    camera.right = glm::normalize(row(0));
    camera.forward = glm::normalize(row(2) - glm::dvec3(0.0));
    camera.up = glm::cross(camera.right, camera.forward);
    camera.division = state.division;
    return camera;
}

std::array<std::optional<glm::dvec2>, 3> vanishingPoints(const LineSet& lines,
                                                         const calibration::State& state)
{
    constexpr double kInfinityPx = 1e6;
    std::array<std::optional<glm::dvec2>, 3> points;
    for (const LineSegment& segment : lines.segments) {
        const Eigen::Vector3d d = state.camera_from_world.col(static_cast<int>(segment.axis));
        const glm::dvec2 finite = glm::dvec2(d.x(), d.y()) * std::exp(state.log_focal);
        if (glm::length(finite) < kInfinityPx * std::abs(d.z()))
            points[static_cast<std::size_t>(segment.axis)] =
                finite / d.z() + glm::dvec2(state.principal_px.x(), state.principal_px.y());
    }
    return points;
}

CameraCovariance statedCovariance(const Fit& fit)
{
    const Matrix covariance = fit.covariance();
    CameraCovariance result;
    for (int row = 0; row < calibration::kUnknowns; ++row)
        for (int column = 0; column < calibration::kUnknowns; ++column)
            result[row][column] = covariance(row, column);
    return result;
}

}  // namespace

Findings CalibrationOptions::validate() const
{
    Findings problems;
    const auto require = [&](bool holds, const std::string& message) {
        if (!holds) problems.push_back({Severity::Error, "calibration-options", message});
    };
    require(segment_sigma_px > 0.0 && std::isfinite(segment_sigma_px),
            fmt::format("segment_sigma_px must be above 0, is {}", segment_sigma_px));
    require(exif_focal_sigma > 0.0 && std::isfinite(exif_focal_sigma),
            fmt::format("exif_focal_sigma must be above 0, is {}", exif_focal_sigma));
    require(!exif_focal_px || (*exif_focal_px > 0.0 && std::isfinite(*exif_focal_px)),
            "exif_focal_px must be above 0");
    require(principal_sigma >= 0.0 && principal_sigma <= 1.0,
            fmt::format("principal_sigma must lie in [0, 1], is {}", principal_sigma));
    return problems;
}

CameraEstimate calibration::calibrateLines(const LineSet& marked,
                                           const CalibrationOptions& options,
                                           const std::string& source)
{
    marked.check(source);
    checkAxes(marked, source);
    CameraEstimate estimate;
    const Solved solved = chooseFocal(marked, options, source, estimate.findings);
    const Fit& fit = *solved.fit;
    checkResiduals(marked, fit, options, source);
    estimate.camera = cameraFrom(marked, fit.solution.state);
    setCovariance(statedCovariance(fit), estimate);
    if (!(estimate.rotation_sigma_rad < kRotationOpen))
        throw NoAnswerError(source,
                            "segments",
                            "the lines leave the camera's rotation open; mark more edges along at "
                            "least two directions");
    if (solved.start.x_ambiguous)
        estimate.findings.push_back(
            {Severity::Warning,
             "axis-sign-ambiguous",
             "the x direction runs almost along the view, so that its \"right\" hangs on a hair; "
             "exchange x and z"});
    double sum = 0.0;
    double used = 0.0;
    for (std::size_t i = 0; i < marked.segments.size(); ++i) {
        if (!fit.choice.used_segments[i]) continue;
        const double distance = calibration::endDistance(marked, i, fit.solution.state);
        sum += distance * distance;
        used += 1.0;
    }
    estimate.residual_rms_px = std::sqrt(sum / used);
    estimate.vanishing_points_px = vanishingPoints(marked, fit.solution.state);
    estimate.outlier_segments = fit.outliers;
    append(estimate.findings, calibration::describeFit(marked, fit, options, estimate));
    return estimate;
}

}  // namespace insitu
