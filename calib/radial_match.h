#pragma once

#include "core/camera.h"

#include <optional>

/// Internal to calib/: polynomial lens distortions as the division model of core/camera.h and back.
/// Not installed.
namespace insitu::foreign {

/// A radial polynomial, straight to distorted, of radii in focal lengths: r (1 + k1 r² + k2 r⁴).
struct RadialPolynomial {
    double k1 = 0.0;
    double k2 = 0.0;
};

/// The division model that agrees with the polynomial at half the picture's diagonal, and how far
/// the two are apart at most inside of it, pixels.
struct RadialMatch {
    double division = 0.0;
    double worst_px = 0.0;
};

/// camera   its size and focal length are read; x and y are averaged
/// Nothing when the polynomial folds over before the corner, or needs |λ| > 0.5.
[[nodiscard]] std::optional<RadialMatch> divisionOf(const RadialPolynomial& polynomial,
                                                    const Camera& camera);
/// k1 that agrees with the camera's λ at half the diagonal, and the same difference.
struct PolynomialMatch {
    double k1 = 0.0;
    double worst_px = 0.0;
};
[[nodiscard]] PolynomialMatch polynomialOf(const Camera& camera);

}  // namespace insitu::foreign
