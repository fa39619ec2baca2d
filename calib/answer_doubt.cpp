#include "calib/answer_doubt.h"

#include "core/random.h"

#include <cmath>
#include <vector>

namespace insitu::manhattan {

namespace {

constexpr int kDraws = 24;
constexpr std::uint64_t kSeed = 1;

/// Scatter of the answer about `frame` over tasks that `make` changes.
template <class Make>
Doubt scatter(const Task& task, const Frame& frame, int count, Make make)
{
    Doubt doubt;
    for (int i = 0; i < count; ++i) {
        Task changed = task;
        make(changed, i);
        const Frame again = refined(changed, frame);
        const double focal = std::log(again.focal_px / frame.focal_px);
        const double angle = axesApart(again, frame);
        doubt.focal += focal * focal / count;
        doubt.rotation += angle * angle / count;
    }
    return {std::sqrt(doubt.focal), std::sqrt(doubt.rotation)};
}

}  // namespace

Doubt doubtOf(const Task& task, const Frame& frame, double principal_sigma)
{
    const Doubt drawn = scatter(task, frame, kDraws, [](Task& changed, int draw) {
        RandomStream random(kSeed, 0, static_cast<std::uint64_t>(draw));
        const auto count = static_cast<std::uint32_t>(changed.observations.size());
        std::vector<double> times(count, 0.0);
        for (std::uint32_t i = 0; i < count; ++i)
            times[random.below(count)] += 1.0;
        for (std::uint32_t i = 0; i < count; ++i)
            changed.observations[i].weight *= times[i];
    });
    const Doubt moved = scatter(task, frame, 4, [principal_sigma](Task& changed, int side) {
        const glm::dvec2 steps[] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
        for (Observation& one : changed.observations)
            one.middle += steps[side] * principal_sigma * changed.long_side;
    });
    // Two directions, each ± one σ: the mean over the four is half of the sum over directions.
    return {std::hypot(drawn.focal, std::sqrt(2.0) * moved.focal),
            std::hypot(drawn.rotation, std::sqrt(2.0) * moved.rotation)};
}

}  // namespace insitu::manhattan
