#include "capture/response_fit.h"

#include "capture/response_channel.h"
#include "core/parallel.h"

#include <algorithm>
#include <cmath>

// The likelihood. View v of a group sees shares h_z of codes in frame k; with g = ln decoder,
//
//     ln sum_z h_z exp(g_z)  =  ln t_k + d_k + E  +  error,    var = s_v^2 + f^2,
//
// E the group's unknown, d_k the correction of the frame's exposure, s_v the standard error of the
// mean that the histogram itself shows, f what averaging leaves: JPEG, rounding of a narrow group,
// a model that does not reach the curve. f is measured from the residuals, so that a clean picture
// is believed more than a JPEG and smoothness decides less. Linearised about a current g
// (Gauss-Newton) with p_z = h_z exp(g_z) / m:
//
//     p^T (offset + B c) - d_k - E  =  y,     y = ln t_k + p^T g - ln m.
//
// E is eliminated group by group, c channel by channel (Schur complement), which leaves one small
// system for d, shared by the channels: they were exposed together.
//
// Gauge. g -> a g, ln t -> a ln t changes nothing that can be seen ([GroNay03]): only the given
// exposures tell a. So d is kept free of a constant and of a slope over ln t: the mean of the
// ratios (refined over given, ln) and their trend are zero. When a frame is far off, the line is
// laid afterwards through the other frames, which a wrong entry would tilt. d costs (d / 0.03)^2:
// shutter times are rounded by some per cent (1/60 for 1/64). Corrections below kNegligible are
// within what JPEG feigns and are not made.

namespace insitu::detail {

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr int kSteps = 5;
constexpr int kFirstRobustStep = 2;
/// Rounding of nominal exposures, ln.
constexpr double kExposureSpread = 0.03;
constexpr double kBestKnown = 0.002;
/// Weight of what must hold exactly, relative to the largest entry.
constexpr double kExactly = 1e3;
constexpr double kGaugeWeight = 1e-6;
/// Corrections of ln exposure, see above.
constexpr double kNegligible = 0.025;
constexpr double kFarOff = 0.1;
/// A line through the frames that agree needs this many.
constexpr Eigen::Index kFewestForLine = 5;
constexpr double kMostSlope = 0.5;

/// d costs (d / kExposureSpread)^2; it has no mean and no slope over ln t, frames weighted by what
/// is known of them. The groups share pixels and JPEG errs alike in many of them: no d is known
/// better than kBestKnown.
void addExposurePrior(Matrix& a, Vector& right, const std::vector<double>& log_exposures)
{
    const Eigen::Index frames = a.rows();
    const double most = std::max(a.diagonal().maxCoeff(), 1e-30);
    const double believed = std::min(1.0, 1.0 / (kBestKnown * kBestKnown) / most);
    a *= believed;
    right *= believed;
    constexpr double kWeight = 1.0 / (kExposureSpread * kExposureSpread);
    const Vector constant = a.diagonal().array().max(0.0).min(kWeight);
    const Eigen::Map<const Vector> log_exposure(log_exposures.data(), frames);
    const double mean = constant.dot(log_exposure) / std::max(constant.sum(), 1e-30);
    const Vector slope = constant.array() * (log_exposure.array() - mean);
    const double exactly = kExactly * std::max(a.diagonal().maxCoeff(), kWeight);
    a.diagonal().array() += kWeight;
    a += exactly / std::max(constant.squaredNorm(), 1e-30) * constant * constant.transpose();
    a += exactly / std::max(slope.squaredNorm(), 1e-30) * slope * slope.transpose();
}

/// One Gauss-Newton step of all channels, with d when `refine`.
void step(std::vector<ChannelFit>& channels,
          const CurveModel& model,
          const std::vector<double>& log_exposures,
          int number,
          bool refine,
          Vector& d)
{
    std::array<Vector, 3> solution;
    std::array<Matrix, 3> of_d;  // what c loses for a unit of d
    std::array<Matrix, 3> left;
    std::array<Vector, 3> right;
    parallelFor(0, 3, [&](std::int64_t channel) {
        const auto c = static_cast<std::size_t>(channel);
        const System system = channels[c].linearise(d, number >= kFirstRobustStep);
        // Not with d: a flatter curve has smaller residuals.
        if (number > 0 && !refine) channels[c].measureSpread();
        // The scale is free: a touch of ln decoder(128) = 0.
        const Vector middle = model.columns.row(128).transpose();
        Matrix a = system.cc + model.penalty;
        a += kGaugeWeight * a.diagonal().maxCoeff() * middle * middle.transpose();
        const Eigen::LDLT<Matrix> factor(a);
        solution[c] = factor.solve(system.c);
        if (!refine) return;
        of_d[c] = factor.solve(system.cd);
        left[c] = system.dd - system.cd.transpose() * of_d[c];
        right[c] = system.d - system.cd.transpose() * solution[c];
    });
    if (refine) {
        Matrix a = left[0] + left[1] + left[2];
        Vector b = right[0] + right[1] + right[2];
        addExposurePrior(a, b, log_exposures);
        d = a.ldlt().solve(b);
        for (std::size_t c = 0; c < 3; ++c)
            solution[c] -= of_d[c] * d;
    }
    for (std::size_t c = 0; c < 3; ++c)
        channels[c].setCoefficients(std::move(solution[c]));
}

/// The line a + b ln t through two frames from which the others differ least (absolutely): few
/// frames that are far off do not tilt it.
struct Line {
    double constant = 0.0;
    double slope = 0.0;
};
Line robustLine(const Vector& d, const std::vector<double>& log_exposures)
{
    Line best;
    double least = d.cwiseAbs().sum();
    const auto frames = static_cast<std::size_t>(d.size());
    for (std::size_t i = 0; i < frames; ++i) {
        for (std::size_t j = i + 1; j < frames; ++j) {
            const double run = log_exposures[j] - log_exposures[i];
            if (std::abs(run) < 1e-3) continue;
            const auto at = [&](std::size_t k) { return d[static_cast<Eigen::Index>(k)]; };
            Line line;
            line.slope = (at(j) - at(i)) / run;
            if (std::abs(line.slope) > kMostSlope) continue;
            line.constant = at(i) - line.slope * log_exposures[i];
            double sum = 0.0;
            for (std::size_t k = 0; k < frames; ++k)
                sum += std::abs(at(k) - line.constant - line.slope * log_exposures[k]);
            if (sum >= least) continue;
            least = sum;
            best = line;
        }
    }
    return best;
}

}  // namespace

CurveFit fitCurves(const std::array<PixelGroups, 3>& groups,
                   const std::vector<double>& log_exposures,
                   const CurveModel& model,
                   bool refine_exposures)
{
    std::vector<ChannelFit> channels;
    for (std::size_t c = 0; c < 3; ++c)
        channels.emplace_back(groups[c], log_exposures, model);
    const auto frames = static_cast<Eigen::Index>(log_exposures.size());
    Vector d = Vector::Zero(frames);
    for (int i = 0; i < kSteps; ++i)
        step(channels, model, log_exposures, i, false, d);
    double scale = 1.0;
    if (refine_exposures) {
        step(channels, model, log_exposures, kSteps, true, d);
        const bool off = d.cwiseAbs().maxCoeff() > kNegligible;
        if (!off) d.setZero();
        for (int i = 0; i < (off ? kSteps : 1); ++i)
            step(channels, model, log_exposures, kSteps, off, d);
        if (d.cwiseAbs().maxCoeff() > kFarOff && frames >= kFewestForLine) {
            const Line line = robustLine(d, log_exposures);
            scale = 1.0 / (1.0 + line.slope);
            for (Eigen::Index k = 0; k < frames; ++k)
                d[k] = scale * (d[k] - line.constant -
                                line.slope * log_exposures[static_cast<std::size_t>(k)]);
        }
    }
    CurveFit fit;
    fit.log_scale.assign(d.data(), d.data() + frames);
    for (std::size_t c = 0; c < 3; ++c) {
        const Vector g = channels[c].logDecoder();
        for (int z = 0; z < kCodes; ++z)
            fit.decoder[c][static_cast<std::size_t>(z)] = scale * (g[z] - g[128]);
        fit.residual[c] = channels[c].rms();
    }
    return fit;
}

// With F the exposure of a value u and a density that noise has made smooth, E[G(round u)] =
// E[F(u)] for G = F - F'' v/2 + ..., v the variance of what rounding adds.
LogCurve curveOfDecoder(const LogCurve& decoder, double variance)
{
    LogCurve curve{};
    for (std::size_t z = 0; z < decoder.size(); ++z) {
        const std::size_t i = std::clamp<std::size_t>(z, 1, decoder.size() - 2);
        const double slope = 0.5 * (decoder[i + 1] - decoder[i - 1]);
        const double bend = decoder[i + 1] - 2.0 * decoder[i] + decoder[i - 1];
        const double correction = 0.5 * variance * (bend + slope * slope);
        curve[z] = decoder[z] + std::log1p(std::clamp(correction, -0.1, 0.1));
    }
    const double middle = curve[128];
    for (double& value : curve)
        value -= middle;
    return curve;
}

}  // namespace insitu::detail
