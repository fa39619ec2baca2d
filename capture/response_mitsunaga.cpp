#include "capture/response_methods.h"
#include "core/parallel.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

// [MitNay99]: the decoder is a polynomial of the code, G(z) = sum a_n (z/255)^n with G(255) = 1,
// and radiance seen by two frames is the same,
//
//     sum_n a_n (mean_v (z/255)^n / t_v - mean_w (z/255)^n / t_w) = 0,
//
// which is linear in a. The paper's error is absolute, so that bright codes decide alone; we divide
// by the radiance that the last round gave, which makes it relative. The means are those of groups
// of pixels (response_groups.h), not of single ones. The order is the one that predicts best the
// groups it was not fitted to: even ones against odd ones. The ratios of exposures are refined by
// the caller for all methods alike.

namespace insitu::detail {

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr int kHighestOrder = 10;
constexpr int kRounds = 4;
/// What averaging leaves of a group's disagreement, ln.
constexpr double kSpread = 0.01;
constexpr double kRidge = 1e-10;
/// A polynomial that does not rise from here on is no curve. Code.
constexpr std::size_t kHighestStart = 64;

/// Mean powers of the codes of two views of a group, over the frames' exposures.
struct PowerPair {
    Vector longer;
    Vector shorter;
    double noise = 0.0;
};

Vector meanPowers(const GroupView& view, double exposure)
{
    Vector powers = Vector::Zero(kHighestOrder + 1);
    for (std::size_t i = 0; i < view.shares.size(); ++i) {
        const double x = (view.low + static_cast<double>(i)) / 255.0;
        double power = static_cast<double>(view.shares[i]) / exposure;
        for (int n = 0; n <= kHighestOrder; ++n) {
            powers[n] += power;
            power *= x;
        }
    }
    return powers;
}

std::vector<PowerPair> powerPairs(const PixelGroups& groups, const std::vector<double>& exposures)
{
    std::vector<PowerPair> pairs;
    for (const PixelGroup& group : groups) {
        Vector before;
        for (const GroupView& view : group.views) {
            Vector powers = meanPowers(view, exposures[static_cast<std::size_t>(view.frame)]);
            if (before.size() > 0) pairs.push_back({before, powers, 1.0 / view.count});
            before = std::move(powers);
        }
    }
    return pairs;
}

/// G's coefficients of the given order from the pairs with index = first, first + stride, ...
Vector fitOrder(const std::vector<PowerPair>& pairs,
                int order,
                std::size_t first,
                std::size_t stride)
{
    Vector a = Vector::Zero(order + 1);
    a[std::min(2, order)] = 1.0;  // a square law: like a display's
    for (int round = 0; round < kRounds; ++round) {
        // a_order = 1 - sum of the others.
        Matrix normal = Matrix::Zero(order, order);
        Vector right = Vector::Zero(order);
        for (std::size_t i = first; i < pairs.size(); i += stride) {
            const Vector difference =
                pairs[i].longer.head(order + 1) - pairs[i].shorter.head(order + 1);
            const double radiance =
                0.5 * a.dot(pairs[i].longer.head(order + 1) + pairs[i].shorter.head(order + 1));
            if (!(radiance > 0.0)) continue;
            const double weight =
                1.0 / (radiance * radiance * (pairs[i].noise + kSpread * kSpread));
            const Vector row = difference.head(order).array() - difference[order];
            normal.noalias() += weight * row * row.transpose();
            right -= weight * difference[order] * row;
        }
        normal.diagonal().array() += kRidge * normal.diagonal().maxCoeff();
        a.head(order) = normal.ldlt().solve(right);
        a[order] = 1.0 - a.head(order).sum();
    }
    return a;
}

/// Mean square of the relative disagreement of the pairs first, first + stride, ...
double errorOf(const std::vector<PowerPair>& pairs, const Vector& a, std::size_t first)
{
    double sum = 0.0;
    std::size_t count = 0;
    for (std::size_t i = first; i < pairs.size(); i += 2) {
        const double longer = a.dot(pairs[i].longer.head(a.size()));
        const double shorter = a.dot(pairs[i].shorter.head(a.size()));
        const double off =
            std::min(std::abs(longer - shorter) / std::max(0.5 * (longer + shorter), 1e-30), 1.0);
        sum += off * off;
        ++count;
    }
    return count > 0 ? sum / static_cast<double>(count) : 1.0;
}

Vector fitBestOrder(const std::vector<PowerPair>& pairs)
{
    int best_order = 1;
    double least = 0.0;
    for (int order = 1; order <= kHighestOrder; ++order) {
        const double error = errorOf(pairs, fitOrder(pairs, order, 0, 2), 1) +
                             errorOf(pairs, fitOrder(pairs, order, 1, 2), 0);
        if (order > 1 && error >= least) continue;
        least = error;
        best_order = order;
    }
    return fitOrder(pairs, best_order, 0, 1);
}

}  // namespace

Decoders fitPolynomials(const std::array<PixelGroups, 3>& groups,
                        const std::vector<double>& log_exposures)
{
    std::vector<double> exposures;
    for (const double log_exposure : log_exposures)
        exposures.push_back(std::exp(log_exposure - log_exposures.front()));
    std::array<LogCurve, 3> decoders{};
    std::array<bool, 3> found{};
    parallelFor(0, 3, [&](std::int64_t channel) {
        const auto c = static_cast<std::size_t>(channel);
        const Vector a = fitBestOrder(powerPairs(groups[c], exposures));
        // Below the first code at which the polynomial is positive and rising, it says nothing: the
        // curve goes on as a power law there.
        std::array<double, kCodes> values{};
        for (std::size_t z = 0; z < values.size(); ++z) {
            double power = 1.0;
            for (Eigen::Index n = 0; n < a.size(); ++n, power *= static_cast<double>(z) / 255.0)
                values[z] += a[n] * power;
        }
        std::size_t lowest = values.size() - 1;
        while (lowest > 1 && values[lowest - 1] > 0.0 && values[lowest - 1] < values[lowest])
            --lowest;
        found[c] = lowest <= kHighestStart && std::isfinite(values[128]);
        if (!found[c]) return;
        for (std::size_t z = 0; z < values.size(); ++z) {
            const double below =
                (static_cast<double>(z) + 0.5) / (static_cast<double>(lowest) + 0.5);
            decoders[c][z] = z >= lowest ? std::log(values[z])
                                         : std::log(values[lowest]) + 2.0 * std::log(below);
        }
        const double middle = decoders[c][128];
        for (double& value : decoders[c])
            value -= middle;
    });
    if (!std::ranges::all_of(found, [](bool f) { return f; })) return std::nullopt;
    return decoders;
}

}  // namespace insitu::detail
