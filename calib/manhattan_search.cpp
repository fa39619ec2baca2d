#include "calib/manhattan_search.h"

#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>

namespace insitu::manhattan {

namespace {

/// Long segments whose pairs are tried, and those that judge the candidates.
constexpr std::size_t kPaired = 70;
constexpr std::size_t kJudges = 200;
/// Vanishing points that are followed, and candidates that are refined.
constexpr std::size_t kPoints = 32;
constexpr std::size_t kRefined = 16;
/// Slack while looking, when candidates are still off by a degree.
constexpr double kRoughSlack = glm::radians(0.7);
/// Candidates nearer to each other than this are one.
constexpr double kPointsApart = glm::radians(3.0);
constexpr double kFramesApart = glm::radians(2.5);
constexpr double kFocalApart = 0.08;  ///< of ln f
/// Focal lengths tried, multiples of the long side: 110° to 16°.
constexpr double kShortest = 0.35;
constexpr double kLongest = 3.5;
constexpr double kFocalStep = 1.13;
/// Bins of the vote over a right angle.
constexpr int kBins = 180;

struct Point {
    glm::dvec3 centred{0.0};  ///< homogeneous, pixels
    double score = 0.0;
};

glm::dvec3 directionOf(const Point& point, double focal_px)
{
    return glm::normalize(glm::dvec3(point.centred.x, point.centred.y, point.centred.z * focal_px));
}

double supportOf(const Task& task, const Point& point)
{
    const glm::dvec3 direction = directionOf(point, task.long_side);
    double sum = 0.0;
    for (const Observation& segment : task.observations) {
        const double sigma = std::hypot(segment.sigma, kRoughSlack);
        const double u = missAngle(segment, direction, task.long_side) / sigma;
        sum += segment.weight * std::log1p(0.3 / sigma * std::exp(-0.5 * u * u));
    }
    return sum;
}

/// The points where most segments meet, of the intersections of pairs of long ones.
std::vector<Point> vanishingPoints(const Task& task)
{
    std::vector<Point> all;
    const std::size_t count = std::min(kPaired, task.observations.size());
    const double unit = task.long_side;
    const auto lineOf = [unit](const Observation& segment) {
        const glm::dvec2 m = segment.middle / unit;
        return glm::cross(glm::dvec3(m, 1.0), glm::dvec3(segment.along, 0.0));
    };
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = i + 1; j < count; ++j) {
            const glm::dvec3 v =
                glm::cross(lineOf(task.observations[i]), lineOf(task.observations[j]));
            if (glm::length(v) < 1e-3) continue;  // pieces of one line
            Point point{glm::dvec3(v.x * unit, v.y * unit, v.z), 0.0};
            point.score = supportOf(task, point);
            all.push_back(point);
        }
    std::stable_sort(
        all.begin(), all.end(), [](const Point& a, const Point& b) { return a.score > b.score; });
    std::vector<Point> kept;
    for (const Point& point : all) {
        if (kept.size() == kPoints) break;
        const glm::dvec3 d = directionOf(point, task.long_side);
        const bool isNew = std::none_of(kept.begin(), kept.end(), [&](const Point& other) {
            return std::abs(glm::dot(d, directionOf(other, task.long_side))) >
                   std::cos(kPointsApart);
        });
        if (isNew) kept.push_back(point);
    }
    return kept;
}

std::vector<double> focalLengths(const Task& task)
{
    std::vector<double> values;
    if (task.prior) {
        for (const double sigmas : {0.0, -1.5, 1.5})
            values.push_back(task.prior->focal_px * std::exp(sigmas * task.prior->sigma));
        return values;
    }
    for (double share = kShortest; share <= kLongest; share *= kFocalStep)
        values.push_back(share * task.long_side);
    return values;
}

/// Turns about `axis` for which most segments run along one of the two directions across it.
std::vector<glm::dmat3> turnsAbout(glm::dvec3 axis, const Task& task, double focal_px)
{
    const glm::dvec3 aside =
        std::abs(axis.x) < 0.7 ? glm::dvec3(1.0, 0.0, 0.0) : glm::dvec3(0.0, 1.0, 0.0);
    const glm::dvec3 e1 = glm::normalize(glm::cross(axis, aside));
    const glm::dvec3 e2 = glm::cross(axis, e1);
    std::vector<double> votes(kBins, 0.0);
    const double bin = glm::half_pi<double>() / kBins;
    for (const Observation& segment : task.observations) {
        if (std::abs(missAngle(segment, axis, focal_px)) < 2.0 * kRoughSlack) continue;
        const glm::dvec3 normal = glm::normalize(
            glm::cross(glm::dvec3(segment.middle / focal_px, 1.0), glm::dvec3(segment.along, 0.0)));
        const double a = glm::dot(normal, e1);
        const double b = glm::dot(normal, e2);
        // normal · (cos θ e1 + sin θ e2) = 0; on the axis' own horizon any turn will do.
        if (std::hypot(a, b) < 0.1) continue;
        double turn = std::fmod(std::atan2(-a, b), glm::half_pi<double>());
        if (turn < 0.0) turn += glm::half_pi<double>();
        const auto center = static_cast<int>(turn / bin);
        for (int off = -2; off <= 2; ++off)
            votes[static_cast<std::size_t>((center + off + kBins) % kBins)] +=
                segment.weight * (3.0 - std::abs(off));
    }
    std::vector<glm::dmat3> turns;
    for (int round = 0; round < 2; ++round) {
        const auto best = std::max_element(votes.begin(), votes.end());
        if (*best <= 0.0) break;
        const auto index = static_cast<int>(best - votes.begin());
        const double turn = (index + 0.5) * bin;
        const glm::dvec3 first = std::cos(turn) * e1 + std::sin(turn) * e2;
        turns.emplace_back(axis, first, glm::cross(axis, first));
        for (int off = -12; off <= 12; ++off)
            votes[static_cast<std::size_t>((index + off + kBins) % kBins)] = 0.0;
    }
    return turns;
}

/// Sorted by score, near ones dropped.
std::vector<Frame> distinct(std::vector<Frame> frames, std::size_t most)
{
    std::stable_sort(frames.begin(), frames.end(), [](const Frame& a, const Frame& b) {
        return a.score > b.score;
    });
    std::vector<Frame> kept;
    for (const Frame& frame : frames) {
        if (kept.size() == most) break;
        const bool isNew = std::none_of(kept.begin(), kept.end(), [&](const Frame& other) {
            return axesApart(frame, other) < kFramesApart &&
                   std::abs(std::log(frame.focal_px / other.focal_px)) < kFocalApart;
        });
        if (isNew) kept.push_back(frame);
    }
    return kept;
}

}  // namespace

std::vector<Frame> search(const Task& task)
{
    if (task.observations.size() < 4) return {};
    Task judges = task;
    if (judges.observations.size() > kJudges) judges.observations.resize(kJudges);
    std::vector<Frame> rough;
    for (const Point& point : vanishingPoints(judges))
        for (const double focal : focalLengths(task))
            for (const glm::dmat3& axes : turnsAbout(directionOf(point, focal), judges, focal)) {
                Frame frame{axes, focal, kRoughSlack, 0.0};
                frame.score = evidence(judges, frame);
                rough.push_back(frame);
            }
    std::vector<Frame> found;
    for (const Frame& frame : distinct(std::move(rough), kRefined))
        found.push_back(refined(task, frame));
    return distinct(std::move(found), kRefined);
}

}  // namespace insitu::manhattan
