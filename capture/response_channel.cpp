#include "capture/response_channel.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu::detail {

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kFirstSpread = 0.02;
constexpr double kLeastSpread = 5e-4;
/// Variance of rounding, codes^2, and how a spread of codes averages it out: the first Fourier
/// coefficient of its sawtooth, squared.
constexpr double kRounding = 1.0 / 12.0;
constexpr double kDither = 4.0 * std::numbers::pi * std::numbers::pi;
constexpr double kMostSpread = 0.2;
/// Median of the square of a standard normal deviate, less what each group's E takes up.
constexpr double kMedianSquare = 0.455 * 0.7;
/// Residuals beyond this many standard deviations lose weight (Huber).
constexpr double kHuber = 2.5;

}  // namespace

ChannelFit::ChannelFit(const PixelGroups& groups,
                       const std::vector<double>& log_exposures,
                       const CurveModel& model)
    : groups_(groups),
      log_exposures_(log_exposures),
      model_(model),
      c_(model.start),
      spread_(kFirstSpread)
{
    const Eigen::Index n = model.columns.cols();
    for (int z = 0; z < kCodes; ++z) {
        int first = static_cast<int>(n);
        int last = 0;
        for (int j = 0; j < n; ++j) {
            if (model.columns(z, j) == 0.0) continue;
            first = std::min(first, j);
            last = j + 1;
        }
        first_[static_cast<std::size_t>(z)] = std::min(first, last);
        last_[static_cast<std::size_t>(z)] = last;
    }
    rows_ = model.columns;
}

double ChannelFit::rms() const
{
    double sum = 0.0;
    double weights = 0.0;
    for (const Residual& r : residuals_) {
        const double w = 1.0 / (r.noise + spread_ * spread_);
        sum += w * r.square;
        weights += w;
    }
    return weights > 0.0 ? std::sqrt(sum / weights) : 0.0;
}

void ChannelFit::lineariseView(
    const GroupView& view, const Vector& g, const Vector& exposure, Linear& to, double& noise) const
{
    double mean = 0.0;
    double squares = 0.0;
    double code = 0.0;
    double code_squares = 0.0;
    const int count = static_cast<int>(view.shares.size());
    for (int i = 0; i < count; ++i) {
        const double share = view.shares[static_cast<std::size_t>(i)];
        const double part = share * exposure[view.low + i];
        mean += part;
        squares += part * exposure[view.low + i];
        code += share * i;
        code_squares += share * i * i;
    }
    // Rounding is no noise where many codes are hit, and a third of a code where only one is.
    const double spread = std::max(code_squares - code * code - kRounding, 0.0);
    const int middle = std::clamp(view.low + static_cast<int>(std::lround(code)), 1, kCodes - 2);
    const double slope = 0.5 * (g[middle + 1] - g[middle - 1]);
    noise = std::max(squares / (mean * mean) - 1.0, 0.0) / view.count +
            slope * slope * kRounding * std::exp(-kDither * spread);
    to.frame = view.frame;
    to.low = first_[static_cast<std::size_t>(view.low)];
    to.high = last_[static_cast<std::size_t>(view.low + count - 1)];
    to.weight = 1.0 / (noise + spread_ * spread_);
    to.row.assign(static_cast<std::size_t>(std::max(to.high - to.low, 0)), 0.0);
    double varying = 0.0;  // p^T (g - offset)
    for (int i = 0; i < count; ++i) {
        const int z = view.low + i;
        const double p = view.shares[static_cast<std::size_t>(i)] * exposure[z] / mean;
        if (p == 0.0) continue;
        varying += p * (g[z] - model_.offset[z]);
        const double* column = &rows_(z, 0);
        for (int j = first_[static_cast<std::size_t>(z)]; j < last_[static_cast<std::size_t>(z)];
             ++j)
            to.row[static_cast<std::size_t>(j - to.low)] += p * column[j];
    }
    to.target = log_exposures_[static_cast<std::size_t>(view.frame)] + varying - std::log(mean);
}

/// sum w r r^T - (sum w r)(sum w r)^T / sum w, upper triangle.
void ChannelFit::addGroup(System& system, const std::vector<Linear>& views, std::size_t count) const
{
    const Eigen::Index n = model_.columns.cols();
    Vector sum = Vector::Zero(n);
    Vector frames = Vector::Zero(system.d.size());
    double target = 0.0;
    double total = 0.0;
    int low = static_cast<int>(n);
    int high = 0;
    for (std::size_t v = 0; v < count; ++v) {
        const Linear& view = views[v];
        const double w = view.weight;
        const Eigen::Index length = view.high - view.low;
        const Eigen::Map<const Vector> row(view.row.data(), length);
        for (Eigen::Index j = 0; j < length; ++j)
            system.cc.col(view.low + j).segment(view.low, j + 1) += w * row[j] * row.head(j + 1);
        system.cd.col(view.frame).segment(view.low, length) -= w * row;
        system.dd(view.frame, view.frame) += w;
        system.c.segment(view.low, length) += w * view.target * row;
        system.d[view.frame] -= w * view.target;
        sum.segment(view.low, length) += w * row;
        frames[view.frame] -= w;
        target += w * view.target;
        total += w;
        low = std::min(low, view.low);
        high = std::max(high, view.high);
    }
    const Eigen::Index length = std::max(high - low, 0);
    const Vector part = sum.segment(low, length);
    for (Eigen::Index j = 0; j < length; ++j)
        system.cc.col(low + j).segment(low, j + 1) -= (part[j] / total) * part.head(j + 1);
    system.c.segment(low, length) -= (target / total) * part;
    system.d -= (target / total) * frames;
    system.dd -= frames * frames.transpose() / total;
    for (std::size_t v = 0; v < count; ++v)
        if (const int k = views[v].frame; frames[k] != 0.0) {
            system.cd.col(k).segment(low, length) -= (frames[k] / total) * part;
            frames[k] = 0.0;
        }
}

System ChannelFit::linearise(const Vector& d, bool robust)
{
    const Eigen::Index n = model_.columns.cols();
    System system{Matrix::Zero(n, n),
                  Matrix::Zero(n, d.size()),
                  Matrix::Zero(d.size(), d.size()),
                  Vector::Zero(n),
                  Vector::Zero(d.size())};
    const Vector g = logDecoder();
    const Vector exposure = g.array().exp();
    residuals_.clear();
    std::vector<Linear> views(4);
    std::array<double, 4> noise{};
    std::array<double, 4> error{};
    for (const PixelGroup& group : groups_) {
        const std::size_t count = group.views.size();
        double mean = 0.0;
        double total = 0.0;
        for (std::size_t v = 0; v < count; ++v) {
            Linear& view = views[v];
            lineariseView(group.views[v], g, exposure, view, noise[v]);
            double at = -view.target - d[view.frame];
            for (int j = view.low; j < view.high; ++j)
                at += view.row[static_cast<std::size_t>(j - view.low)] * c_[j];
            error[v] = at;
            mean += view.weight * at;
            total += view.weight;
        }
        for (std::size_t v = 0; v < count; ++v) {
            const double off = error[v] - mean / total;
            residuals_.push_back({off * off, noise[v]});
            const double deviation = std::abs(off) * std::sqrt(views[v].weight);
            if (robust && deviation > kHuber) views[v].weight *= kHuber / deviation;
        }
        addGroup(system, views, count);
    }
    system.cc = system.cc.selfadjointView<Eigen::Upper>();
    return system;
}

void ChannelFit::measureSpread()
{
    if (residuals_.size() < 10) return;
    std::vector<double> squares(residuals_.size());
    double low = kLeastSpread;
    double high = kMostSpread;
    for (int i = 0; i < 12; ++i) {
        const double middle = std::sqrt(low * high);
        for (std::size_t j = 0; j < squares.size(); ++j)
            squares[j] = residuals_[j].square / (residuals_[j].noise + middle * middle);
        const auto median = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
        std::ranges::nth_element(squares, median);
        (*median > kMedianSquare ? low : high) = middle;
    }
    spread_ = std::sqrt(low * high);
}

}  // namespace insitu::detail
