#pragma once

#include "calib/camera_constraints.h"
#include "calib/camera_problem.h"

#include <cstddef>
#include <optional>
#include <vector>

/// Internal to calib/: the solve with doubts about what was marked. Not installed.
namespace insitu::calibration {

struct Fit {
    Solution solution;
    Choice choice;  ///< as used in the end; sigma_px may have grown
    std::array<bool, kUnknowns> free{};
    double cost = 0.0;  ///< χ², corners included
    double freedom = 0.0;
    bool inconsistent = false;          ///< residuals larger than the stated error explains
    std::vector<std::size_t> outliers;  ///< segments left out: they run along no axis given
    std::vector<std::size_t> contradicting_lengths;
    std::vector<double> lengths_off;  ///< share by which each known length comes out longer

    [[nodiscard]] Matrix covariance() const { return covarianceOf(solution.information, free); }
};

/// Maximum likelihood with these steps, each only where needed:
///  * common corners are separated when they contradict the lines;
///  * segments with a w-statistic above 4.5 (times the noise that the rest shows) are left out, the
///    worst first, no more than a third of an axis';
///  * known lengths that contradict the rest by 3 σ and 2 % keep no say;
///  * when residuals are still too large for sigma_px, all errors are taken larger by what they
///    show, so that priors get the weight that they deserve and the covariance is honest.
/// choice.used_segments and length_sigmas_m are filled in here. Nothing when no solve converges.
/// Source: [Baarda68] for the w-statistic and one-by-one testing.
[[nodiscard]] std::optional<Fit> fit(const LineSet& lines, const State& start, Choice choice);

/// |λ| in standard deviations if it were free, by one Gauss–Newton step from the solution.
[[nodiscard]] double divisionScore(const Fit& fit);

/// The camera of a state, for the equations of camera_constraints.h.
[[nodiscard]] View<double> viewAt(const LineSet& lines, const State& at);

/// Distance of the ends of segment `index` from the best line through its vanishing point, pixels.
[[nodiscard]] double endDistance(const LineSet& lines, std::size_t index, const State& at);

/// A length as the camera sees it, metres; nothing when an end is not on the floor.
[[nodiscard]] std::optional<double> measuredLength(const LineSet& lines,
                                                   const KnownLength& length,
                                                   const State& at);

}  // namespace insitu::calibration
