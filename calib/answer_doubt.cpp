#include "calib/answer_doubt.h"

#include "core/random.h"

#include <glm/gtc/quaternion.hpp>

#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace insitu::manhattan {

namespace {

constexpr int kDraws = 48;
constexpr std::uint64_t kSeed = 1;
/// Side of the squares that are drawn, share of the long side.
constexpr double kSquare = 1.0 / 6.0;
/// σ of ln f from which a draw leaves it open, and what it then counts: the spread of lenses in
/// use.
constexpr double kFocalOpen = 0.2;
constexpr double kFocalSpread = 0.35;

/// The turn from one frame to another, whose axes may be exchanged and reversed. Radians, in the
/// camera's frame
glm::dvec3 turnBetween(const Frame& from, const Frame& to)
{
    glm::dmat3 matched(0.0);
    for (int i = 0; i < 3; ++i) {
        int nearest = 0;
        for (int k = 1; k < 3; ++k)
            if (std::abs(glm::dot(to.axes[k], from.axes[i])) >
                std::abs(glm::dot(to.axes[nearest], from.axes[i])))
                nearest = k;
        const bool same = glm::dot(to.axes[nearest], from.axes[i]) > 0.0;
        matched[i] = same ? to.axes[nearest] : -to.axes[nearest];
    }
    glm::dquat turn = glm::quat_cast(matched * glm::transpose(from.axes));
    if (turn.w < 0.0) turn = -turn;
    const glm::dvec3 half(turn.x, turn.y, turn.z);
    const double sine = glm::length(half);
    return sine > 0.0 ? half * (2.0 * std::atan2(sine, turn.w) / sine) : glm::dvec3(0.0);
}

/// Mean square of the answer's changes over tasks that `make` changes.
template <class Make>
OrientationCovariance scatter(const Task& task, const Frame& frame, int count, Make make)
{
    OrientationCovariance sum{};
    for (int i = 0; i < count; ++i) {
        Task changed = task;
        make(changed, i);
        const Frame again = refined(changed, frame);
        const glm::dvec3 turn = turnBetween(frame, again);
        double off[4] = {turn.x, turn.y, turn.z, std::log(again.focal_px / frame.focal_px)};
        if (!task.prior && focalSigma(changed, again) > kFocalOpen) off[3] = kFocalSpread;
        for (int row = 0; row < 4; ++row)
            for (int column = 0; column < 4; ++column)
                sum[row][column] += off[row] * off[column] / count;
    }
    return sum;
}

using Square = std::pair<int, int>;

/// The observations of each square of the picture that has any.
std::vector<std::vector<std::size_t>> squaresOf(const Task& task)
{
    std::map<Square, std::vector<std::size_t>> squares;
    const double side = kSquare * task.long_side;
    for (std::size_t i = 0; i < task.observations.size(); ++i) {
        const glm::dvec2 at = glm::floor(task.observations[i].middle / side);
        squares[{static_cast<int>(at.x), static_cast<int>(at.y)}].push_back(i);
    }
    std::vector<std::vector<std::size_t>> members;
    for (auto& [square, own] : squares)
        members.push_back(std::move(own));
    return members;
}

}  // namespace

Doubt doubtOf(const Task& task, const Frame& frame, double principal_sigma)
{
    const auto squares = squaresOf(task);
    const auto count = static_cast<std::uint32_t>(squares.size());
    const OrientationCovariance drawn = scatter(task, frame, kDraws, [&](Task& changed, int draw) {
        RandomStream random(kSeed, 0, static_cast<std::uint64_t>(draw));
        std::vector<double> times(count, 0.0);
        for (std::uint32_t i = 0; i < count; ++i)
            times[random.below(count)] += 1.0;
        for (std::uint32_t square = 0; square < count; ++square)
            for (const std::size_t i : squares[square])
                changed.observations[i].weight *= times[square];
    });
    const OrientationCovariance moved =
        scatter(task, frame, 4, [principal_sigma](Task& changed, int side) {
            const glm::dvec2 steps[] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
            for (Observation& one : changed.observations)
                one.middle += steps[side] * principal_sigma * changed.long_side;
        });
    Doubt doubt;
    // Two directions, each ± one σ: the mean over the four is half of the sum over directions.
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column)
            doubt.covariance[row][column] = drawn[row][column] + 2.0 * moved[row][column];
    const auto& c = doubt.covariance;
    doubt.focal = std::sqrt(c[3][3]);
    doubt.rotation = std::sqrt(c[0][0] + c[1][1] + c[2][2]);
    return doubt;
}

}  // namespace insitu::manhattan
