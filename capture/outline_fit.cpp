#include "capture/outline_fit.h"

#include "core/parallel.h"
#include "core/random.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace insitu::detail {

using std::numbers::pi;

namespace {

/// Radial derivatives below so many standard deviations are noise, and at the second many an edge
/// has half of full weight: that an edge is there counts, not how strong it is, for a rim before a
/// plain wall is weaker than what is mirrored beside it.
constexpr double kEdgeDeviations = 5.0;
constexpr double kClearDeviations = 15.0;
/// Along the outline rays are averaged over this angle: a rim goes on, clutter and noise do not.
constexpr double kAverageRadians = 6.0 * pi / 180.0;
/// An edge faces the centre when its normal is within 25 degrees of the ray.
constexpr double kFacing = 0.9;
constexpr int kHypotheses = 600;
constexpr int kSteps = 30;
/// Sectors whose scatter gives the standard deviation.
constexpr int kSectors = 36;
constexpr int kFewestRays = 12;
/// Largest e of an ellipse: half axes 1.25 : 1.
constexpr double kMostStretch = 0.11;

/// Slope of a Gaussian at whole samples, scaled so that white noise of 1 gives 1.
std::vector<double> derivativeKernel(double sigma_samples)
{
    const int half = static_cast<int>(std::ceil(3.0 * sigma_samples));
    std::vector<double> kernel;
    double squares = 0.0;
    for (int i = -half; i <= half; ++i) {
        kernel.push_back(i * std::exp(-0.5 * i * i / (sigma_samples * sigma_samples)));
        squares += kernel.back() * kernel.back();
    }
    for (double& value : kernel)
        value /= std::sqrt(squares);
    return kernel;
}

/// Offset in (-0.5, 0.5) of the maximum of the parabola through three samples.
double parabolaPeak(double before, double at, double after)
{
    const double bend = before - 2.0 * at + after;
    return bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

/// Through three points; nothing when they lie on a line.
std::optional<Circle> circleThrough(glm::dvec2 a, glm::dvec2 b, glm::dvec2 c)
{
    const glm::dvec2 ab = b - a;
    const glm::dvec2 ac = c - a;
    const double twice = 2.0 * (ab.x * ac.y - ab.y * ac.x);
    if (std::abs(twice) < 1e-9) return std::nullopt;
    const double bb = glm::dot(ab, ab);
    const double cc = glm::dot(ac, ac);
    const glm::dvec2 center((ac.y * bb - ab.y * cc) / twice, (ab.x * cc - ac.x * bb) / twice);
    return Circle{a + center, glm::length(center)};
}

double supportOf(const std::vector<RimRay>& rays, const Circle& circle, double tolerance)
{
    double sum = 0.0;
    for (const RimRay& ray : rays) {
        double best = 0.0;
        for (const RimPoint& point : ray) {
            const double off =
                (glm::length(point.place - circle.center) - circle.radius) / tolerance;
            if (std::abs(off) < 1.0) best = std::max(best, point.weight * (1.0 - off * off));
        }
        sum += best;
    }
    return sum;
}

/// A ray's place nearest to the curve.
struct Nearest {
    double off = std::numeric_limits<double>::infinity();  ///< outwards, pixels
    double angle = 0.0;
    double weight = 0.0;
};
Nearest nearestTo(const Outline& outline, const RimRay& ray)
{
    Nearest nearest;
    for (const RimPoint& point : ray) {
        const glm::dvec2 arm = point.place - outline.center;
        const double angle = std::atan2(arm.y, arm.x);
        const double off = glm::length(arm) - outline.radiusAt(angle);
        if (std::abs(off) < std::abs(nearest.off)) nearest = {off, angle, point.weight};
    }
    return nearest;
}

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

/// The curve's change outwards by centre x, y, radius and both stretches, to first order.
Vector5 slopes(double angle, double radius, int parameters)
{
    Vector5 j;
    j << std::cos(angle), std::sin(angle), 1.0, radius * std::cos(2.0 * angle),
        radius * std::sin(2.0 * angle);
    for (int i = parameters; i < 5; ++i)
        j(i) = 0.0;
    return j;
}

}  // namespace

glm::dvec2 rayDirection(int ray, int rays)
{
    const double angle = 2.0 * pi * ray / rays;
    return {std::cos(angle), std::sin(angle)};
}

double Outline::radiusAt(double angle) const
{
    const double e = glm::length(stretch);
    if (e == 0.0) return radius;
    const double turn = angle - 0.5 * std::atan2(stretch.y, stretch.x);
    const double a = 1.0 + e;
    const double b = 1.0 - e;
    return radius * a * b / std::hypot(b * std::cos(turn), a * std::sin(turn));
}

std::vector<Eigen::MatrixXf> rayProfiles(const OutlinePicture& picture,
                                         const Outline& outline,
                                         int rays,
                                         int samples,
                                         double step,
                                         double average_radians)
{
    const auto layers = 3 * static_cast<Eigen::Index>(picture.frames());
    std::vector<Eigen::MatrixXf> single(static_cast<std::size_t>(rays));
    parallelFor(0, rays, [&](std::int64_t index) {
        const glm::dvec2 direction = rayDirection(static_cast<int>(index), rays);
        const double radius = outline.radiusAt(std::atan2(direction.y, direction.x));
        if (!picture.contains(outline.center + radius * direction)) return;
        Eigen::MatrixXf& profiles = single[static_cast<std::size_t>(index)];
        profiles.resize(samples, layers);
        for (std::size_t f = 0; f < picture.frames(); ++f) {
            const Rgb scale = 1.0f / picture.noise(f);
            for (int i = 0; i < samples; ++i) {
                const double r = std::max(radius + (i - 0.5 * (samples - 1)) * step, 0.0);
                const Rgb value = scale * picture.sample(f, outline.center + r * direction);
                for (int c = 0; c < 3; ++c)
                    profiles(i, 3 * static_cast<Eigen::Index>(f) + c) = value[c];
            }
        }
    });
    const int half = static_cast<int>(average_radians / (4.0 * pi) * rays);
    std::vector<Eigen::MatrixXf> result(static_cast<std::size_t>(rays));
    parallelFor(0, rays, [&](std::int64_t index) {
        const auto i = static_cast<std::size_t>(index);
        if (single[i].size() == 0) return;
        Eigen::MatrixXf sum = Eigen::MatrixXf::Zero(samples, layers);
        int count = 0;
        for (int k = -half; k <= half; ++k) {
            const auto& other =
                single[static_cast<std::size_t>((static_cast<int>(index) + k + rays) % rays)];
            if (other.size() == 0) continue;
            sum += other;
            ++count;
        }
        result[i] = sum / std::sqrt(static_cast<float>(count));
    });
    return result;
}

std::vector<RimRay> scanEdges(const OutlinePicture& picture,
                              const Outline& outline,
                              int rays,
                              double half_window,
                              double sigma)
{
    const double step = std::max(0.5 * sigma, 0.5);
    const std::vector<double> kernel = derivativeKernel(sigma / step);
    const auto reach = static_cast<int>(kernel.size() / 2);
    const int half = static_cast<int>(std::ceil(half_window / step)) + 1;
    const std::vector<Eigen::MatrixXf> profiles =
        rayProfiles(picture, outline, rays, 2 * (half + reach) + 1, step, kAverageRadians);
    std::vector<RimRay> result(static_cast<std::size_t>(rays));
    parallelFor(0, rays, [&](std::int64_t index) {
        const Eigen::MatrixXf& profile = profiles[static_cast<std::size_t>(index)];
        if (profile.size() == 0) return;
        const glm::dvec2 direction = rayDirection(static_cast<int>(index), rays);
        const double radius = outline.radiusAt(std::atan2(direction.y, direction.x));
        std::vector<double> response(static_cast<std::size_t>(2 * half + 1), 0.0);
        for (std::size_t i = 0; i < response.size(); ++i) {
            Eigen::RowVectorXf slope = Eigen::RowVectorXf::Zero(profile.cols());
            for (std::size_t k = 0; k < kernel.size(); ++k)
                slope +=
                    static_cast<float>(kernel[k]) * profile.row(static_cast<Eigen::Index>(i + k));
            response[i] = slope.cwiseAbs().maxCoeff();
        }
        for (std::size_t i = 1; i + 1 < response.size(); ++i) {
            const double at = response[i];
            if (at < kEdgeDeviations || at < response[i - 1] || at <= response[i + 1]) continue;
            const double peak =
                static_cast<double>(i) - half + parabolaPeak(response[i - 1], at, response[i + 1]);
            const glm::dvec2 place =
                outline.center + std::max(radius + peak * step, 0.0) * direction;
            if (picture.contains(place))
                result[static_cast<std::size_t>(index)].push_back(
                    {place, at / (at + kClearDeviations)});
        }
    });
    return result;
}

std::vector<RimRay> sortEdges(const std::vector<Edge>& edges,
                              const Outline& outline,
                              int rays,
                              double half_window)
{
    std::vector<RimRay> result(static_cast<std::size_t>(rays));
    for (const Edge& edge : edges) {
        const glm::dvec2 arm = edge.place - outline.center;
        const double length = glm::length(arm);
        const double angle = std::atan2(arm.y, arm.x);
        if (std::abs(length - outline.radiusAt(angle)) > half_window) continue;
        if (std::abs(glm::dot(arm, edge.normal)) < kFacing * length) continue;
        const int ray = static_cast<int>(std::floor(angle / (2.0 * pi) * rays)) + rays;
        result[static_cast<std::size_t>(ray % rays)].push_back({edge.place, edge.weight});
    }
    return result;
}

std::optional<Outline> consensusCircle(const std::vector<RimRay>& rays,
                                       const Outline& near,
                                       double reach,
                                       double tolerance)
{
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (!rays[i].empty()) used.push_back(i);
    if (used.size() < 3) return std::nullopt;
    std::optional<Circle> best;
    double most = 0.0;
    const auto consider = [&](const Circle& circle) {
        if (glm::length(circle.center - near.center) > reach ||
            std::abs(circle.radius - near.radius) > reach)
            return;
        const double votes = supportOf(rays, circle, tolerance);
        if (votes <= most) return;
        most = votes;
        best = circle;
    };
    consider({near.center, near.radius});
    RandomStream random(1, 0, 0);
    for (int i = 0; i < kHypotheses; ++i) {
        std::array<glm::dvec2, 3> points;
        for (glm::dvec2& point : points) {
            const RimRay& ray = rays[used[random.below(static_cast<std::uint32_t>(used.size()))]];
            point = ray[random.below(static_cast<std::uint32_t>(ray.size()))].place;
        }
        if (const auto circle = circleThrough(points[0], points[1], points[2])) consider(*circle);
    }
    if (!best) return std::nullopt;
    return Outline{best->center, best->radius, glm::dvec2(0.0)};
}

std::optional<OutlineFit> fitOutline(const std::vector<RimRay>& rays,
                                     const Outline& start,
                                     bool ellipse,
                                     Tolerance tolerance)
{
    const int parameters = ellipse ? 5 : 3;
    Outline outline = start;
    if (!ellipse) outline.stretch = glm::dvec2(0.0);
    Matrix5 normal;
    std::vector<Vector5> sectors;
    int inliers = 0;
    double support = 0.0;
    for (int step = 0; step < kSteps; ++step) {
        normal.setZero();
        for (int i = parameters; i < 5; ++i)
            normal(i, i) = 1.0;
        sectors.assign(kSectors, Vector5::Zero());
        Vector5 pull = Vector5::Zero();
        inliers = 0;
        support = 0.0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const Nearest nearest = nearestTo(outline, rays[i]);
            const double u =
                nearest.off / (nearest.off < 0.0 ? tolerance.inside : tolerance.outside);
            if (!(std::abs(u) < 1.0)) continue;
            ++inliers;
            support += nearest.weight;
            const double weight = nearest.weight * (1.0 - u * u) * (1.0 - u * u);
            const Vector5 j = slopes(nearest.angle, outline.radius, parameters);
            normal += weight * j * j.transpose();
            pull += weight * nearest.off * j;
            sectors[i * kSectors / rays.size()] += weight * nearest.off * j;
        }
        if (inliers < kFewestRays) return std::nullopt;
        const Vector5 change = normal.ldlt().solve(pull);
        if (!change.allFinite()) return std::nullopt;
        outline.center += glm::dvec2(change(0), change(1));
        outline.radius += change(2);
        outline.stretch += glm::dvec2(change(3), change(4));
        const double e = glm::length(outline.stretch);
        if (e > kMostStretch) outline.stretch *= kMostStretch / e;
        if (!(outline.radius > 1.0)) return std::nullopt;
        if (change.cwiseAbs().maxCoeff() < 1e-6) break;
    }
    // Neighbouring rays err together: the scatter of whole sectors tells how much (sandwich).
    Matrix5 scatter = Matrix5::Zero();
    for (const Vector5& sector : sectors)
        scatter += sector * sector.transpose();
    const Matrix5 inverse = normal.inverse();
    const Matrix5 covariance = inverse * scatter * inverse;
    OutlineFit fit;
    fit.outline = outline;
    fit.center_sigma = std::sqrt(std::max(covariance(0, 0), covariance(1, 1)));
    fit.radius_sigma = std::sqrt(covariance(2, 2));
    fit.inliers = inliers;
    fit.support = support;
    return fit;
}

}  // namespace insitu::detail
