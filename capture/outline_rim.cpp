#include "capture/outline_rim.h"

#include "core/parallel.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace insitu::detail {

namespace {

/// Samples of a profile are at least so far apart, places tried half of that. Pixels.
constexpr double kFinestStep = 0.5;
/// ... or this share of the reach: a far reach is there to find a place, not to measure it.
constexpr double kStepShare = 1.0 / 12.0;
/// What a profile shows beyond the farthest place tried: share of the radius, and limits in pixels.
constexpr double kMarginShare = 0.04;
constexpr double kLeastMargin = 1.5;
constexpr double kMostMargin = 4.0;
/// Rays are averaged along the outline over this angle.
constexpr double kAverageRadians = 3.0 * std::numbers::pi / 180.0;
/// Standard deviations of blur tried: pixel and bilinear look-up alone, up to out of focus.
constexpr std::array<double, 4> kBlurs = {0.5, 0.8, 1.3, 2.1};
/// A place that is as uncertain as this, pixels, has half of full weight.
constexpr double kFirmPlace = 0.15;
/// More uncertain places are dropped.
constexpr double kLoosePlace = 1.0;
/// Numbers of the profile's model.
constexpr int kShapes = 4;

using Basis = Eigen::Matrix<double, Eigen::Dynamic, kShapes>;

/// The four shapes at `s` pixels inside the rim, blurred: a sum over the Gaussian.
Eigen::Matrix<double, 1, kShapes> shapesAt(double s, double blur)
{
    constexpr int kTaps = 32;
    Eigen::Matrix<double, 1, kShapes> sum = Eigen::Matrix<double, 1, kShapes>::Zero();
    double weights = 0.0;
    for (int i = -kTaps; i <= kTaps; ++i) {
        const double z = 4.0 * i / kTaps;
        const double weight = std::exp(-0.5 * z * z);
        const double at = s + z * blur;
        weights += weight;
        if (at > 0.0)
            sum += weight * Eigen::Matrix<double, 1, kShapes>(0.0, 0.0, 1.0, std::sqrt(at));
        else
            sum += weight * Eigen::Matrix<double, 1, kShapes>(1.0, -at, 0.0, 0.0);
    }
    return sum / weights;
}

/// Orthonormal bases of the model's profiles, one for each place tried.
class RimModel {
public:
    RimModel(double reach, double margin, double blur)
        : step_(std::max(kFinestStep, kStepShare * reach)),
          places_(2 * static_cast<int>(std::ceil(2.0 * reach / step_)) + 1),
          samples_(2 * static_cast<int>(std::ceil((reach + margin) / step_)) + 1)
    {
        for (int place = 0; place < places_; ++place) {
            Basis basis(samples_, kShapes);
            for (int i = 0; i < samples_; ++i)
                basis.row(i) = shapesAt(offsetOf(place) - sampleOffset(i), blur);
            bases_.push_back(basis.householderQr().householderQ() *
                             Basis::Identity(samples_, kShapes));
        }
    }

    [[nodiscard]] double step() const { return step_; }
    [[nodiscard]] int samples() const { return samples_; }
    [[nodiscard]] double offsetOf(double place) const
    {
        return (place - 0.5 * (places_ - 1)) * 0.5 * step_;
    }
    [[nodiscard]] double sampleOffset(int i) const { return (i - 0.5 * (samples_ - 1)) * step_; }
    /// Sum of squares that the model leaves of profiles (columns), for each place.
    [[nodiscard]] Eigen::VectorXd residuals(const Eigen::MatrixXd& profiles) const
    {
        const double all = profiles.squaredNorm();
        Eigen::VectorXd left(places_);
        for (int place = 0; place < places_; ++place)
            left(place) = std::max(
                all -
                    (bases_[static_cast<std::size_t>(place)].transpose() * profiles).squaredNorm(),
                0.0);
        return left;
    }

private:
    double step_;
    int places_;
    int samples_;
    std::vector<Basis> bases_;
};

struct Place {
    double offset = 0.0;
    double sigma = std::numeric_limits<double>::infinity();
    double misfit = 0.0;  ///< mean square of what is left, in noise
};

/// The best place of one ray; its curvature gives the uncertainty, in units of what is left.
Place bestPlace(const RimModel& model, Eigen::MatrixXd profiles)
{
    profiles.rowwise() -= profiles.colwise().mean().eval();
    const Eigen::VectorXd left = model.residuals(profiles);
    Eigen::Index at = 0;
    Place best;
    best.misfit = left.minCoeff(&at) / static_cast<double>(profiles.size());
    if (at == 0 || at + 1 == left.size()) return best;
    const double bend = left(at - 1) - 2.0 * left(at) + left(at + 1);
    if (!(bend > 0.0)) return best;
    const double shift = std::clamp(0.5 * (left(at - 1) - left(at + 1)) / bend, -0.5, 0.5);
    best.offset = model.offsetOf(static_cast<double>(at) + shift);
    best.sigma = 0.5 * model.step() * std::sqrt(2.0 * std::max(best.misfit, 1.0) / bend);
    return best;
}

}  // namespace

std::vector<RimRay> locateRim(const OutlinePicture& picture,
                              const Outline& outline,
                              int rays,
                              double reach)
{
    const auto count = static_cast<std::size_t>(rays);
    std::vector<Place> best;
    double best_misfit = std::numeric_limits<double>::infinity();
    const double margin = std::clamp(kMarginShare * outline.radius, kLeastMargin, kMostMargin);
    std::vector<Eigen::MatrixXf> profiles;
    for (const double blur : kBlurs) {
        const RimModel model(reach, margin, blur);
        if (profiles.empty())
            profiles =
                rayProfiles(picture, outline, rays, model.samples(), model.step(), kAverageRadians);
        std::vector<Place> places(count);
        parallelFor(0, rays, [&](std::int64_t index) {
            const auto i = static_cast<std::size_t>(index);
            if (profiles[i].size() > 0) places[i] = bestPlace(model, profiles[i].cast<double>());
        });
        // The logarithm keeps a few rays across clutter from deciding.
        double misfit = 0.0;
        for (const Place& place : places)
            misfit += std::log(1.0 + place.misfit);
        if (misfit >= best_misfit) continue;
        best_misfit = misfit;
        best = std::move(places);
    }
    std::vector<RimRay> result(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Place& place = best[i];
        if (!(place.sigma < kLoosePlace)) continue;
        const glm::dvec2 direction = rayDirection(static_cast<int>(i), rays);
        const double radius = outline.radiusAt(std::atan2(direction.y, direction.x));
        const double share = place.sigma / kFirmPlace;
        result[i].push_back(
            {outline.center + (radius + place.offset) * direction, 1.0 / (1.0 + share * share)});
    }
    return result;
}

}  // namespace insitu::detail
