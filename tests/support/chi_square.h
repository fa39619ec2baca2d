#pragma once

#include "core/environment_map.h"
#include "core/random.h"

#include <glm/glm.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <optional>
#include <vector>

/// Does a sampler draw with the density it claims? Pearson's χ² test.
namespace insitu::chi_square {

/// Chance of a false alarm over all tests of one test program together.
inline constexpr double kSignificance = 0.01;
/// Bins that expect fewer draws are pooled: below about 5 the statistic no longer follows χ².
inline constexpr double kMinimumExpected = 5.0;

/// Šidák: the level of one of `tests` tests so that all together keep kSignificance.
[[nodiscard]] inline double sidakLevel(int tests)
{
    return 1.0 - std::pow(1.0 - kSignificance, 1.0 / tests);
}

/// P(χ² with `dof` degrees of freedom > statistic): regularised upper incomplete gamma function
/// Q(dof/2, statistic/2), by its series below the mean and its continued fraction above
/// (Abramowitz & Stegun 6.5.29 and 6.5.31).
[[nodiscard]] inline double upperTail(double statistic, int dof)
{
    const double a = 0.5 * dof;
    const double x = 0.5 * statistic;
    if (!(x > 0.0)) return 1.0;
    const double front = std::exp(a * std::log(x) - x - std::lgamma(a));
    if (x < a + 1.0) {
        double term = 1.0 / a;
        double sum = term;
        for (int n = 1; n < 10000 && term > sum * 1e-16; ++n) {
            term *= x / (a + n);
            sum += term;
        }
        return 1.0 - front * sum;
    }
    double b = x + 1.0 - a;
    double c = 1e300;
    double d = 1.0 / b;
    double fraction = d;
    for (int n = 1; n < 10000; ++n) {
        const double an = -n * (n - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        fraction *= c * d;
        if (std::abs(c * d - 1.0) < 1e-15) break;
    }
    return front * fraction;
}

struct Result {
    double statistic = 0.0;
    int dof = 0;
    double p = 1.0;
};

/// observed and expected counts of the same bins.
[[nodiscard]] inline Result compare(const std::vector<double>& observed,
                                    const std::vector<double>& expected)
{
    Result result;
    double pooled_observed = 0.0;
    double pooled_expected = 0.0;
    int bins = 0;
    const auto add = [&](double o, double e) {
        result.statistic += (o - e) * (o - e) / e;
        ++bins;
    };
    for (std::size_t i = 0; i < observed.size(); ++i) {
        // A draw where the density is zero can never be right.
        if (expected[i] <= 0.0 && observed[i] > 0.0) return {1e300, 1, 0.0};
        if (expected[i] >= kMinimumExpected) {
            add(observed[i], expected[i]);
            continue;
        }
        pooled_observed += observed[i];
        pooled_expected += expected[i];
        if (pooled_expected >= kMinimumExpected) {
            add(pooled_observed, pooled_expected);
            pooled_observed = pooled_expected = 0.0;
        }
    }
    result.dof = bins - 1;
    result.p = result.dof > 0 ? upperTail(result.statistic, result.dof) : 1.0;
    return result;
}

/// A sampler of directions and the density per solid angle that it claims. "Nothing" is an answer:
/// its share is what the density lacks to 1.
using DrawDirection = std::function<std::optional<glm::dvec3>(RandomStream&)>;
using DirectionPdf = std::function<double(glm::dvec3)>;

struct DirectionTest {
    int rows = 16;     ///< bins in polar angle about +y
    int columns = 32;  ///< bins in azimuth
    int inner = 16;    ///< quadrature points a bin and axis
    int draws = 50000;
    std::uint64_t seed = 1;
};

/// Expects p above `level` and the density's integral to be at most 1.
inline void expectDirections(const DrawDirection& draw,
                             const DirectionPdf& pdf,
                             const DirectionTest& test,
                             double level)
{
    using std::numbers::pi;
    const auto bin_count = static_cast<std::size_t>(test.rows * test.columns);
    std::vector<double> observed(bin_count + 1, 0.0);
    for (int i = 0; i < test.draws; ++i) {
        RandomStream random(test.seed, 0, static_cast<std::uint64_t>(i));
        std::size_t bin = bin_count;
        if (const std::optional<glm::dvec3> direction = draw(random)) {
            ASSERT_NEAR(glm::length(*direction), 1.0, 1e-9);
            const glm::dvec2 uv = environmentUvFromDirection(*direction);
            const int row = std::clamp(static_cast<int>(uv.y * test.rows), 0, test.rows - 1);
            const int column =
                std::clamp(static_cast<int>(uv.x * test.columns), 0, test.columns - 1);
            bin = static_cast<std::size_t>(row * test.columns + column);
        }
        observed[bin] += 1.0;
    }

    std::vector<double> expected(bin_count + 1, 0.0);
    const int fine_rows = test.rows * test.inner;
    const int fine_columns = test.columns * test.inner;
    for (int y = 0; y < fine_rows; ++y) {
        const double solid_angle = environmentTexelSolidAngle(fine_columns, fine_rows, y);
        for (int x = 0; x < fine_columns; ++x) {
            const glm::dvec3 direction =
                environmentDirectionFromUv({(x + 0.5) / fine_columns, (y + 0.5) / fine_rows});
            expected[static_cast<std::size_t>(y / test.inner * test.columns + x / test.inner)] +=
                pdf(direction) * solid_angle * test.draws;
        }
    }
    const double total = std::accumulate(expected.begin(), expected.end(), 0.0);
    EXPECT_LT(total, 1.002 * test.draws) << "the density integrates to more than 1";
    // Within the quadrature's error of 1, "nothing" is not expected at all.
    expected[bin_count] = std::max(0.0, test.draws - total);
    if (observed[bin_count] == 0.0) expected[bin_count] = 0.0;

    const Result result = compare(observed, expected);
    EXPECT_GT(result.dof, 3);
    EXPECT_GT(result.p, level) << "chi² " << result.statistic << " with " << result.dof
                               << " degrees of freedom; integral " << total / test.draws
                               << ", nothing drawn " << observed[bin_count];
}

}  // namespace insitu::chi_square
