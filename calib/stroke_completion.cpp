#include "calib/answer_doubt.h"
#include "calib/line_assignment.h"
#include "calib/room_lines.h"

#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// A stroke means the edge beside it when it is this near, share of the long side, and angle.
constexpr double kReach = 0.01;
constexpr double kAngle = glm::radians(4.0);
/// and runs beside it for this share of the shorter of the two.
constexpr double kOverlap = 0.4;
/// How exactly strokes are drawn, share of the long side.
constexpr double kStrokeSigma = 0.003;
/// Strokes that leave the rotation more open than this say nothing about other edges.
constexpr double kRotationOpen = glm::radians(10.0);
/// The edges' own best answer may differ from the strokes' by so many of its standard deviations.
constexpr double kAgreement = 4.0;
constexpr double kLeastAgreement = glm::radians(2.0);
constexpr double kStartSlack = glm::radians(0.5);

double overlap(const LineSegment& stroke, const DetectedSegment& edge)
{
    const double length = glm::length(stroke.to_px - stroke.from_px);
    const glm::dvec2 along = (stroke.to_px - stroke.from_px) / length;
    const double a = glm::dot(along, edge.from_px - stroke.from_px);
    const double b = glm::dot(along, edge.to_px - stroke.from_px);
    const double shared = std::min(length, std::max(a, b)) - std::max(0.0, std::min(a, b));
    return shared / std::min(length, edge.length());
}

double apart(const LineSegment& stroke, const DetectedSegment& edge)
{
    const glm::dvec2 along = glm::normalize(edge.to_px - edge.from_px);
    const glm::dvec2 normal(-along.y, along.x);
    return std::max(std::abs(glm::dot(normal, stroke.from_px - edge.from_px)),
                    std::abs(glm::dot(normal, stroke.to_px - edge.from_px)));
}

double angleBetween(const LineSegment& stroke, const DetectedSegment& edge)
{
    const glm::dvec2 a = glm::normalize(stroke.to_px - stroke.from_px);
    const glm::dvec2 b = glm::normalize(edge.to_px - edge.from_px);
    return std::asin(std::min(1.0, std::abs(a.x * b.y - a.y * b.x)));
}

/// The edge a stroke was drawn along: the nearest of those beside it.
std::optional<std::size_t> edgeOf(const LineSegment& stroke,
                                  const std::vector<DetectedSegment>& edges,
                                  double reach)
{
    std::optional<std::size_t> best;
    double nearest = reach;
    for (std::size_t i = 0; i < edges.size(); ++i) {
        const double distance = apart(stroke, edges[i]);
        if (distance >= nearest || angleBetween(stroke, edges[i]) > kAngle ||
            overlap(stroke, edges[i]) < kOverlap)
            continue;
        best = i;
        nearest = distance;
    }
    return best;
}

/// Where the strokes say that the room's directions are, with the edges' say within its error.
std::optional<manhattan::Frame> frameOf(const LineSet& strokes,
                                        const manhattan::Task& task,
                                        const std::optional<FocalPrior>& prior)
{
    const glm::dvec2 middle(0.5 * strokes.width, 0.5 * strokes.height);
    const auto start = findOrientation(strokes, middle, kStrokeSigma * task.long_side, prior);
    if (!start || start->focal_at_limit || !(start->rotation_sigma < kRotationOpen))
        return std::nullopt;
    manhattan::Frame frame{start->camera_from_world, start->focal_px, kStartSlack, 0.0};
    const manhattan::Frame better = manhattan::refined(task, frame);
    const double allowed = std::max(kLeastAgreement, kAgreement * start->rotation_sigma);
    if (manhattan::axesApart(better, frame) < allowed) return better;
    return frame;
}

/// Root mean square error of the segments' ends, as their angles to the frame show.
double endSigma(const LineSet& lines, const manhattan::Frame& frame)
{
    const glm::dvec2 center(0.5 * lines.width, 0.5 * lines.height);
    double squares = 0.0;
    for (const LineSegment& segment : lines.segments) {
        manhattan::Observation one;
        one.middle = 0.5 * (segment.from_px + segment.to_px) - center;
        one.length = glm::length(segment.to_px - segment.from_px);
        one.along = (segment.to_px - segment.from_px) / one.length;
        const double off =
            manhattan::missAngle(one, frame.axes[static_cast<int>(segment.axis)], frame.focal_px) *
            one.length;
        squares += 0.5 * off * off;
    }
    return std::max(0.05, std::sqrt(squares / static_cast<double>(lines.segments.size())));
}

}  // namespace

std::optional<CompletedLines> completeStrokes(const LineSet& strokes,
                                              const EncodedImage& image,
                                              const std::optional<FocalPrior>& prior,
                                              const RoomLineOptions& options)
{
    requireValid(options.validate(), "room line options");
    INSITU_CHECK(strokes.distortion.division == 0.0, "{}", strokes.distortion.division);
    const std::vector<DetectedSegment> edges = detectSegments(image, options.detection);
    manhattan::Task task = manhattan::makeTask(edges, strokes.width, strokes.height, prior);

    CompletedLines result;
    result.lines = strokes;
    std::vector<std::optional<RoomAxis>> named(edges.size());
    for (LineSegment& stroke : result.lines.segments)
        if (const auto edge = edgeOf(stroke, edges, kReach * task.long_side)) {
            ++result.snapped;
            named[*edge] = stroke.axis;
            stroke.from_px = edges[*edge].from_px;
            stroke.to_px = edges[*edge].to_px;
        }
    const auto frame = frameOf(result.lines, task, prior);
    if (!frame) return std::nullopt;

    // Edges that a stroke names are there already.
    std::vector<DetectedSegment> others;
    manhattan::Task unnamed = task;
    unnamed.observations.clear();
    for (std::size_t i = 0; i < edges.size(); ++i)
        if (!named[i]) {
            others.push_back(edges[i]);
            unnamed.observations.push_back(task.observations[i]);
        }
    const manhattan::Assigned assigned =
        manhattan::assignAxes(others, unnamed, *frame, options.most_per_axis);
    result.added = static_cast<int>(assigned.segments.size());
    result.lines.segments.insert(
        result.lines.segments.end(), assigned.segments.begin(), assigned.segments.end());
    result.sigma_px = endSigma(result.lines, *frame);
    result.doubt = manhattan::doubtOf(task, *frame, options.principal_sigma).covariance;
    return result;
}

}  // namespace insitu
