#pragma once

#include "capture/response_fit.h"

#include <Eigen/Dense>

#include <array>
#include <vector>

namespace insitu::detail {

/// A view of a group, linearised; columns [low, high) of the model take part.
struct Linear {
    int frame = 0;
    int low = 0;
    int high = 0;
    double target = 0.0;
    double weight = 0.0;
    std::vector<double> row;
};

/// Normal equations of one channel: the curve's coefficients c and the frames' corrections d.
struct System {
    Eigen::MatrixXd cc;
    Eigen::MatrixXd cd;
    Eigen::MatrixXd dd;
    Eigen::VectorXd c;
    Eigen::VectorXd d;
};

/// What one residual was and how much of it the pixels' noise explains, squared.
struct Residual {
    double square = 0.0;
    double noise = 0.0;
};

/// Gauss-Newton on one channel; the mathematics stand in response_fit.cpp.
class ChannelFit {
public:
    ChannelFit(const PixelGroups& groups,
               const std::vector<double>& log_exposures,
               const CurveModel& model);

    [[nodiscard]] Eigen::VectorXd logDecoder() const { return model_.offset + model_.columns * c_; }

    /// Normal equations about the current curve and corrections.
    System linearise(const Eigen::VectorXd& d, bool robust);
    /// Measures f from the residuals of the last linearise().
    void measureSpread();
    void setCoefficients(Eigen::VectorXd c) { c_ = std::move(c); }
    /// RMS of the residuals of the last linearise(), weighted.
    [[nodiscard]] double rms() const;

private:
    void lineariseView(const GroupView& view,
                       const Eigen::VectorXd& g,
                       const Eigen::VectorXd& exposure,
                       Linear& to,
                       double& noise) const;
    void addGroup(System& system, const std::vector<Linear>& views, std::size_t count) const;

    using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

    const PixelGroups& groups_;
    const std::vector<double>& log_exposures_;
    const CurveModel& model_;
    Eigen::VectorXd c_;
    RowMatrix rows_;
    std::array<int, kCodes> first_{};
    std::array<int, kCodes> last_{};
    double spread_;
    std::vector<Residual> residuals_;
};

}  // namespace insitu::detail
