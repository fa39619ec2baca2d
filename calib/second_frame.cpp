#include "calib/second_frame.h"

#include <glm/gtc/constants.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace insitu::manhattan {

namespace {

/// Turns tried, and the least apart from the first frame: nearer ones are its own slack.
constexpr double kTurnStep = glm::radians(0.5);
constexpr double kLeastTurn = glm::radians(4.0);
/// Share of the segments that each of the two directions has, of those that follow no axis.
constexpr double kShare = 0.1;
/// A segment is of the second frame when most of it is.
constexpr double kMember = 0.6;

/// What is left of a segment when the first frame has taken its part.
struct Rest {
    const Observation* segment = nullptr;
    double weight = 0.0;
    double sigma = 0.0;
};

glm::dvec3 turnedX(const Frame& frame, double turn)
{
    return frame.axes[0] * std::cos(turn) - frame.axes[2] * std::sin(turn);
}

/// Density of the segment's angle along the pair over that of any direction.
double ratioOf(const Rest& rest, const Frame& frame, double turn)
{
    double sum = 0.0;
    for (const double way : {turn, turn + glm::half_pi<double>()}) {
        const double u = missAngle(*rest.segment, turnedX(frame, way), frame.focal_px) / rest.sigma;
        sum += std::sqrt(0.5 * glm::pi<double>()) / rest.sigma * std::exp(-0.5 * u * u);
    }
    return sum;
}

double evidenceOf(const std::vector<Rest>& rests, const Frame& frame, double turn)
{
    double sum = 0.0;
    for (const Rest& rest : rests)
        sum += rest.weight * std::log(1.0 - 2.0 * kShare + kShare * ratioOf(rest, frame, turn));
    return sum;
}

}  // namespace

std::optional<SecondFrame> secondFrame(const Task& task, const Frame& frame, double least_evidence)
{
    std::vector<Rest> rests;
    for (const Observation& segment : task.observations) {
        const auto shares = memberships(segment, frame);
        const double left = 1.0 - shares[0] - shares[1] - shares[2];
        // On the horizon every horizontal direction will do.
        const bool on_horizon =
            std::abs(missAngle(segment, frame.axes[0], frame.focal_px)) < 3.0 * frame.slack &&
            std::abs(missAngle(segment, frame.axes[2], frame.focal_px)) < 3.0 * frame.slack;
        if (left > 0.5 && !on_horizon)
            rests.push_back(
                {&segment, segment.weight * left, std::hypot(segment.sigma, frame.slack)});
    }
    SecondFrame best;
    int trials = 0;
    for (double turn = kLeastTurn; turn <= glm::half_pi<double>() - kLeastTurn; turn += kTurnStep) {
        ++trials;
        const double evidence = evidenceOf(rests, frame, turn);
        if (trials > 1 && evidence <= best.evidence) continue;
        best.turn = turn;
        best.evidence = evidence;
    }
    best.evidence -= std::log(static_cast<double>(trials));
    if (!(best.evidence >= least_evidence)) return std::nullopt;
    for (const Rest& rest : rests) {
        const double own = kShare * ratioOf(rest, frame, best.turn);
        best.segments += own > kMember * (own + 1.0 - 2.0 * kShare) ? 1 : 0;
    }
    return best;
}

}  // namespace insitu::manhattan
