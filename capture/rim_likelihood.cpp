#include "capture/rim_likelihood.h"

#include "core/parallel.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <numeric>

namespace insitu::detail {

using std::numbers::pi;

namespace {

/// Samples of a profile are at least so far apart, or this share of the reach.
constexpr double kFinestStep = 0.5;
constexpr double kStepShare = 1.0 / 16.0;
/// What is looked at beyond the farthest place, as a share of the reach, and at least in pixels.
constexpr double kMarginShare = 0.75;
constexpr double kLeastMargin = 4.0;
/// Walks are blurred on a grid so many times finer than the samples, this far beyond them.
constexpr int kFiner = 3;
constexpr double kBlurReach = 3.5;
/// Standard deviations, in noise, that values wander outside over a pixel and inside over a radian.
constexpr std::array<double, 3> kOutside = {0.2, 2.0, 20.0};
constexpr std::array<double, 3> kInside = {2.0, 20.0, 200.0};
/// ... and those of a step at the rim, beside one like that of this angle inside.
constexpr std::array<double, 2> kStep = {0.0, 300.0};
constexpr double kStepRadians = 0.2;
/// No rim is quite like the model: a pixel's deviation as a share of the step's.
constexpr double kUnlike = 0.015;
constexpr std::size_t kHypotheses = kOutside.size() * kInside.size() * kStep.size();
/// The level of a profile says nothing: its standard deviation in noise.
constexpr double kLevel = 1e4;
/// A layer whose profiles vary less than this (variance in noise) shows nothing: black, or clipped.
constexpr float kLeastVariance = 1.3f;
/// Rounds of finding the proportions of roughness.
constexpr int kRounds = 4;

using Eigen::MatrixXd;
using Eigen::MatrixXf;

/// The places and samples of the profiles.
struct Grid {
    double step = 0.0;
    int margin = 0;  ///< samples beyond the farthest place
    int places = 0;  ///< odd, one a sample
    [[nodiscard]] int samples() const { return places + 2 * margin; }
    /// Pixels outwards from the outline.
    [[nodiscard]] double offsetOf(int sample) const
    {
        return (sample - 0.5 * (samples() - 1)) * step;
    }
};

Grid gridFor(double reach)
{
    Grid grid;
    grid.step = std::max(kFinestStep, kStepShare * reach);
    grid.margin =
        static_cast<int>(std::ceil(std::max(kMarginShare * reach, kLeastMargin) / grid.step));
    grid.places = 2 * static_cast<int>(std::ceil(reach / grid.step)) + 1;
    return grid;
}

/// The samples' covariances by the walk outside (of 1 a pixel), the walk inside (of 1 a radian) and
/// a step of 1 at the rim, all blurred.
struct Covariances {
    MatrixXd outside;
    MatrixXd inside;
    MatrixXd step;
};

Covariances covariancesFor(const Grid& grid, double place, double radius, double blur)
{
    const double fine_step = grid.step / kFiner;
    const int extra = static_cast<int>(std::ceil(kBlurReach * blur / fine_step));
    const int fine = (grid.samples() - 1) * kFiner + 1 + 2 * extra;
    const auto placeOf = [&](int i) { return grid.offsetOf(0) + (i - extra) * fine_step; };
    std::vector<double> kernel;
    for (int j = -extra; j <= extra; ++j)
        kernel.push_back(std::exp(-0.5 * std::pow(j * fine_step / blur, 2)));
    const double kernel_sum = std::accumulate(kernel.begin(), kernel.end(), 0.0);
    Eigen::SparseMatrix<double, Eigen::RowMajor> spread(grid.samples(), fine);
    for (int i = 0; i < grid.samples(); ++i)
        for (int j = 0; j <= 2 * extra; ++j)
            spread.insert(i, i * kFiner + j) = kernel[static_cast<std::size_t>(j)] / kernel_sum;
    MatrixXd outside = MatrixXd::Zero(fine, fine);
    MatrixXd inside = MatrixXd::Zero(fine, fine);
    Eigen::VectorXd step = Eigen::VectorXd::Zero(fine);
    const auto angleAt = [&](int i) {
        return 2.0 * std::sqrt(2.0 * std::max(place - placeOf(i), 0.0) / radius);
    };
    for (int i = 0; i < fine; ++i) {
        const bool i_inside = placeOf(i) < place - 0.25 * fine_step;
        const bool at_rim = !i_inside && placeOf(i) < place + 0.25 * fine_step;
        step(i) = at_rim ? 0.5 : i_inside ? 1.0 : 0.0;
        for (int j = 0; j <= i; ++j) {
            const bool j_inside = placeOf(j) < place - 0.25 * fine_step;
            if (i_inside && j_inside)
                inside(i, j) = inside(j, i) = std::min(angleAt(i), angleAt(j));
            else if (!i_inside && !j_inside)
                outside(i, j) = outside(j, i) =
                    std::max(std::min(placeOf(i), placeOf(j)) - place, 0.0);
        }
    }
    const Eigen::VectorXd blurred = spread * step;
    return {spread * MatrixXd(spread * outside).transpose(),
            spread * MatrixXd(spread * inside).transpose(),
            blurred * blurred.transpose()};
}

/// What turns profiles into white noise, for one place and roughness.
struct Whitening {
    MatrixXf matrix;
    float log_root = 0.0f;  ///< logarithm of the root of the covariance's determinant
};

Whitening whiteningFor(const Covariances& parts, std::size_t hypothesis)
{
    const Eigen::Index n = parts.outside.rows();
    const double out = kOutside[hypothesis % kOutside.size()];
    const double in = kInside[hypothesis / kOutside.size() % kInside.size()];
    const double step = kStep[hypothesis / (kOutside.size() * kInside.size())];
    MatrixXd covariance = out * out * parts.outside + in * in * parts.inside +
                          (kStepRadians * in * in + step * step) * parts.step +
                          MatrixXd::Constant(n, n, kLevel * kLevel);
    covariance.diagonal().array() +=
        1.0 + kUnlike * kUnlike * (kStepRadians * in * in + step * step);
    const Eigen::LLT<MatrixXd> factor(covariance);
    const MatrixXd lower = factor.matrixL();
    return {lower.triangularView<Eigen::Lower>().solve(MatrixXd::Identity(n, n)).cast<float>(),
            static_cast<float>(lower.diagonal().array().log().sum())};
}

/// Columns of a layer that shows something, one a ray.
std::vector<MatrixXf> layersOf(const std::vector<MatrixXf>& profiles,
                               const std::vector<std::size_t>& used)
{
    std::vector<MatrixXf> layers;
    if (used.empty()) return layers;
    const Eigen::Index samples = profiles[used[0]].rows();
    for (Eigen::Index layer = 0; layer < profiles[used[0]].cols(); ++layer) {
        MatrixXf columns(samples, static_cast<Eigen::Index>(used.size()));
        for (std::size_t k = 0; k < used.size(); ++k)
            columns.col(static_cast<Eigen::Index>(k)) = profiles[used[k]].col(layer);
        columns.rowwise() -= columns.colwise().mean().eval();
        const float variance =
            columns.squaredNorm() / static_cast<float>((samples - 1) * columns.cols());
        if (variance >= kLeastVariance) layers.push_back(std::move(columns));
    }
    return layers;
}

/// Costs of one layer by place and roughness: a row for each, a column for each ray.
using LayerCosts = std::vector<std::array<Eigen::RowVectorXf, kHypotheses>>;

/// Minus the logarithm of the mixture of all roughnesses in proportions that the layer shows:
/// expectation and maximisation over rays, each at its best place. Adds to `sums`, a row for each
/// place.
void addMixture(const LayerCosts& costs, double temper, MatrixXd& sums)
{
    const auto rays = sums.cols();
    const auto places = sums.rows();
    std::array<double, kHypotheses> shares;
    shares.fill(1.0 / kHypotheses);
    std::array<double, kHypotheses> parts{};
    const auto mixAt = [&](Eigen::Index place, Eigen::Index ray) {
        const auto& by = costs[static_cast<std::size_t>(place)];
        double least = by[0](ray);
        for (const Eigen::RowVectorXf& cost : by)
            least = std::min(least, static_cast<double>(cost(ray)));
        double sum = 0.0;
        for (std::size_t h = 0; h < kHypotheses; ++h) {
            parts[h] = shares[h] * std::exp(temper * (least - by[h](ray)));
            sum += parts[h];
        }
        for (double& part : parts)
            part /= sum;
        return temper * least - std::log(sum);
    };
    for (int round = 0; round < kRounds; ++round) {
        std::array<double, kHypotheses> found;
        found.fill(0.5);  // half a ray for each, so that none is excluded
        for (Eigen::Index ray = 0; ray < rays; ++ray) {
            double best = std::numeric_limits<double>::infinity();
            std::array<double, kHypotheses> best_parts{};
            for (Eigen::Index place = 0; place < places; ++place) {
                const double cost = mixAt(place, ray);
                if (cost >= best) continue;
                best = cost;
                best_parts = parts;
            }
            for (std::size_t h = 0; h < kHypotheses; ++h)
                found[h] += best_parts[h];
        }
        double all = 0.0;
        for (const double share : found)
            all += share;
        for (std::size_t h = 0; h < kHypotheses; ++h)
            shares[h] = found[h] / all;
    }
    for (Eigen::Index ray = 0; ray < rays; ++ray)
        for (Eigen::Index place = 0; place < places; ++place)
            sums(place, ray) += mixAt(place, ray);
}

/// Pixels around the outline in one of the rays, made odd so that they lie around its middle.
int raysAveraged(double radius)
{
    const int pixels = static_cast<int>(2.0 * pi * radius / kRimRays);
    return std::clamp(pixels | 1, 1, 7);
}

}  // namespace

RimCosts rimCosts(const OutlinePicture& picture, const Outline& outline, double reach, double blur)
{
    const Grid grid = gridFor(reach);
    const int averaged = raysAveraged(outline.radius);
    const std::vector<MatrixXf> fine = rayProfiles(
        picture, outline, kRimRays * averaged, grid.samples(), grid.step, 2.0 * pi / kRimRays);
    std::vector<MatrixXf> profiles(kRimRays);
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < profiles.size(); ++i) {
        profiles[i] = fine[i * static_cast<std::size_t>(averaged)];
        if (profiles[i].size() > 0) used.push_back(i);
    }
    const std::vector<MatrixXf> layers = layersOf(profiles, used);

    std::vector<LayerCosts> costs(layers.size(), LayerCosts(static_cast<std::size_t>(grid.places)));
    parallelFor(0, grid.places, [&](std::int64_t index) {
        const auto place = static_cast<std::size_t>(index);
        const Covariances parts = covariancesFor(
            grid, grid.offsetOf(static_cast<int>(index) + grid.margin), outline.radius, blur);
        for (std::size_t h = 0; h < kHypotheses; ++h) {
            const Whitening white = whiteningFor(parts, h);
            for (std::size_t layer = 0; layer < layers.size(); ++layer)
                costs[layer][place][h] =
                    0.5f * (white.matrix * layers[layer]).colwise().squaredNorm().array() +
                    white.log_root;
        }
    });
    // Samples nearer than a pixel repeat each other.
    const double temper = std::min(grid.step, 1.0);
    MatrixXd sums = MatrixXd::Zero(grid.places, static_cast<Eigen::Index>(used.size()));
    for (const LayerCosts& layer : costs)
        addMixture(layer, temper, sums);

    RimCosts result{grid.offsetOf(grid.margin), grid.step, {}, 0.0};
    result.rays.resize(kRimRays);
    for (std::size_t k = 0; k < used.size(); ++k) {
        const auto column = sums.col(static_cast<Eigen::Index>(k)).array();
        result.least += column.minCoeff();
        const Eigen::ArrayXd above = column - column.minCoeff();
        result.rays[used[k]].assign(above.begin(), above.end());
    }
    return result;
}

}  // namespace insitu::detail
