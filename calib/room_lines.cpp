#include "calib/room_lines.h"

#include "calib/answer_doubt.h"
#include "calib/line_assignment.h"
#include "calib/manhattan_search.h"
#include "calib/right_angle.h"
#include "calib/second_frame.h"

#include <fmt/format.h>
#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// The frame with its columns as x, y, z of lines.json and their signs.
glm::dmat3 roomAxes(const manhattan::Frame& frame)
{
    int up = 0;
    for (int k = 1; k < 3; ++k)
        if (std::abs(frame.axes[k].y) > std::abs(frame.axes[up].y)) up = k;
    const int a = (up + 1) % 3;
    const int b = (up + 2) % 3;
    const int right = std::abs(frame.axes[a].x) >= std::abs(frame.axes[b].x) ? a : b;
    const glm::dvec3 y = frame.axes[up] * (frame.axes[up].y > 0.0 ? -1.0 : 1.0);
    const glm::dvec3 x = frame.axes[right] * (frame.axes[right].x < 0.0 ? -1.0 : 1.0);
    return {x, y, glm::cross(x, y)};
}

/// Best score among answers that are another room or another lens.
double marginOf(const std::vector<manhattan::Frame>& frames)
{
    for (std::size_t i = 1; i < frames.size(); ++i)
        if (manhattan::axesApart(frames[0], frames[i]) > glm::radians(4.0) ||
            std::abs(std::log(frames[i].focal_px / frames[0].focal_px)) > 0.15)
            return frames[0].score - frames[i].score;
    return frames.empty() ? 0.0 : frames[0].score;
}

void object(const RoomLineOptions& options, bool focal_known, RoomLines& lines)
{
    const auto add = [&](std::string text) { lines.objections.push_back(std::move(text)); };
    int counts[3] = {};
    for (const LineSegment& segment : lines.segments)
        ++counts[static_cast<int>(segment.axis)];
    const auto axes = std::count_if(counts, counts + 3, [](int n) { return n >= 2; });
    if (axes < 2)
        add(fmt::format("{}, {} and {} segments along x, y and z; two directions need two each",
                        counts[0],
                        counts[1],
                        counts[2]));
    if (lines.explained < options.least_explained)
        add(
            fmt::format("only {:.0f} % of the edges follow the room's directions ({:.0f} % are "
                        "asked for)",
                        100.0 * lines.explained,
                        100.0 * options.least_explained));
    const double least_margin =
        focal_known ? options.least_margin_with_prior : options.least_margin;
    if (lines.margin < least_margin)
        add(
            fmt::format("another answer explains the edges nearly as well (evidence {:.1f} less, "
                        "{:.1f} asked for)",
                        lines.margin,
                        least_margin));
    const double most_off =
        (focal_known ? options.most_angle_sigmas_with_prior : options.most_angle_sigmas) *
        lines.angle_sigma;
    const double angle_off = std::abs(lines.angle_off);
    if (angle_off > most_off && angle_off > glm::radians(options.least_angle_off_deg))
        add(
            fmt::format("x and z do not look at right angles (the edges alone say {:.0f} ± {:.0f}°"
                        "): a wall or furniture that stands askew is taken for one of them",
                        90.0 + glm::degrees(lines.angle_off),
                        glm::degrees(lines.angle_sigma)));
    if (lines.focal_at_limit) add("the focal length ran into the limits of what a lens can be");
    if (!focal_known && lines.focal_doubt > options.most_focal_doubt)
        add(
            fmt::format("the focal length is doubtful by {:.0f} % ({:.0f} % allowed) and EXIF has "
                        "none",
                        100.0 * lines.focal_doubt,
                        100.0 * options.most_focal_doubt));
    if (glm::degrees(lines.rotation_doubt) > options.most_rotation_doubt_deg)
        add(fmt::format("the rotation is doubtful by {:.1f}° ({:.1f}° allowed)",
                        glm::degrees(lines.rotation_doubt),
                        options.most_rotation_doubt_deg));
}

}  // namespace

Findings RoomLineOptions::validate() const
{
    Findings problems = detection.validate();
    const auto check = [&](bool good, const std::string& message) {
        if (!good) problems.push_back({Severity::Error, "room-line-options", message});
    };
    check(most_per_axis >= 2,
          fmt::format("most_per_axis is {}, must be at least 2", most_per_axis));
    check(principal_sigma >= 0.0 && principal_sigma <= 0.2,
          fmt::format("principal_sigma is {}, must lie in [0, 0.2]", principal_sigma));
    check(most_focal_doubt > 0.0,
          fmt::format("most_focal_doubt is {}, must be positive", most_focal_doubt));
    check(most_rotation_doubt_deg > 0.0,
          fmt::format("most_rotation_doubt_deg is {}, must be positive", most_rotation_doubt_deg));
    check(
        least_margin >= 0.0 && least_margin_with_prior >= 0.0,
        fmt::format("least_margin and least_margin_with_prior are {} and {}, must not be negative",
                    least_margin,
                    least_margin_with_prior));
    check(
        most_angle_sigmas > 0.0 && most_angle_sigmas_with_prior > 0.0 && least_angle_off_deg >= 0.0,
        fmt::format("most_angle_sigmas, most_angle_sigmas_with_prior and least_angle_off_deg are "
                    "{}, {} and {}, must be positive",
                    most_angle_sigmas,
                    most_angle_sigmas_with_prior,
                    least_angle_off_deg));
    check(least_explained >= 0.0 && least_explained <= 1.0,
          fmt::format("least_explained is {}, must lie in [0, 1]", least_explained));
    return problems;
}

std::optional<RoomLines> findRoomLines(const EncodedImage& image,
                                       const std::optional<FocalPrior>& prior,
                                       const RoomLineOptions& options)
{
    requireValid(options.validate(), "room line options");
    const std::vector<DetectedSegment> segments = detectSegments(image, options.detection);
    manhattan::Task task =
        manhattan::makeTask(segments, image.codes.width(), image.codes.height(), prior);
    task.up = options.up;
    std::vector<manhattan::Frame> frames = manhattan::search(task);
    if (frames.empty()) return std::nullopt;

    RoomLines lines;
    lines.margin = marginOf(frames);
    manhattan::Frame& best = frames.front();
    best.axes = roomAxes(best);
    const manhattan::Doubt doubt = manhattan::doubtOf(task, best, options.principal_sigma);
    manhattan::Assigned assigned =
        manhattan::assignAxes(segments, task, best, options.most_per_axis);
    lines.segments = std::move(assigned.segments);
    lines.sigma_px = assigned.sigma_px;
    lines.explained = assigned.explained;
    lines.camera_from_world = best.axes;
    lines.focal_px = best.focal_px;
    lines.focal_at_limit = best.focal_px <= 1.001 * manhattan::kShortestLens * task.long_side ||
                           best.focal_px >= 0.999 * manhattan::kLongestLens * task.long_side;
    lines.detected = static_cast<int>(segments.size());
    lines.focal_doubt = doubt.focal;
    lines.rotation_doubt = doubt.rotation;
    lines.doubt = doubt.covariance;
    const manhattan::RightAngle angle = manhattan::rightAngle(task, best, options.principal_sigma);
    lines.angle_off = angle.off;
    lines.angle_sigma = angle.sigma;
    if (const auto second = manhattan::secondFrame(task, best, options.least_margin))
        lines.second = SecondDirections{second->turn, second->segments, second->evidence};
    object(options, prior.has_value(), lines);
    return lines;
}

}  // namespace insitu
