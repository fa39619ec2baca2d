#include "composite/match/edge_profile.h"

#include "core/color.h"
#include "core/parallel.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace insitu {

namespace {

constexpr int kReach = 7;
constexpr int kSide = 2 * kReach + 1;
constexpr int kPixels = kSide * kSide;
constexpr double kMaxSpread = 3.0;
/// An edge's step against its brighter side that makes it worth a fit.
constexpr double kMinContrast = 0.15;
/// One edge per cell of this side, pixels: they are to be spread over the picture.
constexpr int kCell = 10;

using Values = Eigen::Matrix<double, kPixels, 1>;

double normalCdf(double x)
{
    return 0.5 * std::erfc(-x / std::numbers::sqrt2);
}

double normalPdf(double x)
{
    return std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
}

struct StepFit {
    double dark = 0.0;
    double step = 0.0;
    double offset = 0.0;
    double spread = 1.0;
    double angle = 0.0;
    double offset_sigma = 0.0;
    double spread_sigma = 0.0;
    double rms = 0.0;       ///< of the residuals
    double rms_near = 0.0;  ///< of those within 1.5 spreads and a pixel of the edge
};

/// Levenberg–Marquardt of the step's five parameters (four when the angle is given).
std::optional<StepFit> fitStep(const Values& values, StepFit fit, bool free_angle)
{
    const int n = free_angle ? 5 : 4;
    using Matrix = Eigen::Matrix<double, kPixels, 5>;
    const auto linearise = [&](const StepFit& at, Values& residual, Matrix& jacobian) {
        const double nx = std::cos(at.angle);
        const double ny = std::sin(at.angle);
        for (int i = 0; i < kPixels; ++i) {
            const double x = i % kSide - kReach;
            const double y = i / kSide - kReach;
            const double u = (nx * x + ny * y - at.offset) / at.spread;
            const double slope = at.step * normalPdf(u) / at.spread;
            residual[i] = values[i] - at.dark - at.step * normalCdf(u);
            jacobian.row(i) << 1.0, normalCdf(u), -slope, -slope * u,
                free_angle ? slope * (ny * -x + nx * y) : 0.0;
        }
        return residual.squaredNorm();
    };
    // Without the angle its column is 0: a one on the diagonal keeps the system regular.
    const auto normalOf = [&](const Matrix& jacobian) {
        Eigen::Matrix<double, 5, 5> normal = jacobian.transpose() * jacobian;
        if (!free_angle) normal(4, 4) = 1.0;
        return normal;
    };
    Values residual;
    Matrix jacobian;
    double cost = linearise(fit, residual, jacobian);
    double damping = 1e-3;
    for (int iteration = 0; iteration < 25; ++iteration) {
        const Eigen::MatrixXd normal = jacobian.leftCols(n).transpose() * jacobian.leftCols(n);
        const Eigen::VectorXd right = jacobian.leftCols(n).transpose() * residual;
        Eigen::MatrixXd damped = normal;
        damped.diagonal() *= 1.0 + damping;
        damped.diagonal().array() += 1e-12;
        const Eigen::VectorXd move = damped.ldlt().solve(right);
        StepFit next = fit;
        next.dark += move[0];
        next.step += move[1];
        next.offset += move[2];
        next.spread = std::clamp(fit.spread + move[3], 0.1, 2.0 * kMaxSpread);
        if (free_angle) next.angle += move[4];
        Values next_residual;
        Matrix next_jacobian;
        const double next_cost = linearise(next, next_residual, next_jacobian);
        if (!(next_cost < cost)) {
            damping *= 10.0;
            if (damping > 1e6) break;
            continue;
        }
        const bool settled = cost - next_cost < 1e-9 * cost;
        fit = next;
        cost = next_cost;
        residual = next_residual;
        jacobian = next_jacobian;
        damping = std::max(damping * 0.1, 1e-9);
        if (settled) break;
    }
    if (!(fit.step > 0.0) || !std::isfinite(cost) || std::abs(fit.offset) > 2.5 ||
        fit.spread > kMaxSpread || fit.spread <= 0.1)
        return std::nullopt;
    const double variance = cost / (kPixels - n);
    const Eigen::Matrix<double, 5, 5> covariance = normalOf(jacobian).inverse() * variance;
    fit.offset_sigma = std::sqrt(covariance(2, 2));
    fit.spread_sigma = std::sqrt(covariance(3, 3));
    fit.rms = std::sqrt(variance);
    double near = 0.0;
    double near_count = 0.0;
    for (int i = 0; i < kPixels; ++i) {
        const double t = std::cos(fit.angle) * (i % kSide - kReach) +
                         std::sin(fit.angle) * (i / kSide - kReach) - fit.offset;
        if (std::abs(t) > 1.5 * fit.spread + 1.0) continue;
        near += residual[i] * residual[i];
        near_count += 1.0;
    }
    fit.rms_near = std::sqrt(near / std::max(near_count, 1.0));
    if (!std::isfinite(fit.offset_sigma + fit.spread_sigma)) return std::nullopt;
    return fit;
}

/// A straight edge between two even surfaces, not a line, a corner or a texture.
bool isClear(const StepFit& fit)
{
    return fit.spread_sigma < 0.15 * fit.spread && fit.rms < 0.12 * fit.step &&
           fit.rms_near < 1.5 * fit.rms + 0.01 * fit.step &&
           fit.step > kMinContrast * std::max(fit.dark + fit.step, 0.0);
}

std::optional<EdgeProfile> profileAt(const Image<Rgb>& radiance, int x, int y, glm::dvec2 gradient)
{
    std::array<Values, 3> channel;
    Values grey;
    for (int i = 0; i < kPixels; ++i) {
        const Rgb v = radiance(x + i % kSide - kReach, y + i / kSide - kReach);
        for (int c = 0; c < 3; ++c)
            channel[static_cast<std::size_t>(c)][i] = v[c];
        grey[i] = luminance(v);
    }
    StepFit start;
    start.dark = grey.minCoeff();
    start.step = grey.maxCoeff() - start.dark;
    start.angle = std::atan2(gradient.y, gradient.x);
    const auto whole = fitStep(grey, start, /*free_angle=*/true);
    if (!whole || !isClear(*whole)) return std::nullopt;
    EdgeProfile profile;
    profile.at = glm::dvec2(x + 0.5, y + 0.5);
    profile.normal = glm::dvec2(std::cos(whole->angle), std::sin(whole->angle));
    for (int c = 0; c < 3; ++c) {
        StepFit own = *whole;
        own.dark = channel[static_cast<std::size_t>(c)].minCoeff();
        own.step = channel[static_cast<std::size_t>(c)].maxCoeff() - own.dark;
        const auto fit = fitStep(channel[static_cast<std::size_t>(c)], own, /*free_angle=*/false);
        if (!fit || !isClear(*fit)) return std::nullopt;
        profile.offset[c] = fit->offset;
        profile.spread[c] = fit->spread;
        profile.offset_sigma[c] = fit->offset_sigma;
        profile.spread_sigma[c] = fit->spread_sigma;
    }
    return profile;
}

struct Candidate {
    int x = 0;
    int y = 0;
    double strength = 0.0;
    glm::dvec2 gradient{0.0};
};

/// The steepest pixel of every cell, by gradient against the level around.
std::vector<Candidate> candidates(const Image<Rgb>& radiance)
{
    const int columns = std::max(0, radiance.width() - 2 * kReach) / kCell;
    const int rows = std::max(0, radiance.height() - 2 * kReach) / kCell;
    std::vector<Candidate> found(static_cast<std::size_t>(columns) *
                                 static_cast<std::size_t>(rows));
    parallelFor(0, rows, [&](std::int64_t row) {
        for (int column = 0; column < columns; ++column) {
            Candidate best;
            for (int y = kReach + static_cast<int>(row) * kCell;
                 y < kReach + (static_cast<int>(row) + 1) * kCell;
                 ++y)
                for (int x = kReach + column * kCell; x < kReach + (column + 1) * kCell; ++x) {
                    // Scharr's weights, on 3×3 pixels.
                    glm::dvec2 g(0.0);
                    double level = 0.0;
                    for (int k = -1; k <= 1; ++k) {
                        const double w = k == 0 ? 10.0 : 3.0;
                        g.x += w * (luminance(radiance(x + 1, y + k)) -
                                    luminance(radiance(x - 1, y + k)));
                        g.y += w * (luminance(radiance(x + k, y + 1)) -
                                    luminance(radiance(x + k, y - 1)));
                        level += luminance(radiance(x + k, y - 1)) + luminance(radiance(x + k, y)) +
                                 luminance(radiance(x + k, y + 1));
                    }
                    const double strength = glm::length(g) / 32.0 / std::max(level / 9.0, 1e-12);
                    if (strength > best.strength) best = {x, y, strength, g};
                }
            found[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                  static_cast<std::size_t>(column)] = best;
        }
    });
    std::erase_if(found, [](const Candidate& c) { return c.strength < 0.25 * kMinContrast; });
    std::stable_sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) {
        return a.strength > b.strength;
    });
    return found;
}

}  // namespace

std::vector<EdgeProfile> edgeProfiles(const Image<Rgb>& radiance,
                                      const Image<std::uint8_t>& usable,
                                      int max_count)
{
    std::vector<Candidate> at = candidates(radiance);
    // Most candidates of a cluttered picture fail: try a few times as many as wanted.
    at.resize(std::min<std::size_t>(at.size(), static_cast<std::size_t>(max_count) * 3));
    std::vector<std::optional<EdgeProfile>> profiles(at.size());
    parallelFor(0, static_cast<std::int64_t>(at.size()), [&](std::int64_t i) {
        const Candidate& c = at[static_cast<std::size_t>(i)];
        for (int y = c.y - kReach; y <= c.y + kReach; ++y)
            for (int x = c.x - kReach; x <= c.x + kReach; ++x)
                if (!usable(x, y)) return;
        profiles[static_cast<std::size_t>(i)] = profileAt(radiance, c.x, c.y, c.gradient);
    });
    std::vector<EdgeProfile> clear;
    for (const auto& profile : profiles)
        if (profile && clear.size() < static_cast<std::size_t>(max_count))
            clear.push_back(*profile);
    return clear;
}

}  // namespace insitu
