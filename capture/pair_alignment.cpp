#include "capture/pair_alignment.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>

namespace insitu::detail {

namespace {

/// Pictures whose long side is less tell no perspective.
constexpr int kLeastHomographySide = 200;
/// From this long side on the first pass leaves the finest level out.
constexpr int kCoarsenFrom = 400;
/// Frames less alike than this, at the points with contrast, do not show the same.
constexpr double kLeastCorrelation = 0.35;
/// An uncertainty of more is no answer, pixels of the full picture per 1000 of its long side.
constexpr double kWorstSigmaPerMille = 1.0;
/// A richer model must move a corner by this many standard deviations relative to the simpler one.
constexpr double kSignificance = 4.0;
/// and by at least this, pixels of the full picture.
constexpr double kLeastGainPx = 0.05;

/// The whole-picture part of a transform: how the middle moves.
Eigen::Matrix3d translationOf(const Eigen::Matrix3d& b_from_a, int width, int height)
{
    const Eigen::Vector2d middle(0.5 * width, 0.5 * height);
    Eigen::Matrix3d result = Eigen::Matrix3d::Identity();
    result.topRightCorner<2, 1>() = (b_from_a * middle.homogeneous()).hnormalized() - middle;
    return result;
}

/// Registers two frames in two passes: the first one finds the overlap and needs no fine detail;
/// then ranks are matched anew where both show the scene, and the finest level decides.
class PairAligner {
public:
    PairAligner(const BracketFrame& a, const BracketFrame& b, const AlignmentOptions& options)
        : a_(a),
          b_(b),
          options_(options),
          width_(a.image.codes.width()),
          height_(a.image.codes.height()),
          long_side_(std::max(width_, height_))
    {
    }

    PairFit align()
    {
        PairFit result;
        if (!findOverlap(result.reason)) return result;
        refine(result);
        return result;
    }

private:
    /// Coarse to fine over all levels but the finest of a large picture.
    bool findOverlap(std::string& reason)
    {
        const int coarsening = long_side_ >= kCoarsenFrom ? 2 : 1;
        const std::optional<MatchedPyramids> images =
            matchPyramids(a_, b_, glm::dmat3(1.0), coarsening, reason);
        if (!images) return false;
        std::vector<RegistrationLevel> levels;
        for (std::size_t l = 0; l < images->a.size(); ++l)
            levels.push_back(makeLevel(
                images->a[l], images->b[l], images->factor * std::ldexp(1.0, static_cast<int>(l))));
        euclidean_.topRightCorner<2, 1>() =
            searchTranslation(levels, options_.max_shift_fraction * long_side_);
        for (std::size_t l = levels.size(); l-- > 0;)
            fitCoarse(levels[l]);
        return true;
    }

    /// A step from one level to the next for the models that are carried along.
    void fitCoarse(const RegistrationLevel& level)
    {
        if (options_.model == AlignmentModel::Translation) {
            const RegistrationFit fit = fitLevel(level, AlignmentModel::Translation, euclidean_);
            if (fit.valid) euclidean_ = fit.b_from_a;
            return;
        }
        const RegistrationFit fit = fitLevel(level, AlignmentModel::Euclidean, euclidean_);
        if (fit.valid) euclidean_ = fit.b_from_a;
        const bool large = std::max(level.a.width(), level.a.height()) >= kLeastHomographySide;
        if (options_.model == AlignmentModel::Homography && large) {
            const RegistrationFit rich =
                fitLevel(level, AlignmentModel::Homography, homography_.value_or(euclidean_));
            if (rich.valid && rich.correlation >= fit.correlation) homography_ = rich.b_from_a;
        }
    }

    void refine(PairFit& result) const
    {
        const std::optional<MatchedPyramids> images =
            matchPyramids(a_, b_, toGlm(euclidean_), 1, result.reason);
        if (!images) return;
        const RegistrationLevel level =
            makeLevel(images->a.front(), images->b.front(), images->factor);
        double best_correlation = 0.0;
        for (int m = 0; m <= static_cast<int>(options_.model); ++m) {
            const auto model = static_cast<AlignmentModel>(m);
            const RegistrationFit fit = fitLevel(level, model, startOf(model));
            if (!fit.valid) continue;
            best_correlation = std::max(best_correlation, fit.correlation);
            if (isBetter(fit, result)) {
                result.found = true;
                result.b_from_a = fit.b_from_a;
                result.model = model;
                result.sigma_px = fit.sigma_px;
            }
        }
        if (!result.found)
            result.reason = best_correlation < kLeastCorrelation ? "they show too little in common"
                                                                 : "they show too little detail";
    }

    [[nodiscard]] Eigen::Matrix3d startOf(AlignmentModel model) const
    {
        if (model == AlignmentModel::Translation) return translationOf(euclidean_, width_, height_);
        if (model == AlignmentModel::Euclidean) return euclidean_;
        return homography_.value_or(euclidean_);
    }

    /// A richer model is worth its parameters when it moves a corner by more than it is uncertain.
    [[nodiscard]] bool isBetter(const RegistrationFit& fit, const PairFit& simpler) const
    {
        if (fit.correlation < kLeastCorrelation ||
            fit.sigma_px > 1e-3 * kWorstSigmaPerMille * long_side_)
            return false;
        if (!simpler.found) return true;
        return cornerDifference(fit.b_from_a, simpler.b_from_a, width_, height_) >
               std::max(kLeastGainPx, kSignificance * fit.sigma_px);
    }

    const BracketFrame& a_;
    const BracketFrame& b_;
    const AlignmentOptions& options_;
    int width_;
    int height_;
    int long_side_;
    Eigen::Matrix3d euclidean_ = Eigen::Matrix3d::Identity();
    std::optional<Eigen::Matrix3d> homography_;
};

}  // namespace

glm::dmat3 toGlm(const Eigen::Matrix3d& m)
{
    glm::dmat3 result(1.0);
    for (int column = 0; column < 3; ++column)
        for (int row = 0; row < 3; ++row)
            result[column][row] = m(row, column);
    return result;
}

PairFit alignPair(const BracketFrame& a, const BracketFrame& b, const AlignmentOptions& options)
{
    return PairAligner(a, b, options).align();
}

}  // namespace insitu::detail
