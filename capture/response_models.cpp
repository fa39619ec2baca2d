#include "capture/response_fit.h"
#include "core/color.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace insitu::detail {

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr int kIntervals = 64;
/// Knots lie evenly in ln(z + kLowOffset) - ln(255 + kHighOffset - z): dense at both ends.
constexpr double kLowOffset = 6.0;
constexpr double kHighOffset = 10.0;
/// Smoothness is measured over u = ln(z + kCodeOffset), see smoothModel.
constexpr double kCodeOffset = 2.0;
/// Weight of the bends that keeps a curve straight over u where no sample reaches: nothing beside
/// what samples say elsewhere.
constexpr double kStraightness = 0.01;
constexpr int kComponents = 12;

double knotPlace(double z)
{
    return std::log(z + kLowOffset) - std::log(255.0 + kHighOffset - z);
}

/// Uniform cubic B-splines over knotPlace.
Matrix splineColumns()
{
    Matrix columns = Matrix::Zero(kCodes, kIntervals + 3);
    const double first = knotPlace(0.0);
    const double step = (knotPlace(255.0) - first) / kIntervals;
    for (int z = 0; z < kCodes; ++z) {
        const double place = (knotPlace(z) - first) / step;
        const int i = std::min(static_cast<int>(place), kIntervals - 1);
        const double t = place - i;
        const double s = 1.0 - t;
        columns(z, i) = s * s * s / 6.0;
        columns(z, i + 1) = (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0;
        columns(z, i + 2) = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0;
        columns(z, i + 3) = t * t * t / 6.0;
    }
    return columns;
}

/// Weights of the derivative of order Points - 1 of values at u (divided difference).
template <std::size_t Points>
std::array<double, Points> derivativeWeights(const std::array<double, Points>& u)
{
    std::array<double, Points> weights{};
    double factorial = 1.0;
    for (std::size_t i = 2; i < Points; ++i)
        factorial *= static_cast<double>(i);
    for (std::size_t i = 0; i < Points; ++i) {
        weights[i] = factorial;
        for (std::size_t j = 0; j < Points; ++j)
            if (j != i) weights[i] /= u[i] - u[j];
    }
    return weights;
}

/// integral of (derivative of order Points - 1 over u)^2 stiffness(z) du, as a matrix on tables.
template <std::size_t Points>
Matrix bendingMatrix(const std::function<double(double)>& stiffness)
{
    constexpr int kPoints = static_cast<int>(Points);
    Matrix bending = Matrix::Zero(kCodes, kCodes);
    for (int z = 0; z + kPoints <= kCodes; ++z) {
        std::array<double, Points> u{};
        for (int i = 0; i < kPoints; ++i)
            u[static_cast<std::size_t>(i)] = std::log(z + i + kCodeOffset);
        const std::array<double, Points> weights = derivativeWeights(u);
        const Eigen::Map<const Eigen::Matrix<double, kPoints, 1>> d(weights.data());
        const double span = (u[Points - 1] - u[0]) / (kPoints - 1);
        bending.block<kPoints, kPoints>(z, z) +=
            stiffness(z + 0.5 * (kPoints - 1)) * span * d * d.transpose();
    }
    return bending;
}

/// ln exposure by code of an increasing curve code/255 = f(exposure), f(0) = 0, f(1) = 1.
Vector logTable(const std::function<double(double)>& f)
{
    constexpr int kPoints = 500;
    constexpr double kDeepest = -14.0;  // ln exposure
    Vector table(kCodes);
    int z = 0;
    double last_code = 0.0;
    double last_log = kDeepest;
    for (int i = 0; i <= kPoints; ++i) {
        const double log_exposure = kDeepest * (1.0 - static_cast<double>(i) / kPoints);
        const double code = 255.0 * f(std::exp(log_exposure));
        while (z < kCodes && std::max<double>(z, 0.25) <= code + 1e-9) {
            const double target = std::max<double>(z, 0.25);
            const double t = code > last_code ? (target - last_code) / (code - last_code) : 1.0;
            table[z++] = last_log + std::clamp(t, 0.0, 1.0) * (log_exposure - last_log);
        }
        last_code = code;
        last_log = log_exposure;
    }
    for (; z < kCodes; ++z)
        table[z] = 0.0;
    table.array() -= table[128];
    return table;
}

/// Curves as published and as cameras have them: a shoulder (none, exponential, [NakRus66],
/// [Reinhard02]), a display curve (powers, sRGB) and a contrast (none, smoothstep).
std::vector<Vector> publishedCurves()
{
    std::vector<std::function<double(double)>> shoulders = {[](double x) { return x; }};
    for (const double k : {1.0, 2.0, 4.0})
        shoulders.emplace_back(
            [k](double x) { return (1.0 - std::exp(-k * x)) / (1.0 - std::exp(-k)); });
    for (const double s : {0.5, 0.2, 0.08})
        for (const double a : {0.8, 1.0, 1.25})
            shoulders.emplace_back([s, a](double x) {
                const double power = std::pow(x, a);
                const double half = std::pow(s, a);
                return power / (power + half) * (1.0 + half);
            });
    std::vector<std::function<double(double)>> displays = {
        [](double x) { return srgbFromLinear(x); }};
    for (const double gamma : {0.35, 0.45, 0.6, 0.8, 1.0})
        displays.emplace_back([gamma](double x) { return std::pow(x, gamma); });
    std::vector<Vector> curves;
    for (const auto& shoulder : shoulders)
        for (const auto& display : displays)
            for (const double contrast : {0.0, 0.4, 0.8})
                curves.push_back(logTable([&](double x) {
                    const double y = std::clamp(display(shoulder(x)), 0.0, 1.0);
                    return y + contrast * (y * y * (3.0 - 2.0 * y) - y);
                }));
    return curves;
}

CurveModel makeBasis()
{
    const std::vector<Vector> curves = publishedCurves();
    const auto count = static_cast<Eigen::Index>(curves.size());
    Matrix all(kCodes, count);
    for (Eigen::Index i = 0; i < count; ++i)
        all.col(i) = curves[static_cast<std::size_t>(i)];
    CurveModel model;
    model.offset = all.rowwise().mean();
    all.colwise() -= model.offset;
    // Principal components by the small side of the matrix; a column is one standard deviation of
    // the family along its component, so the prior is the family's own spread.
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(all.transpose() * all);
    const Matrix strongest = eigen.eigenvectors().rightCols(kComponents);
    model.columns = all * strongest / std::sqrt(static_cast<double>(count));
    model.penalty = Matrix::Identity(kComponents, kComponents);
    model.start = Vector::Zero(kComponents);
    return model;
}

/// The spline coefficients that come nearest to a power law: where the fit begins.
Vector powerLaw(const Matrix& columns)
{
    Vector table(kCodes);
    for (int z = 0; z < kCodes; ++z)
        table[z] = 2.2 * std::log((z + 0.5) / 128.5);
    return columns.colPivHouseholderQr().solve(table);
}

}  // namespace

// Smoothness. Ratios of exposures leave a curve undetermined up to any function that repeats with
// the bracket's step (2 EV in many brackets): only smoothness decides, and no residual shows a
// wrong choice. So the prior must be one that cameras' curves really obey. Their slope s = dg/du
// with u = ln(code) drifts slowly, up to the shoulder, where it rises fast; so we penalise
//
//     lambda * integral (d3g/du3)^2 (1 - (z/255)^2)^4 du,   u = ln(z + kCodeOffset).
//
// A repeating error of 0.01 EV has |d3g/du3| near 7, power laws and their shoulders below 1 up to
// code 160. An error that repeats every s EV bends by s^-3: the caller scales lambda with the step.
CurveModel smoothModel(double smoothness)
{
    const auto stiffness = [](double z) {
        const double t = z / 255.0;
        return std::pow(1.0 - t * t, 4.0);
    };
    CurveModel model;
    model.offset = Vector::Zero(kCodes);
    model.columns = splineColumns();
    const Matrix bending = smoothness * bendingMatrix<4>(stiffness) +
                           kStraightness * bendingMatrix<3>([](double) { return 1.0; });
    model.penalty = model.columns.transpose() * bending * model.columns;
    model.start = powerLaw(model.columns);
    return model;
}

const CurveModel& basisModel()
{
    static const CurveModel model = makeBasis();
    return model;
}

}  // namespace insitu::detail
