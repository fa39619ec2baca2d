#include "calib/radial_match.h"

#include <algorithm>
#include <cmath>

namespace insitu::foreign {

namespace {

constexpr int kSteps = 100;
constexpr double kMostDivision = 0.5;

/// Half the diagonal, in pixels and in focal lengths.
struct Scale {
    double half_px = 0.0;
    double half = 0.0;

    explicit Scale(const Camera& camera)
        : half_px(0.5 * std::hypot(camera.width, camera.height)),
          half(half_px / (0.5 * (camera.focal_px.x + camera.focal_px.y)))
    {
    }
};

double distorted(const RadialPolynomial& p, double straight)
{
    const double r2 = straight * straight;
    return straight * (1.0 + p.k1 * r2 + p.k2 * r2 * r2);
}

/// The largest difference, pixels, over straight radii up to `most`.
double worstOf(const RadialPolynomial& p, double division, double most, const Scale& scale)
{
    double worst = 0.0;
    for (int i = 1; i <= kSteps; ++i) {
        const double straight = most * i / kSteps;
        const double seen = distorted(p, straight);
        const double again = seen / (1.0 + division * seen * seen / (scale.half * scale.half));
        worst = std::max(worst, std::abs(again - straight) / scale.half * scale.half_px);
    }
    return worst;
}

}  // namespace

std::optional<RadialMatch> divisionOf(const RadialPolynomial& polynomial, const Camera& camera)
{
    const Scale scale(camera);
    // The straight radius that is seen at the corner, with the way there rising.
    double low = 0.0;
    const double step = scale.half / kSteps;
    while (distorted(polynomial, low + step) < scale.half) {
        if (distorted(polynomial, low + step) <= distorted(polynomial, low) ||
            low > 4.0 * scale.half)
            return std::nullopt;
        low += step;
    }
    double high = low + step;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (distorted(polynomial, middle) < scale.half ? low : high) = middle;
    }
    const double straight = 0.5 * (low + high);
    RadialMatch match;
    match.division = scale.half / straight - 1.0;
    if (!(std::abs(match.division) <= kMostDivision)) return std::nullopt;
    match.worst_px = worstOf(polynomial, match.division, straight, scale);
    return match;
}

PolynomialMatch polynomialOf(const Camera& camera)
{
    const Scale scale(camera);
    const double straight = scale.half / (1.0 + camera.division);
    PolynomialMatch match;
    match.k1 = camera.division / (straight * straight);
    match.worst_px = worstOf({match.k1, 0.0}, camera.division, straight, scale);
    return match;
}

}  // namespace insitu::foreign
