#include "calib/room_views.h"

#include "calib/views_bundle.h"
#include "core/check.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace insitu {

namespace {

/// Rays to one point that pass each other by more than this share of its distance are of different
/// points, or the view is turned the wrong way.
constexpr double kWorstMiss = 0.15;
constexpr double kConsistencyQuantile = 3.09;

Camera turned(const Camera& camera, int quarters)
{
    Camera result = camera;
    for (int i = 0; i < quarters; ++i)
        for (glm::dvec3* v : {&result.position_m, &result.right, &result.up, &result.forward})
            *v = glm::dvec3(v->z, v->y, -v->x);
    return result;
}

std::optional<glm::dvec3> floorPoint(const Camera& camera, glm::dvec2 pixel)
{
    const glm::dvec3 ray = camera.rayDirection(pixel);
    if (!(ray.y < -1e-3)) return std::nullopt;
    return camera.position_m - ray * (camera.position_m.y / ray.y);
}

struct Meeting {
    glm::dvec3 point{0.0};
    double miss = 0.0;  ///< of the two rays, share of the distance
};

/// Where two rays come nearest to each other; nothing for parallel ones.
std::optional<Meeting> meet(const Camera& a, glm::dvec2 at_a, const Camera& b, glm::dvec2 at_b)
{
    const glm::dvec3 u = a.rayDirection(at_a);
    const glm::dvec3 v = b.rayDirection(at_b);
    const glm::dvec3 w = b.position_m - a.position_m;
    const double c = glm::dot(u, v);
    const double d = 1.0 - c * c;
    if (d < 1e-6) return std::nullopt;
    const double s = (glm::dot(w, u) - c * glm::dot(w, v)) / d;
    const double t = (c * glm::dot(w, u) - glm::dot(w, v)) / d;
    const glm::dvec3 on_a = a.position_m + u * s;
    const glm::dvec3 on_b = b.position_m + v * t;
    if (s <= 0.0 || t <= 0.0) return Meeting{on_a, 1.0};
    return Meeting{0.5 * (on_a + on_b), glm::length(on_a - on_b) / s};
}

/// The view's camera in the world of those placed before it, for one quarter turn, and how badly
/// the shared points fit (mean miss as a share of their distance).
struct Placing {
    Camera camera;
    int quarters = 0;
    double miss = std::numeric_limits<double>::max();
};

Placing place(const RoomViews& room,
              std::size_t view,
              const Camera& own,
              const std::vector<Camera>& placed,
              int quarters)
{
    Placing result{turned(own, quarters), quarters, std::numeric_limits<double>::max()};
    glm::dvec3 shift(0.0);
    int floors = 0;
    for (const SharedPoint& point : room.points) {
        const auto here = point.seen_px.find(view);
        if (!point.on_floor || here == point.seen_px.end()) continue;
        const auto own_place = floorPoint(result.camera, here->second);
        for (const auto& [other, pixel] : point.seen_px) {
            if (other >= placed.size() || !own_place) continue;
            if (const auto there = floorPoint(placed[other], pixel)) {
                shift += *there - *own_place;
                ++floors;
            }
        }
    }
    if (floors == 0) return result;
    result.camera.position_m += shift / static_cast<double>(floors);
    double sum = 0.0;
    int count = 0;
    for (const SharedPoint& point : room.points) {
        const auto here = point.seen_px.find(view);
        if (here == point.seen_px.end()) continue;
        for (const auto& [other, pixel] : point.seen_px) {
            if (other >= placed.size()) continue;
            if (const auto met = meet(placed[other], pixel, result.camera, here->second)) {
                sum += std::min(1.0, met->miss);
                ++count;
            }
        }
    }
    if (count >= 2) result.miss = sum / count;
    return result;
}

/// Start of every camera in the first one's world.
bundle::State startingCameras(const RoomViews& room,
                              const std::vector<CameraEstimate>& alone,
                              const std::string& source)
{
    bundle::State state;
    state.cameras = {alone[0].camera};
    state.quarters = {0};
    for (std::size_t view = 1; view < room.views.size(); ++view) {
        Placing best;
        for (int quarters = 0; quarters < 4; ++quarters) {
            const Placing one = place(room, view, alone[view].camera, state.cameras, quarters);
            if (one.miss < best.miss) best = one;
        }
        if (!(best.miss < kWorstMiss))
            throw NoAnswerError(
                source,
                fmt::format("views[{}]", view),
                fmt::format("\"{}\" cannot be joined to the views before it: at least two shared "
                            "points that fit are needed, one of them on the floor{}",
                            room.views[view].name,
                            best.miss < 1e300
                                ? fmt::format(" (they miss by {:.0f} %)", 100.0 * best.miss)
                                : ""));
        state.cameras.push_back(best.camera);
        state.quarters.push_back(best.quarters);
    }
    return state;
}

glm::dvec3 startingPoint(const SharedPoint& point, const std::vector<Camera>& cameras)
{
    if (point.on_floor)
        for (const auto& [view, pixel] : point.seen_px)
            if (const auto place = floorPoint(cameras[view], pixel))
                return {place->x, 0.0, place->z};
    glm::dvec3 best(0.0);
    double widest = -1.0;
    for (const auto& [a, at_a] : point.seen_px)
        for (const auto& [b, at_b] : point.seen_px) {
            if (b <= a) continue;
            const double apart = glm::length(
                glm::cross(cameras[a].rayDirection(at_a), cameras[b].rayDirection(at_b)));
            const auto met = meet(cameras[a], at_a, cameras[b], at_b);
            if (!met || apart <= widest) continue;
            widest = apart;
            best = met->point;
        }
    if (widest < 0.0) {
        // Seen by one view, or along one ray: two metres away is as good as anywhere.
        const auto& [view, pixel] = *point.seen_px.begin();
        best = cameras[view].position_m + cameras[view].rayDirection(pixel) * 2.0;
    }
    return best;
}

double chiSquaredLimit(double freedom)
{
    const double spread = 2.0 / (9.0 * freedom);
    return freedom * std::pow(1.0 - spread + kConsistencyQuantile * std::sqrt(spread), 3.0);
}

}  // namespace

JoinedViews joinViews(const RoomViews& room,
                      const CalibrationOptions& options,
                      const std::string& source)
{
    room.check(source);
    std::vector<CameraEstimate> alone;
    for (const RoomView& view : room.views) {
        CalibrationOptions own = options;
        if (view.exif && !own.exif_focal_px) {
            own.exif_focal_px = view.exif->focal_px;
            own.exif_focal_sigma = view.exif->sigma;
        }
        alone.push_back(calibrateCamera(view.lines, own, source + ": " + view.name));
    }
    bundle::State state = startingCameras(room, alone, source);
    for (const SharedPoint& point : room.points)
        state.points_m.push_back(startingPoint(point, state.cameras));

    const auto solved = bundle::solve(room, options.segment_sigma_px, state);
    if (!solved)
        throw NoAnswerError(source,
                            "the views together admit no solution; check the shared points and the "
                            "axes of the segments");
    JoinedViews joined;
    joined.cameras = solved->cameras;
    joined.points_m = solved->points_m;
    joined.chi_squared = solved->chi_squared;
    joined.freedom = solved->freedom;
    joined.findings.push_back({Severity::Info,
                               "views-joined",
                               fmt::format("{} views share {} points; χ² {:.1f} of {:.0f} expected",
                                           room.views.size(),
                                           room.points.size(),
                                           joined.chi_squared,
                                           joined.freedom)});
    if (joined.freedom >= 1.0 && joined.chi_squared > chiSquaredLimit(joined.freedom))
        joined.findings.push_back(
            {Severity::Warning,
             "views-inconsistent",
             fmt::format("the views contradict each other (χ² {:.1f}, {:.0f} expected; worst is {} "
                         "with {:.1f} σ): check that point, or give a larger --segment-sigma-px",
                         joined.chi_squared,
                         joined.freedom,
                         solved->worst,
                         solved->worst_sigmas)});
    return joined;
}

}  // namespace insitu
