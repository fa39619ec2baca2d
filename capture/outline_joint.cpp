#include "capture/outline_joint.h"

#include "core/parallel.h"
#include "core/random.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace insitu::detail {

using std::numbers::pi;

namespace {

/// A ray's cost is bounded by that of three standard deviations.
constexpr double kMostCost = 4.5;
/// Median of half a chi-squared variable with one degree of freedom.
constexpr double kMedianCost = 0.227;
/// A ray shows something when its costs differ by this much of the typical difference, and at
/// least by so much in the logarithm of its density.
constexpr double kSpeakingShare = 0.25;
constexpr double kSpeakingCost = 3.0;
constexpr std::size_t kFewestRays = 12;
/// Rounds of agreement between the answer and how sure the rays are of it.
constexpr int kRounds = 4;
/// Steps of the coarse search to each side.
constexpr int kCoarse = 6;
constexpr double kFinestStep = 0.004;
constexpr int kSectors = 36;
/// Where a ray shows the rim at the outline, its cost is below this share of its largest.
constexpr double kAgreeing = 0.25;
/// No ray knows its place better than this, in pixels, and as a share of the distance of places.
constexpr double kSurePixels = 0.2;
constexpr double kSureStep = 0.4;

using Numbers = std::array<double, 5>;  ///< centre x, y, radius, stretch x, y; changes, pixels

/// Rays and what they say, ready for many questions.
class Council {
public:
    Council(RimCosts costs, const Outline& around, bool ellipse, double reach)
        : costs_(std::move(costs)), around_(around), ellipse_(ellipse), reach_(reach)
    {
        const auto count = costs_.rays.size();
        for (std::size_t i = 0; i < count; ++i) {
            const double angle = 2.0 * pi * static_cast<double>(i) / static_cast<double>(count);
            directions_.push_back(
                {std::cos(angle), std::sin(angle), std::cos(2.0 * angle), std::sin(2.0 * angle)});
        }
        std::vector<double> ranges;
        for (std::vector<double>& ray : costs_.rays) {
            modest(ray);
            ranges_.push_back(ray.empty() ? 0.0 : std::ranges::max(ray));
            if (ranges_.back() > kSpeakingCost) ranges.push_back(ranges_.back());
        }
        if (ranges.size() < kFewestRays) return;
        const double typical = medianOf(ranges);
        least_range_ = std::max(kSpeakingShare * typical, kSpeakingCost);
        temper_ = std::max(typical / (2.0 * kMostCost), 1.0);
        usable_ = true;
    }

    [[nodiscard]] bool usable() const { return usable_; }

    [[nodiscard]] Outline outlineOf(const Numbers& change) const
    {
        Outline outline = around_;
        outline.center += glm::dvec2(change[0], change[1]);
        outline.radius += change[2];
        outline.stretch += glm::dvec2(change[3], change[4]) / around_.radius;
        return outline;
    }

    /// Bounded cost of one ray for an outline.
    [[nodiscard]] double costOf(std::size_t ray, const Numbers& change) const
    {
        return bounded(costAt(ray, offsetOn(ray, change)));
    }

    /// Sum over all rays, each as often as its sector was drawn.
    [[nodiscard]] double cost(const Numbers& change, const std::vector<int>& drawn) const
    {
        double sum = 0.0;
        for (std::size_t ray = 0; ray < costs_.rays.size(); ++ray) {
            const int times = drawn[sectorOf(ray)];
            if (times > 0 && !costs_.rays[ray].empty()) sum += times * costOf(ray, change);
        }
        return sum;
    }

    /// The best of a grid over centre and radius: sums by sector, of which each draw takes others.
    void searchCoarsely();
    [[nodiscard]] Numbers bestOfGrid(const std::vector<int>& drawn) const;
    /// Downhill from there, steps halved.
    [[nodiscard]] Numbers descend(Numbers at, const std::vector<int>& drawn) const;

    /// How sure the rays may be, by how well they agree with an answer. False: no change.
    bool settleTemper(const Numbers& answer)
    {
        std::vector<double> off;
        for (std::size_t ray = 0; ray < costs_.rays.size(); ++ray)
            if (ranges_[ray] > least_range_) off.push_back(costAt(ray, offsetOn(ray, answer)));
        if (off.size() < kFewestRays) return false;
        const double found = std::max(medianOf(off) / kMedianCost, 1.0);
        const bool changed = std::abs(std::log(found / temper_)) > 0.05;
        temper_ = found;
        return changed;
    }

    /// Share of the rays in the picture that show the rim there.
    [[nodiscard]] double shareOf(const Numbers& change) const
    {
        int all = 0;
        int agreeing = 0;
        for (std::size_t ray = 0; ray < costs_.rays.size(); ++ray) {
            if (costs_.rays[ray].empty()) continue;
            ++all;
            agreeing += ranges_[ray] > kSpeakingCost &&
                        costAt(ray, offsetOn(ray, change)) < kAgreeing * ranges_[ray];
        }
        return all > 0 ? static_cast<double>(agreeing) / all : 0.0;
    }

private:
    [[nodiscard]] static double medianOf(std::vector<double> values)
    {
        const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
        std::ranges::nth_element(values, middle);
        return *middle;
    }
    /// Costs of a ray that would be surer of its place than any is, flattened.
    void modest(std::vector<double>& ray) const
    {
        const auto least = std::ranges::min_element(ray);
        if (ray.empty() || least == ray.begin() || least + 1 == ray.end()) return;
        const double bend = least[-1] - 2.0 * least[0] + least[1];
        const double sure = std::max(kSurePixels, kSureStep * costs_.step) / costs_.step;
        const double scale = std::max(bend * sure * sure, 1.0);
        for (double& cost : ray)
            cost /= scale;
    }
    [[nodiscard]] std::size_t sectorOf(std::size_t ray) const
    {
        return ray * kSectors / costs_.rays.size();
    }
    [[nodiscard]] double bounded(double cost) const
    {
        return kMostCost * cost / (cost + kMostCost * temper_);
    }
    /// Between places by Catmull and Rom's cubic.
    [[nodiscard]] double costAt(std::size_t ray, double offset) const
    {
        const std::vector<double>& by_place = costs_.rays[ray];
        const auto last = static_cast<std::ptrdiff_t>(by_place.size()) - 1;
        const double at =
            std::clamp((offset - costs_.first) / costs_.step, 0.0, static_cast<double>(last));
        const auto i = std::min(static_cast<std::ptrdiff_t>(at), last - 1);
        const double t = at - static_cast<double>(i);
        const auto y = [&](std::ptrdiff_t k) {
            return by_place[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i + k, 0, last))];
        };
        const double slope = 0.5 * (y(1) - y(-1));
        const double end_slope = 0.5 * (y(2) - y(0));
        const double rise = y(1) - y(0);
        const double value = y(0) + t * (slope + t * (3.0 * rise - 2.0 * slope - end_slope +
                                                      t * (slope + end_slope - 2.0 * rise)));
        return std::max(value, 0.0);
    }
    /// Where the ray meets a changed outline, pixels outwards from `around`: to second order for a
    /// circle, to first for an ellipse, whose change vanishes as the fit is repeated about its
    /// answer.
    [[nodiscard]] double offsetOn(std::size_t ray, const Numbers& change) const
    {
        const Direction& d = directions_[ray];
        const double across = change[1] * d.x - change[0] * d.y;
        return change[0] * d.x + change[1] * d.y + change[2] + change[3] * d.x2 + change[4] * d.y2 -
               0.5 * across * across / around_.radius;
    }

    struct Direction {
        double x, y, x2, y2;  ///< cosine and sine, and those of twice the angle
    };
    std::vector<Direction> directions_;
    RimCosts costs_;
    const Outline& around_;
    bool ellipse_;
    double reach_;
    bool usable_ = false;
    std::vector<double> ranges_;
    double least_range_ = 0.0;
    double temper_ = 1.0;
    std::vector<Numbers> grid_;
    Eigen::MatrixXd by_sector_;  ///< a row for each place of the grid
};

void Council::searchCoarsely()
{
    grid_.clear();
    const double step = reach_ / kCoarse;
    for (int x = -kCoarse; x <= kCoarse; ++x)
        for (int y = -kCoarse; y <= kCoarse; ++y)
            for (int r = -kCoarse; r <= kCoarse; ++r)
                if (std::hypot(x, y) + std::abs(r) <= kCoarse)
                    grid_.push_back({x * step, y * step, r * step, 0.0, 0.0});
    by_sector_ = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(grid_.size()), kSectors);
    parallelFor(0, static_cast<std::int64_t>(grid_.size()), [&](std::int64_t index) {
        const Numbers& change = grid_[static_cast<std::size_t>(index)];
        for (std::size_t ray = 0; ray < costs_.rays.size(); ++ray) {
            if (costs_.rays[ray].empty()) continue;
            by_sector_(index, static_cast<Eigen::Index>(sectorOf(ray))) += costOf(ray, change);
        }
    });
}

Numbers Council::bestOfGrid(const std::vector<int>& drawn) const
{
    Eigen::VectorXd times(kSectors);
    for (int i = 0; i < kSectors; ++i)
        times(i) = drawn[static_cast<std::size_t>(i)];
    Eigen::Index best = 0;
    (by_sector_ * times).minCoeff(&best);
    return grid_[static_cast<std::size_t>(best)];
}

/// Centre and radius hang together where only a part of the outline shows: every combination of
/// steps is tried.
std::vector<Numbers> steps(bool ellipse)
{
    std::vector<Numbers> all;
    for (const double x : {-1.0, 0.0, 1.0})
        for (const double y : {-1.0, 0.0, 1.0})
            for (const double r : {-1.0, 0.0, 1.0})
                if (x != 0.0 || y != 0.0 || r != 0.0) all.push_back({x, y, r, 0.0, 0.0});
    if (ellipse)
        for (const double a : {-1.0, 0.0, 1.0})
            for (const double b : {-1.0, 0.0, 1.0})
                for (const double r : {-1.0, 0.0, 1.0})
                    if (a != 0.0 || b != 0.0) all.push_back({0.0, 0.0, r, a, b});
    return all;
}

Numbers Council::descend(Numbers at, const std::vector<int>& drawn) const
{
    double least = cost(at, drawn);
    const std::vector<Numbers> directions = steps(ellipse_);
    for (double step = reach_ / kCoarse; step > kFinestStep;) {
        const Numbers from = at;
        for (const Numbers& direction : directions) {
            Numbers next = from;
            for (std::size_t i = 0; i < next.size(); ++i)
                next[i] += step * direction[i];
            const double value = cost(next, drawn);
            if (value >= least) continue;
            least = value;
            at = next;
        }
        if (at == from) step *= 0.5;
    }
    return at;
}

}  // namespace

std::optional<JointFit> fitJointly(
    const RimCosts& costs, const Outline& around, bool ellipse, double reach, int draws)
{
    Council council(costs, around, ellipse, reach);
    if (!council.usable()) return std::nullopt;
    const std::vector<int> once(kSectors, 1);
    Numbers best{};
    for (int round = 0; round < kRounds; ++round) {
        council.searchCoarsely();
        best = council.descend(council.bestOfGrid(once), once);
        if (!council.settleTemper(best)) break;
    }
    council.searchCoarsely();
    best = council.descend(council.bestOfGrid(once), once);

    std::vector<Numbers> answers(static_cast<std::size_t>(draws));
    parallelFor(0, draws, [&](std::int64_t index) {
        RandomStream random(7, static_cast<std::uint64_t>(index), 0);
        std::vector<int> drawn(kSectors, 0);
        for (int i = 0; i < kSectors; ++i)
            ++drawn[random.below(kSectors)];
        answers[static_cast<std::size_t>(index)] =
            council.descend(council.bestOfGrid(drawn), drawn);
    });
    Numbers squares{};
    for (const Numbers& answer : answers)
        for (std::size_t i = 0; i < squares.size(); ++i)
            squares[i] += (answer[i] - best[i]) * (answer[i] - best[i]) / draws;
    JointFit fit;
    fit.outline = council.outlineOf(best);
    fit.center_sigma = std::sqrt(std::max(squares[0], squares[1]));
    fit.radius_sigma = std::sqrt(squares[2]);
    fit.share = council.shareOf(best);
    fit.cost = council.cost(best, once) / static_cast<double>(costs.rays.size());
    return fit;
}

double shareOfRim(const RimCosts& costs, const Outline& outline, double reach)
{
    Council council(costs, outline, false, reach);
    if (!council.usable()) return 0.0;
    return council.shareOf({});
}

}  // namespace insitu::detail
