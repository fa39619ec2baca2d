#include "calib/calibration_overlay.h"

#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu {

namespace {

constexpr float kDimmed = 0.75f;
constexpr glm::vec3 kYellow{1.0f, 0.85f, 0.1f};
constexpr glm::vec3 kWhite{1.0f};
constexpr glm::vec3 kOrange{1.0f, 0.6f, 0.2f};
constexpr glm::vec3 kGrid{0.75f, 0.9f, 1.0f};
constexpr double kAxisLength = 0.5;
/// Ellipses reach so many fields from the origin: where things are put.
constexpr int kDoubtReach = 6;

void drawHorizon(EncodedImage& picture, const Camera& camera, double width)
{
    std::vector<glm::dvec2> points;
    glm::dvec3 ahead = camera.forward;
    ahead.y = 0.0;
    if (glm::length(ahead) < 1e-6) return;
    ahead = glm::normalize(ahead);
    const glm::dvec3 aside = glm::cross(ahead, glm::dvec3(0.0, 1.0, 0.0));
    for (int degrees = -89; degrees <= 89; ++degrees) {
        const double angle = glm::radians(static_cast<double>(degrees));
        const auto p =
            camera.project(camera.position_m + ahead * std::cos(angle) + aside * std::sin(angle));
        if (p) points.push_back(*p);
    }
    drawPolyline(picture, points, {kYellow, width, 0.9});
}

double gridStep(const Camera& camera, const OverlayOptions& options)
{
    if (options.grid_step_m) return *options.grid_step_m;
    // Steps of 0.5, 1, 2, 5 … metres: about a quarter of the distance to the origin at most.
    const double wanted = 0.15 * glm::length(camera.position_m);
    const double steps[] = {0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0};
    for (const double step : steps)
        if (step >= wanted) return step;
    return steps[std::size(steps) - 1];
}

void drawGrid(EncodedImage& picture,
              const Camera& camera,
              double step,
              const OverlayOptions& options,
              double width)
{
    const double reach = step * options.grid_reach;
    for (int i = -options.grid_reach; i <= options.grid_reach; ++i) {
        const Ink ink{kGrid, (i == 0 ? 1.0 : 0.7) * width, i == 0 ? 0.8 : 0.55};
        drawWorldLine(picture, camera, {i * step, 0, -reach}, {i * step, 0, reach}, ink);
        drawWorldLine(picture, camera, {-reach, 0, i * step}, {reach, 0, i * step}, ink);
    }
}

/// Ellipses on the floor: along the line of sight and across it.
void drawDoubts(EncodedImage& picture,
                const CameraEstimate& estimate,
                double step,
                const OverlayOptions& options,
                double width)
{
    constexpr int kPoints = 48;
    const Camera& camera = estimate.camera;
    const int reach = std::min(options.grid_reach, kDoubtReach);
    for (int i = -reach; i <= reach; i += 2)
        for (int k = -reach; k <= reach; k += 2) {
            const glm::dvec3 point(i * step, 0.0, k * step);
            const auto sigma = placementSigma(estimate, point);
            glm::dvec3 along = point - camera.position_m;
            along.y = 0.0;
            if (!sigma || glm::length(along) < 1e-9) continue;
            along = glm::normalize(along);
            const glm::dvec3 across = glm::cross(along, glm::dvec3(0.0, 1.0, 0.0));
            std::vector<glm::dvec2> outline;
            for (int n = 0; n <= kPoints; ++n) {
                const double turn = glm::two_pi<double>() * n / kPoints;
                const auto p = camera.project(
                    point + options.ellipse_sigmas * (along * (sigma->along_m * std::cos(turn)) +
                                                      across * (sigma->across_m * std::sin(turn))));
                if (!p) break;
                outline.push_back(*p);
            }
            if (outline.size() == kPoints + 1)
                drawPolyline(picture, outline, {kOrange, 0.8 * width, 0.9});
        }
}

void drawAxes(EncodedImage& picture, const Camera& camera, double width)
{
    const auto origin = camera.project(glm::dvec3(0.0));
    if (!origin) return;
    for (const RoomAxis axis : {RoomAxis::X, RoomAxis::Y, RoomAxis::Z}) {
        glm::dvec3 end(0.0);
        end[static_cast<int>(axis)] = kAxisLength;
        const Ink ink{axisColor(axis), 2.0 * width, 1.0};
        drawWorldLine(picture, camera, glm::dvec3(0.0), end, ink);
        if (const auto p = camera.project(end))
            drawLabel(picture, *p + glm::dvec2(3.0 * width), axisName(axis), 8.0 * width, ink);
    }
    drawDot(picture, *origin, 2.0 * width, {kWhite, width, 1.0});
}

/// Where straight pixels of a segment's axis meet, as a homogeneous centred vector.
glm::dvec3 vanishingVector(const Camera& camera, RoomAxis axis)
{
    const int k = static_cast<int>(axis);
    return {
        camera.focal_px.x * camera.right[k], -camera.focal_px.y * camera.up[k], camera.forward[k]};
}

/// Distance across of a segment's ends from the line through its middle and its vanishing point.
double residual(const Camera& camera, const LineSegment& segment)
{
    const glm::dvec2 from = camera.straightened(segment.from_px) - camera.principal_px;
    const glm::dvec2 to = camera.straightened(segment.to_px) - camera.principal_px;
    const glm::dvec3 v = vanishingVector(camera, segment.axis);
    const glm::dvec2 half = 0.5 * (to - from);
    const glm::dvec2 toward = glm::dvec2(v) - 0.5 * (from + to) * v.z;
    const double norm = glm::length(toward);
    return norm > 0.0 ? (toward.x * half.y - toward.y * half.x) / norm *
                            (glm::dot(toward, half) < 0.0 ? -1.0 : 1.0)
                      : 0.0;
}

void drawSegments(EncodedImage& picture,
                  const Camera& camera,
                  const std::vector<LineSegment>& lines,
                  double exaggeration,
                  double width)
{
    for (const LineSegment& segment : lines) {
        const Ink ink{axisColor(segment.axis), width, 0.9};
        drawLine(picture, segment.from_px, segment.to_px, ink);
        const glm::dvec2 along = glm::normalize(segment.to_px - segment.from_px);
        const glm::dvec2 across(-along.y, along.x);
        const double off = residual(camera, segment) * exaggeration;
        const Ink whisker{kWhite, 0.7 * width, 0.9};
        drawLine(picture, segment.to_px, segment.to_px + across * off, whisker);
        drawLine(picture, segment.from_px, segment.from_px - across * off, whisker);
    }
}

void drawFigures(EncodedImage& picture,
                 const CameraEstimate& estimate,
                 double step,
                 double exaggeration,
                 double width)
{
    const Camera& camera = estimate.camera;
    const std::string text = fmt::format(
        "f {:.1f} +- {:.1f} px  rotation +- {:.2f} deg  height {:.2f} m  residual {:.2f} px "
        "(whiskers x{:g})  grid {:g} m",
        camera.focal_px.x,
        estimate.focal_sigma_px,
        glm::degrees(estimate.rotation_sigma_rad),
        camera.position_m.y,
        estimate.residual_rms_px,
        exaggeration,
        step);
    const double high = 6.0 * width;
    const glm::dvec2 at(1.5 * high, 2.5 * high);
    drawLabel(picture, at + glm::dvec2(0.15 * high), text, high, {glm::vec3(0.0f), width, 0.8});
    drawLabel(picture, at, text, high, {kWhite, 0.7 * width, 1.0});
}

}  // namespace

Findings OverlayOptions::validate() const
{
    Findings problems;
    const auto check = [&](bool good, const std::string& message) {
        if (!good) problems.push_back({Severity::Error, "overlay-options", message});
    };
    check(!grid_step_m || (std::isfinite(*grid_step_m) && *grid_step_m > 0.0),
          "grid_step_m must be positive");
    check(grid_reach > 0 && grid_reach <= 1000, "grid_reach must lie between 1 and 1000");
    check(std::isfinite(exaggeration) && exaggeration > 0.0, "exaggeration must be positive");
    check(std::isfinite(ellipse_sigmas) && ellipse_sigmas > 0.0, "ellipse_sigmas must be positive");
    return problems;
}

glm::vec3 axisColor(RoomAxis axis)
{
    switch (axis) {
        case RoomAxis::X:
            return {1.0f, 0.25f, 0.2f};
        case RoomAxis::Y:
            return {0.3f, 0.95f, 0.3f};
        case RoomAxis::Z:
            return {0.35f, 0.55f, 1.0f};
    }
    return kWhite;
}

double lineWidth(const EncodedImage& picture)
{
    const double long_side = std::max(picture.codes.width(), picture.codes.height());
    return std::max(1.0, 1.5 * long_side / 1000.0);
}

EncodedImage drawCalibration(const EncodedImage& photo,
                             const CameraEstimate& estimate,
                             const std::vector<LineSegment>& lines,
                             const OverlayOptions& options)
{
    requireValid(options.validate(), "overlay options");
    const Camera& camera = estimate.camera;
    if (camera.width != photo.codes.width() || camera.height != photo.codes.height())
        throw InputError("overlay",
                         fmt::format("the camera is for {}x{}, the photograph has {}x{} pixels",
                                     camera.width,
                                     camera.height,
                                     photo.codes.width(),
                                     photo.codes.height()));
    EncodedImage picture = photo;
    for (glm::u16vec3& code : picture.codes.pixels())
        code = glm::u16vec3(glm::vec3(code) * kDimmed + 0.5f);
    const double width = lineWidth(photo);
    const double step = gridStep(camera, options);
    drawGrid(picture, camera, step, options, width);
    drawDoubts(picture, estimate, step, options, width);
    drawHorizon(picture, camera, width);
    drawSegments(picture, camera, lines, options.exaggeration, width);
    drawAxes(picture, camera, width);
    drawFigures(picture, estimate, step, options.exaggeration, width);
    return picture;
}

}  // namespace insitu
