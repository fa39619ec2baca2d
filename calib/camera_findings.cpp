#include "calib/camera_findings.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu::calibration {

namespace {

constexpr double kWeakFocal = 0.05;
constexpr double kWeakRotation = glm::radians(1.0);
constexpr double kWeakPosition = 0.05;
/// The picture tells an unknown when it halves the prior's standard deviation.
constexpr double kTold = 0.5;
/// A distortion whose sensitivity is told when it is assumed.
constexpr double kExampleDivision = 0.05;

int axesMarked(const LineSet& lines)
{
    bool marked[3] = {};
    for (const LineSegment& segment : lines.segments)
        marked[static_cast<int>(segment.axis)] = true;
    return static_cast<int>(std::count(marked, marked + 3, true));
}

/// Share by which the focal length follows when an unknown moves by `change`.
double focalEffect(const Fit& fit, int unknown, double change)
{
    return followers(fit.solution.information, fit.free, unknown)[kLogFocal] * change;
}

Finding principalPoint(const LineSet& lines, const Fit& fit, const CameraEstimate& estimate)
{
    const glm::dvec2 at = estimate.camera.principal_px;
    const double prior = fit.choice.principal_sigma_px;
    const glm::dvec2 sigma = estimate.principal_sigma_px;
    if (prior > 0.0 && std::max(sigma.x, sigma.y) < kTold * prior)
        return {Severity::Info,
                "principal-point-estimated",
                fmt::format("the lines tell the principal point: ({:.1f} ± {:.1f}, {:.1f} ± "
                            "{:.1f}) px",
                            at.x,
                            sigma.x,
                            at.y,
                            sigma.y)};
    const double step = prior > 0.0 ? prior : 0.01 * std::max(lines.width, lines.height);
    const double effect =
        std::hypot(focalEffect(fit, kPrincipal, step), focalEffect(fit, kPrincipal + 1, step));
    return {Severity::Info,
            "principal-point-assumed",
            fmt::format("principal point not observable: {}; assumed near ({:.1f}, {:.1f}) px, ± "
                        "{:.0f} px would change the focal length by {:.2f} %{}. Untrue for cropped "
                        "or shifted pictures",
                        axesMarked(lines) < 3 ? "two vanishing points only"
                                              : "the third vanishing point does not fix it",
                        fit.choice.principal_px.x(),
                        fit.choice.principal_px.y(),
                        step,
                        kPercent * effect,
                        prior > 0.0 ? ", which is part of the standard deviations" : "")};
}

Finding distortion(const Fit& fit, const CameraEstimate& estimate)
{
    if (fit.free[kDivision])
        return {Severity::Info,
                "distortion-estimated",
                fmt::format("the lens bends lines: division {:+.4f} ± {:.4f} ({:+.1f} % in the "
                            "corners)",
                            estimate.camera.division,
                            estimate.division_sigma,
                            kPercent * estimate.camera.division)};
    return {Severity::Info,
            "distortion-assumed",
            fmt::format("lens distortion is taken as {}; a division of ± {} more would change the "
                        "focal length by {:.2f} %. Lines traced by more than their ends tell it",
                        fit.solution.state.division,
                        kExampleDivision,
                        std::abs(kPercent * focalEffect(fit, kDivision, kExampleDivision)))};
}

Findings outliers(const LineSet& lines, const Fit& fit)
{
    Findings findings;
    for (const std::size_t i : fit.outliers)
        findings.push_back(
            {Severity::Warning,
             "segment-outlier",
             fmt::format("segments[{}] does not run along {} (its ends are off by {:.1f} px, the "
                         "error of a mark is {:.1f} px); it is left out. Another direction?",
                         i,
                         axisName(lines.segments[i].axis),
                         endDistance(lines, i, fit.solution.state),
                         fit.choice.sigma_px)});
    return findings;
}

Finding inconsistent(const LineSet& lines,
                     const Fit& fit,
                     const CalibrationOptions& options,
                     const CameraEstimate& estimate)
{
    std::size_t worst = 0;
    double largest = -1.0;
    for (std::size_t i = 0; i < lines.segments.size(); ++i) {
        const double distance = endDistance(lines, i, fit.solution.state);
        if (!fit.choice.used_segments[i] || distance <= largest) continue;
        worst = i;
        largest = distance;
    }
    return {Severity::Warning,
            "segments-inconsistent",
            fmt::format("the segments miss their vanishing points by {:.1f} px rms, as if their "
                        "ends had an error of {:.1f} px instead of {:.1f} px, which is assumed "
                        "now; the worst is segments[{}] ({}) with {:.1f} px",
                        estimate.residual_rms_px,
                        fit.choice.sigma_px,
                        options.segment_sigma_px,
                        worst,
                        axisName(lines.segments[worst].axis),
                        largest)};
}

Findings knownLengths(const LineSet& lines, const Fit& fit)
{
    Findings findings;
    for (std::size_t i = 0; i < lines.lengths.size(); ++i) {
        const KnownLength& length = lines.lengths[i];
        const double off = fit.lengths_off[i];
        const bool contradicts =
            std::count(fit.contradicting_lengths.begin(), fit.contradicting_lengths.end(), i) > 0;
        findings.push_back(
            {contradicts ? Severity::Warning : Severity::Info,
             contradicts ? "scale-disagrees" : "known-length",
             fmt::format("known length {} is given as {:.3f} m and comes out {:+.1f} cm ({:+.1f} "
                         "%) with the camera {:.3f} m above the floor{}",
                         i,
                         length.metres,
                         kPercent * off * length.metres,
                         kPercent * off,
                         fit.solution.state.position_m[1],
                         contradicts ? "; it contradicts the rest and is not used: check its ends "
                                       "and its number"
                                     : "")});
    }
    return findings;
}

/// What marking more would mend: as if the principal point were known.
std::optional<Finding> weakness(const Fit& fit, const CameraEstimate& estimate)
{
    std::array<bool, kUnknowns> free = fit.free;
    free[kPrincipal] = free[kPrincipal + 1] = false;
    const Matrix covariance = covarianceOf(fit.solution.information, free);
    const double focal = std::sqrt(covariance(kLogFocal, kLogFocal));
    const double rotation = std::sqrt(covariance.diagonal().head<3>().sum());
    const double place = std::sqrt(covariance.diagonal().segment<3>(kPosition).sum()) /
                         glm::length(estimate.camera.position_m);
    if (focal < kWeakFocal && rotation < kWeakRotation && place < kWeakPosition)
        return std::nullopt;
    return Finding{Severity::Warning,
                   "calibration-weak",
                   fmt::format("focal length ± {:.1f} %, rotation ± {:.2f}°, position ± {:.1f} % "
                               "of the distance: mark longer edges, and more of them",
                               kPercent * focal,
                               glm::degrees(rotation),
                               kPercent * place)};
}

}  // namespace

Findings describeFit(const LineSet& lines,
                     const Fit& fit,
                     const CalibrationOptions& options,
                     const CameraEstimate& estimate)
{
    Findings findings = outliers(lines, fit);
    if (fit.inconsistent) findings.push_back(inconsistent(lines, fit, options, estimate));
    append(findings, knownLengths(lines, fit));
    if (const auto weak = weakness(fit, estimate)) findings.push_back(*weak);
    findings.push_back(principalPoint(lines, fit, estimate));
    findings.push_back(distortion(fit, estimate));
    return findings;
}

}  // namespace insitu::calibration
