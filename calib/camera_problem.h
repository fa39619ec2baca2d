#pragma once

#include "calib/camera_system.h"
#include "calib/line_segments.h"
#include "calib/orientation.h"

#include <optional>
#include <vector>

/// Internal to calib/: what a user marked, as observations and equations. Not installed.
namespace insitu::calibration {

/// What of a LineSet takes part, and with which errors.
struct Choice {
    double sigma_px = 1.0;
    Eigen::Vector2d principal_px = Eigen::Vector2d::Zero();
    double principal_sigma_px = 0.0;  ///< 0: known exactly
    std::optional<FocalPrior> focal;
    std::optional<double> division_sigma;  ///< λ is unknown, with this prior about the LineSet's
    bool shared_corners = true;
    std::vector<bool> used_segments;      ///< one per segment
    std::vector<double> length_sigmas_m;  ///< one per known length
};

struct Posed {
    Problem problem;
    /// χ² and degrees of freedom of corners: several marks of what is one point.
    double corner_cost = 0.0;
    double corner_freedom = 0.0;
};

[[nodiscard]] Posed pose(const LineSet& lines, const Choice& choice);

}  // namespace insitu::calibration
