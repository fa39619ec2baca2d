#include "capture/pair_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

// Inverse compositional Gauss-Newton [BakMat04], section 3.2: find the transform W with
// b(W(x)) = a(x). With M a small motion of a's own pixels,
//
//     sum_i w_i (b(W(x_i)) - a(M(x_i)))^2,   a(M(x)) ~ a(x) + grad a . J p
//
// is linear in M's parameters p, and W <- W M^-1. The gradients and J are those of `a` and stay the
// same. Parameters are all in pixels: x is taken about the picture's centre, u = (x - c) / h with
// half diagonal h, so that a parameter of 1 moves the far corners by about a pixel.
//
// Weights fall with the residual (Geman & McClure's [GemMcC87]), its scale being the median one:
// people who walk through the picture and rank matching that errs in places pull little. A block of
// the picture in which most points fit badly is itself one that moved: it counts by its points'
// mean weight squared.
//
// Certainty: with g_B the sum of w r J' grad a over block B of the picture and H the normal matrix,
// cov p = H^-1 (sum_B g_B g_B') H^-1 [LiaZeg86], which counts blocks and not pixels: noise that
// neighbours share, or a block that moves by itself, is seen for what it is.

namespace insitu::detail {

namespace {

constexpr int kMostIterations = 30;
/// Converged when no corner moves farther, pixels of the level.
constexpr double kConverged = 2e-3;
/// A step of more is a runaway: half diagonals.
constexpr double kRunaway = 0.5;
/// Residuals of this many standard deviations have a quarter of the weight of small ones.
constexpr float kRobustSigmas = 3.0f;
/// Share of the points that must lie in both pictures.
constexpr double kLeastOverlap = 0.3;

/// A model is known by its number of parameters.
constexpr int kTranslation = 2;
constexpr int kEuclidean = 3;
constexpr int kHomography = 8;

/// From pixels of a level to coordinates about its centre, unit half diagonal.
struct Frame {
    Eigen::Matrix3d unit_from_level;
    Eigen::Matrix3d level_from_unit;
    double half_diagonal = 1.0;

    explicit Frame(const Image<float>& image)
    {
        half_diagonal = 0.5 * std::hypot(image.width(), image.height());
        level_from_unit << half_diagonal, 0, 0.5 * image.width(), 0, half_diagonal,
            0.5 * image.height(), 0, 0, 1;
        unit_from_level = level_from_unit.inverse();
    }

    /// The motion M of the parameters, in pixels of the level.
    template <int N>
    [[nodiscard]] Eigen::Matrix3d motion(const Eigen::Matrix<double, N, 1>& p) const
    {
        const Eigen::Matrix<double, N, 1> q = p / half_diagonal;
        Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
        m(0, 2) = q[0];
        m(1, 2) = q[1];
        if constexpr (N == kEuclidean) {
            m(0, 0) = m(1, 1) = std::cos(q[2]);
            m(1, 0) = std::sin(q[2]);
            m(0, 1) = -m(1, 0);
        } else if constexpr (N == kHomography) {
            m(0, 0) += q[2];
            m(0, 1) = q[3];
            m(1, 0) = q[4];
            m(1, 1) += q[5];
            m(2, 0) = q[6];
            m(2, 1) = q[7];
        }
        return level_from_unit * m * unit_from_level;
    }
};

/// d(displacement)/d(parameters) at (u, v).
template <int N>
Eigen::Matrix<double, 2, N> displacementJacobian(double u, double v)
{
    Eigen::Matrix<double, 2, N> j = Eigen::Matrix<double, 2, N>::Zero();
    j(0, 0) = j(1, 1) = 1.0;
    if constexpr (N == kEuclidean) {
        j(0, 2) = -v;
        j(1, 2) = u;
    } else if constexpr (N == kHomography) {
        j.col(2) << u, 0.0;
        j.col(3) << v, 0.0;
        j.col(4) << 0.0, u;
        j.col(5) << 0.0, v;
        j.col(6) << -u * u, -u * v;
        j.col(7) << -u * v, -v * v;
    }
    return j;
}

/// b at column and row index (x, y) inside the picture, bilinear.
float sampleAt(const Image<float>& image, double x, double y)
{
    const int x0 = std::min(static_cast<int>(x), image.width() - 2);
    const int y0 = std::min(static_cast<int>(y), image.height() - 2);
    const auto tx = static_cast<float>(x - x0);
    const auto ty = static_cast<float>(y - y0);
    const float upper = image(x0, y0) + tx * (image(x0 + 1, y0) - image(x0, y0));
    const float lower = image(x0, y0 + 1) + tx * (image(x0 + 1, y0 + 1) - image(x0, y0 + 1));
    return upper + ty * (lower - upper);
}

/// The registration of one level while it is being solved.
template <int N>
class Registration {
public:
    explicit Registration(const RegistrationLevel& level) : level_(level), frame_(level.a)
    {
        jacobians_.reserve(level.points.size());
        for (const RegistrationLevel::Point& point : level.points) {
            const double u = (point.x + 0.5 - 0.5 * level.a.width()) / frame_.half_diagonal;
            const double v = (point.y + 0.5 - 0.5 * level.a.height()) / frame_.half_diagonal;
            const Eigen::RowVector2d gradient(point.gradient_x, point.gradient_y);
            jacobians_.push_back(
                (gradient * displacementJacobian<N>(u, v)).transpose().template cast<float>());
        }
        residuals_.resize(level.points.size());
    }

    RegistrationFit solve(const Eigen::Matrix3d& start)
    {
        const Eigen::Matrix3d full_from_level =
            Eigen::Vector3d(level_.scale, level_.scale, 1.0).asDiagonal();
        RegistrationFit fit;
        Eigen::Matrix3d w = full_from_level.inverse() * start * full_from_level;
        for (int i = 0; i < kMostIterations; ++i) {
            if (!measure(w)) return fit;
            accumulate();
            const Parameters step = solveNormal(score_);
            if (!step.allFinite() || step.norm() > kRunaway * frame_.half_diagonal) return fit;
            w = w * frame_.motion<N>(step).inverse();
            w /= w(2, 2);
            if (cornerShift(frame_.motion<N>(step), level_.a.width(), level_.a.height()) <
                kConverged)
                break;
        }
        if (!measure(w)) return fit;
        accumulate();
        fit.valid = true;
        fit.b_from_a = full_from_level * w * full_from_level.inverse();
        fit.sigma_px = level_.scale * worstCornerSigma();
        fit.correlation = correlation(w);
        return fit;
    }

private:
    using Parameters = Eigen::Matrix<double, N, 1>;
    using Normal = Eigen::Matrix<double, N, N>;

    /// Residuals b(W(x)) - a(x), NaN outside; false when too few are inside.
    bool measure(const Eigen::Matrix3d& w)
    {
        std::size_t inside = 0;
        sizes_.clear();
        for (std::size_t i = 0; i < level_.points.size(); ++i) {
            const RegistrationLevel::Point& point = level_.points[i];
            const Eigen::Vector3d at = w * Eigen::Vector3d(point.x + 0.5, point.y + 0.5, 1.0);
            const double x = at.x() / at.z() - 0.5;
            const double y = at.y() / at.z() - 0.5;
            residuals_[i] = std::numeric_limits<float>::quiet_NaN();
            if (!(at.z() > 0.0 && x >= 0.0 && y >= 0.0 && x <= level_.b.width() - 1.0 &&
                  y <= level_.b.height() - 1.0))
                continue;
            residuals_[i] = sampleAt(level_.b, x, y) - point.value;
            sizes_.push_back(std::abs(residuals_[i]));
            ++inside;
        }
        if (static_cast<double>(inside) <
            std::max(4.0 * N, kLeastOverlap * static_cast<double>(level_.points.size())))
            return false;
        const auto middle = sizes_.begin() + static_cast<std::ptrdiff_t>(sizes_.size() / 2);
        std::nth_element(sizes_.begin(), middle, sizes_.end());
        // 1.4826: standard deviation of a normal distribution from its median size.
        robust_scale_ = std::max(kRobustSigmas * 1.4826f * *middle, 0.05f);
        return true;
    }

    [[nodiscard]] float weightOf(float residual) const
    {
        const float q = residual / robust_scale_;
        const float root = 1.0f / (1.0f + q * q);
        return root * root;
    }

    void accumulate()
    {
        normal_.setZero();
        score_.setZero();
        block_scores_.assign(static_cast<std::size_t>(level_.blocks), Parameters::Zero());
        block_information_.assign(static_cast<std::size_t>(level_.blocks), 0.0);
        Eigen::Matrix<float, N, N> block_normal = Eigen::Matrix<float, N, N>::Zero();
        Eigen::Matrix<float, N, 1> block_score = Eigen::Matrix<float, N, 1>::Zero();
        float weights = 0.0f;
        float inside = 0.0f;
        for (std::size_t i = 0; i < level_.points.size(); ++i) {
            if (const float r = residuals_[i]; !std::isnan(r)) {
                const float weight = weightOf(r);
                block_normal.noalias() += (weight * jacobians_[i]) * jacobians_[i].transpose();
                block_score.noalias() += weight * r * jacobians_[i];
                weights += weight;
                inside += 1.0f;
            }
            const bool block_ends = i + 1 == level_.points.size() ||
                                    level_.points[i + 1].block != level_.points[i].block;
            if (!block_ends) continue;
            const auto block = static_cast<std::size_t>(level_.points[i].block);
            const double trust = inside > 0.0f ? weights / inside : 0.0f;
            block_scores_[block] = trust * trust * block_score.template cast<double>();
            block_information_[block] = trust * trust * block_normal.trace();
            normal_ += trust * trust * block_normal.template cast<double>();
            score_ += block_scores_[block];
            block_normal.setZero();
            block_score.setZero();
            weights = inside = 0.0f;
        }
        // Directions that nothing is known of must not blow up, but stay uncertain.
        normal_.diagonal().array() += 1e-9 * normal_.trace() + 1e-12;
    }

    [[nodiscard]] Parameters solveNormal(const Parameters& right) const
    {
        return normal_.ldlt().solve(right);
    }

    [[nodiscard]] double worstCornerSigma() const
    {
        Normal scatter = Normal::Zero();
        for (const Parameters& score : block_scores_)
            scatter += score * score.transpose();
        // Blocks that weigh little hardly count: a picture with one window in it has few blocks.
        double sum = 0.0;
        double squares = 0.0;
        for (const double weight : block_information_) {
            sum += weight;
            squares += weight * weight;
        }
        const double blocks = squares > 0.0 ? sum * sum / squares : 0.0;
        if (blocks < N + 2.0) return std::numeric_limits<double>::infinity();
        const Normal inverse = normal_.inverse();
        const Normal covariance = inverse * scatter * inverse * blocks / (blocks - N);
        double worst = 0.0;
        for (const double sx : {-1.0, 1.0}) {
            for (const double sy : {-1.0, 1.0}) {
                const auto j =
                    displacementJacobian<N>(sx * 0.5 * level_.a.width() / frame_.half_diagonal,
                                            sy * 0.5 * level_.a.height() / frame_.half_diagonal);
                worst = std::max(worst, (j * covariance * j.transpose()).trace());
            }
        }
        return std::sqrt(worst);
    }

    /// Of the gradients, not of the values: the points of a regular pattern's edges are all alike
    /// in value.
    [[nodiscard]] double correlation(const Eigen::Matrix3d& w) const
    {
        double saa = 0.0;
        double sbb = 0.0;
        double sab = 0.0;
        for (const RegistrationLevel::Point& point : level_.points) {
            const Eigen::Vector2d at =
                (w * Eigen::Vector3d(point.x + 0.5, point.y + 0.5, 1.0)).hnormalized() -
                Eigen::Vector2d(0.5, 0.5);
            if (!(at.x() >= 1.0 && at.y() >= 1.0 && at.x() <= level_.b.width() - 2.0 &&
                  at.y() <= level_.b.height() - 2.0))
                continue;
            const double bx = 0.5 * (sampleAt(level_.b, at.x() + 1.0, at.y()) -
                                     sampleAt(level_.b, at.x() - 1.0, at.y()));
            const double by = 0.5 * (sampleAt(level_.b, at.x(), at.y() + 1.0) -
                                     sampleAt(level_.b, at.x(), at.y() - 1.0));
            saa += point.gradient_x * point.gradient_x + point.gradient_y * point.gradient_y;
            sbb += bx * bx + by * by;
            sab += point.gradient_x * bx + point.gradient_y * by;
        }
        return saa * sbb > 0.0 ? sab / std::sqrt(saa * sbb) : 0.0;
    }

    const RegistrationLevel& level_;
    Frame frame_;
    std::vector<Eigen::Matrix<float, N, 1>> jacobians_;
    std::vector<float> residuals_;  ///< NaN: outside
    std::vector<float> sizes_;
    float robust_scale_ = 1.0f;
    Normal normal_;
    Parameters score_;
    std::vector<Parameters> block_scores_;
    std::vector<double> block_information_;  ///< trace of each block's part of normal_
};

}  // namespace

double cornerDifference(const Eigen::Matrix3d& first,
                        const Eigen::Matrix3d& second,
                        int width,
                        int height)
{
    double longest = 0.0;
    for (const double x : {0.0, static_cast<double>(width)}) {
        for (const double y : {0.0, static_cast<double>(height)}) {
            const Eigen::Vector3d corner(x, y, 1.0);
            longest = std::max(
                longest, ((first * corner).hnormalized() - (second * corner).hnormalized()).norm());
        }
    }
    return longest;
}

double cornerShift(const Eigen::Matrix3d& b_from_a, int width, int height)
{
    return cornerDifference(b_from_a, Eigen::Matrix3d::Identity(), width, height);
}

RegistrationFit fitLevel(const RegistrationLevel& level,
                         AlignmentModel model,
                         const Eigen::Matrix3d& b_from_a)
{
    switch (model) {
        case AlignmentModel::Translation:
            return Registration<kTranslation>(level).solve(b_from_a);
        case AlignmentModel::Euclidean:
            return Registration<kEuclidean>(level).solve(b_from_a);
        case AlignmentModel::Homography:
            return Registration<kHomography>(level).solve(b_from_a);
    }
    return {};
}

}  // namespace insitu::detail
