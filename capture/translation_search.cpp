#include "capture/pair_alignment.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

namespace insitu::detail {

namespace {

/// The search prefers the smaller of two shifts that fit about equally: what the largest shift
/// costs in correlation.
constexpr double kShiftPenalty = 0.05;
/// Shifts of the coarsest level that are tried on the next one.
constexpr std::size_t kMostCandidates = 16;
/// and how much less alike than the best the pictures may be there.
constexpr double kCandidateMargin = 0.3;
/// Correlations of whole-pixel shifts that may come from the same fit, and of fits that are equal.
constexpr double kTieMargin = 0.12;
constexpr double kSameFit = 0.03;

/// Correlation of a and b shifted, where both are.
double shiftedCorrelation(const Image<float>& a, const Image<float>& b, int dx, int dy)
{
    double n = 0.0;
    double sa = 0.0;
    double sb = 0.0;
    double saa = 0.0;
    double sbb = 0.0;
    double sab = 0.0;
    for (int y = std::max(0, -dy); y < std::min(a.height(), b.height() - dy); ++y) {
        for (int x = std::max(0, -dx); x < std::min(a.width(), b.width() - dx); ++x) {
            const double va = a(x, y);
            const double vb = b(x + dx, y + dy);
            n += 1.0;
            sa += va;
            sb += vb;
            saa += va * va;
            sbb += vb * vb;
            sab += va * vb;
        }
    }
    const double variance = (saa - sa * sa / n) * (sbb - sb * sb / n);
    return n > 0.0 && variance > 0.0 ? (sab - sa * sb / n) / std::sqrt(variance) : -1.0;
}

/// Correlation less what the shift costs.
double scoreOf(const RegistrationLevel& level, Eigen::Vector2i shift, double most)
{
    return shiftedCorrelation(level.a, level.b, shift.x(), shift.y()) -
           kShiftPenalty * shift.squaredNorm() / (most * most);
}

/// All translations within `most` pixels of the coarsest level that fit better than their
/// neighbours, best first, kMostCandidates at most.
std::vector<Eigen::Vector2i> likelyTranslations(const RegistrationLevel& level, double most)
{
    const int limit = static_cast<int>(std::ceil(most));
    const int rx = std::min(limit, level.a.width() / 2);
    const int ry = std::min(limit, level.a.height() / 2);
    Image<double> scores(2 * rx + 1, 2 * ry + 1);
    for (int dy = -ry; dy <= ry; ++dy)
        for (int dx = -rx; dx <= rx; ++dx)
            scores(dx + rx, dy + ry) = scoreOf(level, {dx, dy}, most);

    std::vector<std::pair<double, Eigen::Vector2i>> peaks;
    for (int y = 0; y < scores.height(); ++y) {
        for (int x = 0; x < scores.width(); ++x) {
            bool highest = true;
            for (int ny = std::max(y - 1, 0); ny <= std::min(y + 1, scores.height() - 1); ++ny)
                for (int nx = std::max(x - 1, 0); nx <= std::min(x + 1, scores.width() - 1); ++nx)
                    highest = highest && scores(nx, ny) <= scores(x, y);
            if (highest) peaks.emplace_back(scores(x, y), Eigen::Vector2i(x - rx, y - ry));
        }
    }
    std::ranges::stable_sort(peaks, std::greater<>(), [](const auto& peak) { return peak.first; });
    std::vector<Eigen::Vector2i> shifts;
    for (const auto& [score, shift] : peaks)
        if (shifts.size() < kMostCandidates && score >= peaks.front().first - kCandidateMargin)
            shifts.push_back(shift);
    return shifts;
}

/// The best translation next to each of the candidates, in pixels of `finer`, which has twice the
/// size; those that fit about as well as the best one.
std::vector<Eigen::Vector2i> finerTranslations(const RegistrationLevel& finer,
                                               const std::vector<Eigen::Vector2i>& candidates,
                                               double most)
{
    std::vector<std::pair<double, Eigen::Vector2i>> fits;
    double best = -2.0;
    for (const Eigen::Vector2i& candidate : candidates) {
        std::pair<double, Eigen::Vector2i> fit{-2.0, {0, 0}};
        for (int dy = -1; dy <= 1; ++dy) {
            for (int dx = -1; dx <= 1; ++dx) {
                const Eigen::Vector2i shift = 2 * candidate + Eigen::Vector2i(dx, dy);
                const double score = scoreOf(finer, shift, most);
                if (score > fit.first) fit = {score, shift};
            }
        }
        best = std::max(best, fit.first);
        fits.push_back(fit);
    }
    std::vector<Eigen::Vector2i> shifts;
    for (const auto& [score, shift] : fits)
        if (score >= best - kTieMargin) shifts.push_back(shift);
    return shifts;
}

/// Of several translations that look alike in whole pixels of a level, in a picture that repeats
/// itself, the smallest that fits as well as any once it is exact. Pixels of the full picture.
Eigen::Vector2d smallestFitting(const RegistrationLevel& level,
                                const std::vector<Eigen::Vector2i>& shifts)
{
    std::vector<RegistrationFit> fits;
    double best = -1.0;
    for (const Eigen::Vector2i& shift : shifts) {
        Eigen::Matrix3d start = Eigen::Matrix3d::Identity();
        start.topRightCorner<2, 1>() = level.scale * shift.cast<double>();
        fits.push_back(fitLevel(level, AlignmentModel::Translation, start));
        if (fits.back().valid) best = std::max(best, fits.back().correlation);
    }
    Eigen::Vector2d smallest = level.scale * shifts.front().cast<double>();
    double length = std::numeric_limits<double>::infinity();
    for (const RegistrationFit& fit : fits) {
        const Eigen::Vector2d shift = fit.b_from_a.topRightCorner<2, 1>();
        if (!fit.valid || fit.correlation < best - kSameFit || shift.norm() >= length) continue;
        smallest = shift;
        length = shift.norm();
    }
    return smallest;
}

}  // namespace

Eigen::Vector2d searchTranslation(const std::vector<RegistrationLevel>& levels, double most)
{
    const RegistrationLevel& coarsest = levels.back();
    const std::vector<Eigen::Vector2i> candidates =
        likelyTranslations(coarsest, most / coarsest.scale);
    if (levels.size() == 1) return coarsest.scale * candidates.front().cast<double>();
    const RegistrationLevel& finer = levels[levels.size() - 2];
    const std::vector<Eigen::Vector2i> shifts =
        finerTranslations(finer, candidates, most / finer.scale);
    if (shifts.size() == 1) return finer.scale * shifts.front().cast<double>();
    return smallestFitting(finer, shifts);
}

}  // namespace insitu::detail
