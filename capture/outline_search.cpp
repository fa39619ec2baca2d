#include "capture/outline_search.h"

#include "capture/outline_refine.h"
#include "capture/outline_vote.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace insitu::detail {

namespace {

/// The whole picture is searched at this longer side.
constexpr int kCoarseSide = 640;
constexpr double kSmallestCoarseRadius = 8.0;
constexpr double kSmallestRadius = 12.0;
constexpr std::size_t kCandidates = 40;
constexpr int kCoarseRays = 180;
constexpr int kMostCoarseRays = 360;
/// In the reduced picture: distance of an edge from its circle, and the power of the radius that
/// circles gain by being large.
constexpr double kCoarseTolerance = 1.5;
constexpr double kSizeBonus = 0.2;
/// A circle around another one needs only this share of its score: one a little larger than what
/// runs along its rim, one much larger than a lamp that it mirrors.
constexpr double kRimShare = 0.85;
constexpr double kLampShare = 0.6;
constexpr double kOuterGrowth = 1.2;
constexpr double kOuterSlack = 0.03;
/// Candidates looked at in full resolution.
constexpr std::size_t kFinalists = 5;
/// ... when they have this share of the best one's score.
constexpr double kFinalistShare = 0.7;

/// A circle of the reduced picture, and how well its edges speak for it.
struct Candidate {
    Outline outline;
    double score = 0.0;
};

/// Two circles that the full picture would not tell apart.
bool isNear(const Outline& a, const Outline& b)
{
    return glm::length(a.center - b.center) < 1.5 && std::abs(a.radius - b.radius) < 1.5;
}

/// The share of the score of `inner` that `outer` needs to be preferred: 1 unless it holds it. What
/// a ball mirrors, lamps and whatever runs along its rim, makes circles inside it, but none around.
double handicap(const BallOutline& outer, const BallOutline& inner)
{
    const double growth = outer.radius_px - inner.radius_px;
    const double slack = kOuterSlack * inner.radius_px;
    if (growth <= 0.0 || glm::length(outer.center_px - inner.center_px) > growth + slack)
        return 1.0;
    return outer.radius_px < kOuterGrowth * inner.radius_px ? kRimShare : kLampShare;
}

/// The circles that the reduced picture's edges vote for, in its pixels, judged by what long arcs
/// show; best first.
std::vector<Candidate> searchEverywhere(const OutlinePicture& coarse, double smallest, bool ellipse)
{
    const std::vector<Edge> edges = thinEdges(coarse);
    std::vector<Candidate> candidates;
    for (const Circle& circle :
         voteForCircles(edges, {coarse.width(), coarse.height()}, smallest, kCandidates)) {
        const Outline near{circle.center, circle.radius, glm::dvec2(0.0)};
        const double window = 0.06 * circle.radius + 2.0;
        const std::vector<RimRay> sorted = sortEdges(edges, near, kCoarseRays, window);
        const std::optional<Outline> joined =
            consensusCircle(sorted, near, window, kCoarseTolerance);
        if (!joined) continue;
        const int rays = std::min(outlineRays(joined->radius), kMostCoarseRays);
        const std::optional<OutlineFit> fit =
            searchNear(coarse, *joined, rays, window + 1.0, ellipse);
        if (!fit || !coarse.contains(fit->outline.center)) continue;
        const auto same = [&](const Candidate& other) {
            return isNear(other.outline, fit->outline);
        };
        if (std::ranges::none_of(candidates, same))
            candidates.push_back(
                {fit->outline, fit->support / rays * std::pow(fit->outline.radius, kSizeBonus)});
    }
    std::ranges::stable_sort(candidates, std::greater<>(), &Candidate::score);
    return candidates;
}

}  // namespace

std::optional<BallOutline> searchPicture(const OutlinePicture& picture,
                                         const BallOutlineOptions& options)
{
    const int longer = std::max(picture.width(), picture.height());
    const int factor = (longer + kCoarseSide - 1) / kCoarseSide;
    const double smallest = std::max(options.smallest_radius * longer, kSmallestRadius);
    std::vector<Candidate> candidates =
        searchEverywhere(picture.reduced(factor),
                         std::max(smallest / factor, kSmallestCoarseRadius),
                         options.ellipse);
    if (candidates.empty()) return std::nullopt;
    if (candidates.size() > kFinalists) candidates.resize(kFinalists);
    std::erase_if(candidates,
                  [least = kFinalistShare * candidates.front().score](const Candidate& c) {
                      return c.score < least;
                  });
    std::optional<BallOutline> best;
    double most = 0.0;
    for (const Candidate& candidate : candidates) {
        Outline start = candidate.outline;
        start.center *= factor;
        start.radius *= factor;
        const std::optional<BallOutline> ball =
            approachOutline(picture, start, 3.0 * factor + 2.0, options.ellipse);
        if (!ball) continue;
        const double score =
            ball->inlier_share * ball->visible_share * std::pow(ball->radius_px, kSizeBonus);
        const double wanted = best ? most * handicap(*ball, *best) / handicap(*best, *ball) : 0.0;
        if (score <= wanted) continue;
        most = score;
        best = ball;
    }
    if (!best) return std::nullopt;
    return refineOutline(picture, *best, options.ellipse);
}

}  // namespace insitu::detail
