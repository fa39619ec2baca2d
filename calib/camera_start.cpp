#include "calib/camera_start.h"

#include "calib/camera_constraints.h"
#include "calib/lens_distortion.h"
#include "calib/vanishing_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu::calibration {

namespace {

/// Component of x to the right in the picture below which its sign is luck.
constexpr double kSignMargin = 0.03;
/// A principal point of this wide a prior (share of the long side) is looked for from the start.
constexpr double kWidePrincipal = 0.03;

glm::dvec2 toGlm(const Eigen::Vector2d& v)
{
    return {v.x(), v.y()};
}

/// λ from lines traced by more than their ends, each straight whatever its direction.
double tracedDivision(const LineSet& lines, Choice choice, const State& state)
{
    if (!choice.division_sigma) return state.division;
    choice.used_segments.assign(lines.segments.size(), true);
    choice.length_sigmas_m.assign(lines.lengths.size(), 0.0);
    Posed posed = pose(lines, choice);
    posed.problem.free.fill(false);
    posed.problem.free[kDivision] = true;
    for (Constraint& constraint : posed.problem.constraints)
        constraint.used = constraint.kind == Kind::StraightLine ||
                          (constraint.kind == Kind::Number && constraint.index == kDivision);
    const auto solution = solve(posed.problem, state);
    return solution ? solution->state.division : state.division;
}

/// Where the altitudes of the triangle of three finite vanishing points meet: [CapTor90].
std::optional<glm::dvec2> orthocentre(const LineSet& straight, glm::dvec2 principal_px)
{
    glm::dvec2 corner[3];
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<LineSegment> own;
        for (const LineSegment& segment : straight.segments)
            if (static_cast<int>(segment.axis) == axis) own.push_back(segment);
        const auto point =
            vanishingPoint(own, principal_px, std::max(straight.width, straight.height));
        const auto seen = point ? point->inPicture(principal_px) : std::nullopt;
        if (!seen) return std::nullopt;
        corner[axis] = *seen;
    }
    const glm::dvec2 first = corner[0] - corner[1];
    const glm::dvec2 second = corner[0] - corner[2];
    const double area = first.x * second.y - first.y * second.x;
    if (area == 0.0) return std::nullopt;
    const double a = glm::dot(first, corner[2]);
    const double b = glm::dot(second, corner[1]);
    return glm::dvec2(a * second.y - b * first.y, b * first.x - a * second.x) / area;
}

struct Oriented {
    Orientation orientation;
    glm::dvec2 principal_px{0.0};
};

std::optional<Oriented> bestOrientation(const LineSet& lines,
                                        const Choice& choice,
                                        double division,
                                        const std::string& source)
{
    std::vector<glm::dvec2> candidates{toGlm(choice.principal_px)};
    const double long_side = std::max(lines.width, lines.height);
    if (choice.principal_sigma_px > kWidePrincipal * long_side)
        if (const auto point = orthocentre(
                straightened(lines, candidates.front(), division, source), candidates.front()))
            candidates.push_back(*point);
    std::optional<Oriented> best;
    for (const glm::dvec2 principal_px : candidates) {
        const LineSet straight = straightened(lines, principal_px, division, source);
        auto found = findOrientation(straight, principal_px, choice.sigma_px, choice.focal);
        if (!found) continue;
        if (choice.principal_sigma_px > 0.0) {
            const glm::dvec2 off = (principal_px - candidates.front()) / choice.principal_sigma_px;
            found->loss += glm::dot(off, off) / 9.0;
        }
        if (!best || found->loss < best->orientation.loss) best = Oriented{*found, principal_px};
    }
    return best;
}

Eigen::Vector3d columnOf(const glm::dmat3& m, int column)
{
    return {m[column].x, m[column].y, m[column].z};
}

/// Signs of the room's axes. Up is up in the picture. Only a camera that looks nearly straight up
/// or down has no such direction: there the origin, a floor point in front of the camera, decides.
void orient(const glm::dmat3& axes, const Eigen::Vector3d& origin_ray, Start& start)
{
    Eigen::Vector3d up = columnOf(axes, 1);
    const bool steep = std::abs(up.z()) > 0.99;
    if (!steep && std::abs(up.x()) > std::sqrt(3.0) * std::abs(up.y())) {
        start.place = "segments";
        start.complaint =
            "up would point sideways in the picture: the y segments run horizontally, or x and z "
            "are not the horizontal directions; check the axes, and that the photograph is upright";
    }
    if (steep ? up.dot(origin_ray) > 0.0 : up.y() > 0.0) up = -up;
    Eigen::Vector3d right = columnOf(axes, 0);
    if (right.x() < 0.0) right = -right;
    start.x_ambiguous = right.x() < kSignMargin;
    start.state.camera_from_world.col(0) = right;
    start.state.camera_from_world.col(1) = up;
    start.state.camera_from_world.col(2) = right.cross(up);
}

/// Camera height: given, or the median of what the known lengths say.
std::optional<double> heightAtStart(const LineSet& lines, Start& start)
{
    if (lines.camera_height_m) return lines.camera_height_m;
    State unit = start.state;
    unit.position_m = Eigen::Vector3d::UnitY();
    std::vector<double> heights;
    for (std::size_t i = 0; i < lines.lengths.size(); ++i) {
        const auto per_height = measuredLength(lines, lines.lengths[i], unit);
        if (per_height && *per_height > 0.0) {
            heights.push_back(lines.lengths[i].metres / *per_height);
            continue;
        }
        start.place = fmt::format("scale.lengths[{}]", i);
        start.complaint =
            "does not lie on the floor or straight above a floor point as seen from this camera; "
            "check its ends";
        return std::nullopt;
    }
    if (heights.empty()) {
        start.place = "scale";
        start.complaint = "no scale: give the camera's height or a known length";
        return std::nullopt;
    }
    std::nth_element(heights.begin(), heights.begin() + heights.size() / 2, heights.end());
    return heights[heights.size() / 2];
}

void placeAtStart(const LineSet& lines, Start& start)
{
    const double origin[2] = {lines.origin_px.x, lines.origin_px.y};
    Vec3<double> on_floor;
    if (!onFloor(viewAt(lines, start.state), origin, on_floor)) {
        start.place = "origin_px";
        start.complaint = fmt::format(
            "({:.1f}, {:.1f}) lies on or above the horizon, so no floor "
            "point is seen there; mark a point on the floor",
            lines.origin_px.x,
            lines.origin_px.y);
        return;
    }
    if (const auto height = heightAtStart(lines, start))
        start.state.position_m = -*height * on_floor;
}

}  // namespace

std::optional<Start> findStart(const LineSet& lines,
                               const Choice& choice,
                               const std::string& source)
{
    Start start;
    start.state.principal_px = choice.principal_px;
    start.state.log_focal = std::log(static_cast<double>(std::max(lines.width, lines.height)));
    start.state.division = lines.distortion.division;
    start.state.division = tracedDivision(lines, choice, start.state);
    const auto found = bestOrientation(lines, choice, start.state.division, source);
    if (!found) return std::nullopt;
    start.state.principal_px = {found->principal_px.x, found->principal_px.y};
    start.state.log_focal = std::log(found->orientation.focal_px);
    State camera = start.state;
    camera.camera_from_world.setIdentity();
    const double origin[2] = {lines.origin_px.x, lines.origin_px.y};
    orient(found->orientation.camera_from_world, viewAt(lines, camera).ray(origin), start);
    if (start.complaint.empty()) placeAtStart(lines, start);
    return start;
}

}  // namespace insitu::calibration
