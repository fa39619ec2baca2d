#pragma once

#include "capture/response_groups.h"
#include "capture/response_solve.h"

#include <Eigen/Dense>

#include <array>
#include <vector>

namespace insitu::detail {

/// Curves that a fit may choose from: ln exposure by code = offset + columns * c, where c costs
/// c^T penalty c.
struct CurveModel {
    Eigen::VectorXd offset;   ///< 256
    Eigen::MatrixXd columns;  ///< 256 x n
    Eigen::MatrixXd penalty;  ///< n x n
    Eigen::VectorXd start;    ///< n: where the iteration begins
};

struct CurveFit {
    std::array<LogCurve, 3> decoder{};  ///< right on average; see curveOfDecoder
    std::array<double, 3> residual{};   ///< RMS of ln exposure, weighted
    std::vector<double> log_scale;      ///< ln of the correction of each frame's exposure
};

/// Maximum likelihood of the groups under the model; see response_fit.cpp. With
/// `refine_exposures` the frames' exposures are corrected too where they are clearly off.
[[nodiscard]] CurveFit fitCurves(const std::array<PixelGroups, 3>& groups,
                                 const std::vector<double>& log_exposures,
                                 const CurveModel& model,
                                 bool refine_exposures);

/// Exposure at each code exactly, from the decoder that is right on average for rounded codes;
/// `variance` as BracketPixels::rounding_variance.
[[nodiscard]] LogCurve curveOfDecoder(const LogCurve& decoder, double variance);

/// [DebMal97]: any curve, smooth as cameras' are. `smoothness` is the penalty's weight; see
/// response_models.cpp.
[[nodiscard]] CurveModel smoothModel(double smoothness);
/// As [GroNay04], from a family of our own: few principal components of published curves.
[[nodiscard]] const CurveModel& basisModel();

}  // namespace insitu::detail
