#include "capture/response_solve.h"

#include "capture/response_samples.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

// The problem. A patch i of constant radiance exp(E_i) is seen by frame k with exposure t_k; the
// mean of its decoded pixels must be t_k exp(E_i). With g = ln(exposure by code) and h_z the share
// of the patch's pixels that have code z:
//
//     r_ik = ln sum_z h_z exp(g_z)  -  ln t_k  -  E_i
//
// With single pixels this is [DebMal97] eq. 3, g(Z_ik) - ln t_k - E_i. Averaging the decoded pixels
// and not the codes keeps the noise of the sensor, which has mean zero in exposure but not after
// the curve, from bending the curve where it is dark. What a frame should show is predicted from
// the patch's other frames, m'_ik; ln m is taken as ln m' + m/m' - 1, which is linear in the noise,
// and whether a frame counts is decided by m', not by the noisy codes themselves: either would pull
// the curve at both ends. Linearised about a current g (Gauss-Newton),
//
//     r_ik = sum_z p_z g_z - y_ik - E_i,   p_z = h_z exp(g_z) / m',
//
// so each step is Debevec and Malik's linear least squares with a spread-out row. E_i is
// eliminated exactly (Schur complement), which leaves 256 unknowns whatever the number of samples.
//
// Smoothness. Ratios of exposures leave a curve undetermined up to any function that repeats with
// the bracket's step (2 EV in many brackets): only smoothness decides, and no residual shows a
// wrong choice. So the prior must be one that cameras' curves really obey, and be strong. Their
// slope s = dg/du with u = ln(code) drifts slowly, up to the shoulder, where it rises fast; so we
// penalise
//
//     lambda * integral (d3g/du3)^2 (1 - (z/255)^2)^4 du,   u = ln(z + kCodeOffset).
//
// A repeating error of 0.01 EV has |d3g/du3| near 7, power laws and their shoulders below 1 up to
// code 160. In the truth rooms any lambda from 30 to 300 does equally well.

namespace insitu::detail {

namespace {

constexpr int kCodes = 256;
constexpr double kCodeOffset = 2.0;
/// Rounding to codes (1/sqrt(12)) and the JPEG, as left in the mean of a patch. Codes.
constexpr double kCodeFloor = 0.1;
/// What remains of ln exposure when noise is averaged out: shared JPEG colour, uneven patches.
/// Without it a few very quiet bright patches would outvote all others.
constexpr double kModelFloor = 0.02;
constexpr double kGaugeWeight = 1e-9;
constexpr int kGaussNewtonSteps = 6;
/// The first steps use the patches' mean codes, plain [DebMal97]: a safe start.
constexpr int kMeanCodeSteps = 2;
/// Darker patches are left out: below, the sensor's floor cuts off half of the noise.
constexpr double kLowestPredictedCode = 8.0;
/// Residuals beyond this many standard deviations lose weight (Huber).
constexpr double kHuber = 2.5;

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// Normal equations of the curve alone, A g = b.
struct NormalSystem {
    Matrix a = Matrix::Zero(kCodes, kCodes);
    Vector b = Vector::Zero(kCodes);
};

using Row = std::vector<std::pair<int, double>>;

/// A linearised observation.
struct Linear {
    Row row;
    double target = 0.0;
    double weight = 0.0;
};

/// sum_z h_z exp(g_z)
double decodedMean(const PatchObservation& observation, const Vector& g)
{
    double mean = 0.0;
    for (const auto& [code, share] : observation.histogram)
        mean += share * std::exp(g[code]);
    return mean;
}

double slopeAt(const Vector& g, double code)
{
    const int z = std::clamp(static_cast<int>(code), 2, kCodes - 3);
    return std::max(0.25 * (g[z + 2] - g[z - 2]), 1e-4);
}

/// Variance of a pixel's code by code: medians over flat patches, 16 codes a bin.
class CodeNoise {
public:
    explicit CodeNoise(const std::vector<PatchObservations>& patches)
    {
        std::array<std::vector<double>, kBins> values;
        for (const PatchObservations& patch : patches)
            for (const PatchObservation& o : patch)
                values[static_cast<std::size_t>(o.mean_code / kBinCodes)].push_back(
                    o.code_variance);
        double last = 1.0 / 12.0;
        for (std::size_t i = 0; i < kBins; ++i) {
            if (values[i].size() >= 3) {
                auto middle = values[i].begin() + static_cast<std::ptrdiff_t>(values[i].size() / 2);
                std::ranges::nth_element(values[i], middle);
                last = *middle;
            }
            variance_[i] = last;
        }
    }
    [[nodiscard]] double variance(double code) const
    {
        return variance_[static_cast<std::size_t>(code / kBinCodes)];
    }

private:
    static constexpr std::size_t kBins = 16;
    static constexpr double kBinCodes = 16.0;
    std::array<double, kBins> variance_{};
};

/// Code at which the curve reaches a log exposure; a curve that dips is taken as its running
/// maximum.
class InverseCurve {
public:
    explicit InverseCurve(const Vector& g) : rising_(g.data(), g.data() + kCodes)
    {
        for (std::size_t z = 1; z < rising_.size(); ++z)
            rising_[z] = std::max(rising_[z], rising_[z - 1]);
    }
    [[nodiscard]] double code(double log_exposure) const
    {
        const auto above = std::ranges::upper_bound(rising_, log_exposure);
        if (above == rising_.begin()) return 0.0;
        if (above == rising_.end()) return kCodes - 1.0;
        const double low = above[-1];
        return static_cast<double>(above - rising_.begin() - 1) +
               (log_exposure - low) / (*above - low);
    }

private:
    std::vector<double> rising_;
};

double weightAt(double code, const Vector& g, const CodeNoise& noise)
{
    const double slope = slopeAt(g, code);
    const double variance =
        noise.variance(code) / (kPatchSide * kPatchSide) + kCodeFloor * kCodeFloor;
    return 1.0 / (slope * slope * variance + kModelFloor * kModelFloor);
}

/// [DebMal97] eq. 3 at the patch's mean code.
Linear lineariseMeanCode(const PatchObservation& o, const Vector& g, const CodeNoise& noise)
{
    const int low = std::min(static_cast<int>(o.mean_code), kCodes - 2);
    const double t = o.mean_code - low;
    return {{{low, 1.0 - t}, {low + 1, t}}, o.log_exposure, weightAt(o.mean_code, g, noise)};
}

/// The mean exposure of the patch's pixels about the `predicted` one (ln).
Linear lineariseMeanExposure(const PatchObservation& o,
                             const Vector& g,
                             double predicted,
                             double weight)
{
    Linear linear;
    linear.weight = weight;
    const double scale = std::exp(-predicted);
    double ratio = 0.0;
    double at_g = 0.0;
    for (const auto& [code, share] : o.histogram) {
        const double p = share * std::exp(g[code]) * scale;
        linear.row.emplace_back(code, p);
        ratio += p;
        at_g += p * g[code];
    }
    linear.target = o.log_exposure - predicted - (ratio - 1.0) + at_g;
    return linear;
}

std::vector<Linear> linearisePatch(const PatchObservations& patch,
                                   const Vector& g,
                                   const CodeNoise& noise,
                                   bool by_mean_code)
{
    std::vector<Linear> result;
    if (by_mean_code) {
        for (const PatchObservation& o : patch)
            if (o.clean) result.push_back(lineariseMeanCode(o, g, noise));
        return result;
    }
    double sum = 0.0;
    double total = 0.0;
    std::vector<std::pair<double, double>> estimates;  // ln radiance, weight
    for (const PatchObservation& o : patch) {
        const double weight = o.clean ? weightAt(o.mean_code, g, noise) : 0.0;
        const double radiance = weight > 0.0 ? std::log(decodedMean(o, g)) - o.log_exposure : 0.0;
        estimates.emplace_back(radiance, weight);
        sum += weight * radiance;
        total += weight;
    }
    const InverseCurve inverse(g);
    for (std::size_t k = 0; k < patch.size(); ++k) {
        const double others = total - estimates[k].second;
        if (!(others > 0.0)) continue;
        const double predicted =
            (sum - estimates[k].second * estimates[k].first) / others + patch[k].log_exposure;
        const double code = inverse.code(predicted);
        if (code < kLowestPredictedCode) continue;
        if (code + 3.0 * std::sqrt(noise.variance(code)) > kHighestUsefulCode) continue;
        result.push_back(lineariseMeanExposure(patch[k], g, predicted, weightAt(code, g, noise)));
    }
    return result;
}

double dotRow(const Row& row, const Vector& g)
{
    double sum = 0.0;
    for (const auto& [code, p] : row)
        sum += p * g[code];
    return sum;
}

/// Adds one patch, its radiance eliminated.
void addPatch(NormalSystem& system, const std::vector<Linear>& observations)
{
    Vector s = Vector::Zero(kCodes);
    double sy = 0.0;
    double total = 0.0;
    int low = kCodes;
    int high = -1;
    for (const Linear& o : observations) {
        for (const auto& [i, pi] : o.row) {
            for (const auto& [j, pj] : o.row)
                system.a(j, i) += o.weight * pi * pj;
            system.b[i] += o.weight * pi * o.target;
            s[i] += o.weight * pi;
            low = std::min(low, i);
            high = std::max(high, i);
        }
        sy += o.weight * o.target;
        total += o.weight;
    }
    const int n = high - low + 1;
    const Vector part = s.segment(low, n);
    system.a.block(low, low, n, n).noalias() -= part * part.transpose() / total;
    system.b.segment(low, n) -= part * (sy / total);
}

/// Takes weight from observations that disagree with the rest of their patch (JPEG colour bleeding,
/// something that moved).
void huberise(std::vector<Linear>& observations, const Vector& g)
{
    double sum = 0.0;
    double total = 0.0;
    for (const Linear& o : observations) {
        sum += o.weight * (dotRow(o.row, g) - o.target);
        total += o.weight;
    }
    for (Linear& o : observations) {
        const double deviation =
            std::abs(dotRow(o.row, g) - o.target - sum / total) * std::sqrt(o.weight);
        if (deviation > kHuber) o.weight *= kHuber / deviation;
    }
}

/// Weights of the third divided difference of values at u[0..3], times 3! (the derivative).
std::array<double, 4> thirdDerivative(const std::array<double, 4>& u)
{
    std::array<double, 4> weights{};
    for (std::size_t i = 0; i < 4; ++i) {
        weights[i] = 6.0;
        for (std::size_t j = 0; j < 4; ++j)
            if (j != i) weights[i] /= u[i] - u[j];
    }
    return weights;
}

Matrix curvaturePenalty()
{
    Matrix penalty = Matrix::Zero(kCodes, kCodes);
    for (int z = 0; z + 3 < kCodes; ++z) {
        std::array<double, 4> u{};
        for (int i = 0; i < 4; ++i)
            u[static_cast<std::size_t>(i)] = std::log(z + i + kCodeOffset);
        const std::array<double, 4> weights = thirdDerivative(u);
        const double middle = (z + 1.5) / 255.0;
        const double stiffness = std::pow(1.0 - middle * middle, 4.0);
        const double span = (u[3] - u[0]) / 3.0;
        const Eigen::Vector4d d(weights.data());
        penalty.block<4, 4>(z, z) += stiffness * span * d * d.transpose();
    }
    return penalty;
}

Vector solveSystem(const NormalSystem& system, const Matrix& penalty, double lambda)
{
    Matrix a = system.a + lambda * penalty;
    // The scale is free: a touch of g(128) = 0 makes the matrix regular, more would leave a dent.
    a(128, 128) += kGaugeWeight * a.diagonal().maxCoeff();
    return a.ldlt().solve(system.b);
}

/// Power law 2.2 through g(128) = 0: where Gauss-Newton begins.
Vector initialCurve()
{
    Vector g(kCodes);
    for (int z = 0; z < kCodes; ++z)
        g[z] = 2.2 * std::log((z + 0.5) / 128.5);
    return g;
}

/// RMS of ln exposure by which the frames of a patch disagree, weighted.
double residualOf(const std::vector<std::vector<Linear>>& patches, const Vector& g)
{
    double sum = 0.0;
    double total = 0.0;
    for (const std::vector<Linear>& patch : patches) {
        double mean = 0.0;
        double weights = 0.0;
        for (const Linear& o : patch) {
            mean += o.weight * (dotRow(o.row, g) - o.target);
            weights += o.weight;
        }
        for (const Linear& o : patch) {
            const double deviation = dotRow(o.row, g) - o.target - mean / weights;
            sum += o.weight * deviation * deviation;
        }
        total += weights;
    }
    return total > 0.0 ? std::sqrt(sum / total) : 0.0;
}

}  // namespace

ResponseSolution solveResponse(const std::vector<PatchObservations>& patches, double smoothness)
{
    const CodeNoise noise(patches);
    const Matrix penalty = curvaturePenalty();
    Vector g = initialCurve();
    std::vector<std::vector<Linear>> used;
    for (int step = 0; step < kGaussNewtonSteps; ++step) {
        const bool by_mean_code = step < kMeanCodeSteps;
        NormalSystem system;
        used.clear();
        for (const PatchObservations& patch : patches) {
            std::vector<Linear> observations = linearisePatch(patch, g, noise, by_mean_code);
            if (observations.size() < 2) continue;
            if (!by_mean_code) huberise(observations, g);
            addPatch(system, observations);
            used.push_back(std::move(observations));
        }
        g = solveSystem(system, penalty, smoothness);
        g.array() -= g[128];
    }
    ResponseSolution solution;
    std::copy(g.data(), g.data() + kCodes, solution.log_curve.begin());
    solution.residual = residualOf(used, g);
    return solution;
}

}  // namespace insitu::detail
