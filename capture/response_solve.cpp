#include "capture/response_solve.h"

#include "capture/response_samples.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

// The problem. A patch i of constant radiance exp(E_i) is seen by frame k with exposure t_k; the
// mean of its decoded pixels must be t_k exp(E_i). With g = ln(exposure by code) and h_z the share
// of the patch's pixels that have code z:
//
//     r_ik = ln sum_z h_z exp(g_z)  -  ln t_k  -  E_i
//
// With single pixels this is [DebMal97] eq. 3, g(Z_ik) - ln t_k - E_i. Averaging the decoded pixels
// and not the codes keeps the noise of the sensor, which has mean zero in exposure but not after
// the curve, from bending the curve where it is dark. Linearised about a current g (Gauss-Newton),
//
//     r_ik = sum_z p_z g_z - y_ik - E_i,   p_z = h_z exp(g_z) / m,   m = sum_z h_z exp(g_z),
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
//     lambda * integral (d3g/du3)^2 (1 - (z/255)^2)^3 du,   u = ln(z + kCodeOffset).
//
// A repeating error of 0.01 EV has |d3g/du3| near 7, power laws and their shoulders below 1 up to
// code 160. Any lambda from 10 to 1000 gives the same curve within 0.005 EV above code 20.

namespace insitu::detail {

namespace {

constexpr int kCodes = 256;
constexpr double kCodeOffset = 1.0;
/// Rounding to codes (1/sqrt(12)) and the JPEG, as left in the mean of a patch. Codes.
constexpr double kCodeFloor = 0.1;
constexpr int kGaussNewtonSteps = 6;
/// The first steps use the patches' mean codes, plain [DebMal97]: a safe start.
constexpr int kMeanCodeSteps = 2;
/// Residuals beyond this many standard deviations lose weight (Huber).
constexpr double kHuber = 2.5;

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

/// Normal equations of the curve alone, A g = b.
struct NormalSystem {
    Matrix a = Matrix::Zero(kCodes, kCodes);
    Vector b = Vector::Zero(kCodes);
    double c = 0.0;
    double weight = 0.0;

    [[nodiscard]] double cost(const Vector& g) const { return g.dot(a * g) - 2.0 * b.dot(g) + c; }
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

Linear linearise(const PatchObservation& o,
                 const Vector& g,
                 const CodeNoise& noise,
                 bool by_mean_code)
{
    Linear linear;
    if (by_mean_code) {
        const int low = std::min(static_cast<int>(o.mean_code), kCodes - 2);
        const double t = o.mean_code - low;
        linear.row = {{low, 1.0 - t}, {low + 1, t}};
        linear.target = o.log_exposure;
    } else {
        const double mean = decodedMean(o, g);
        double offset = std::log(mean);
        for (const auto& [code, share] : o.histogram) {
            const double p = share * std::exp(g[code]) / mean;
            linear.row.emplace_back(code, p);
            offset -= p * g[code];
        }
        linear.target = o.log_exposure - offset;
    }
    const double slope = slopeAt(g, o.mean_code);
    const double code_variance =
        noise.variance(o.mean_code) / (kPatchSide * kPatchSide) + kCodeFloor * kCodeFloor;
    linear.weight = 1.0 / (slope * slope * code_variance);
    return linear;
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
        const double stiffness = std::pow(1.0 - middle * middle, 3.0);
        const double span = (u[3] - u[0]) / 3.0;
        const Eigen::Vector4d d(weights.data());
        penalty.block<4, 4>(z, z) += stiffness * span * d * d.transpose();
    }
    return penalty;
}

Vector solveSystem(const NormalSystem& system, const Matrix& penalty, double lambda)
{
    Matrix a = system.a + lambda * penalty;
    // g(128) = 0 fixes the free scale.
    a(128, 128) += std::max(1.0, a.diagonal().maxCoeff());
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

/// RMS of ln exposure by which two frames disagree about a patch, weighted.
double residualOf(const std::vector<PatchObservations>& patches,
                  const Vector& g,
                  const CodeNoise& noise)
{
    double sum = 0.0;
    double total = 0.0;
    for (const PatchObservations& patch : patches) {
        double mean = 0.0;
        double weights = 0.0;
        std::vector<std::pair<double, double>> logs;
        for (const PatchObservation& o : patch) {
            const double weight = linearise(o, g, noise, false).weight;
            logs.emplace_back(std::log(decodedMean(o, g)) - o.log_exposure, weight);
            mean += weight * logs.back().first;
            weights += weight;
        }
        for (const auto& [value, weight] : logs)
            sum += weight * (value - mean / weights) * (value - mean / weights);
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
    for (int step = 0; step < kGaussNewtonSteps; ++step) {
        NormalSystem system;
        for (const PatchObservations& patch : patches) {
            std::vector<Linear> observations;
            for (const PatchObservation& o : patch)
                observations.push_back(linearise(o, g, noise, step < kMeanCodeSteps));
            if (step >= kMeanCodeSteps) huberise(observations, g);
            addPatch(system, observations);
        }
        g = solveSystem(system, penalty, smoothness);
        g.array() -= g[128];
    }
    ResponseSolution solution;
    std::copy(g.data(), g.data() + kCodes, solution.log_curve.begin());
    solution.residual = residualOf(patches, g, noise);
    return solution;
}

}  // namespace insitu::detail
