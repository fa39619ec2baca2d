#include "calib/metric_scale.h"

#include "core/check.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <optional>
#include <vector>

namespace insitu {

namespace {

/// A ray that falls less than this per unit length meets the floor too far away to be measured.
constexpr double kHorizon = 1e-3;
/// A contradiction of scale counts from this many standard deviations and this share on.
constexpr double kDisagreementSigmas = 3.0;
constexpr double kDisagreementShare = 0.02;
/// Steps of the central differences: radians (and ln f), pixels, metres.
constexpr double kStep = 1e-5;
constexpr double kStepPx = 1e-2;

/// All that the position depends on, as one vector that can be varied number by number.
struct Unknowns {
    glm::dvec3 rotation{0.0};  ///< small rotation vector in the camera's frame
    double log_focal = 0.0;    ///< change of ln(focal)
    glm::dvec2 origin_px{0.0};
    std::vector<KnownLength> lengths;
    double height_m = 0.0;  ///< given camera height
};

/// Unit ray in the world through a pixel, the camera turned and zoomed by the unknowns.
glm::dvec3 rayThrough(glm::dvec2 pixel, const Camera& camera, const Unknowns& unknowns)
{
    const glm::dvec2 focal = camera.focal_px * std::exp(unknowns.log_focal);
    glm::dvec3 ray((pixel - camera.principal_px) / focal, 1.0);
    // The inverse of a small turn, exact to first order, which is all the differences need.
    ray -= glm::cross(unknowns.rotation, ray);
    return glm::normalize(camera.right * ray.x - camera.up * ray.y + camera.forward * ray.z);
}

/// Floor point seen at a pixel, relative to the camera, for a camera height of 1.
std::optional<glm::dvec3> floorPoint(glm::dvec2 pixel,
                                     const Camera& camera,
                                     const Unknowns& unknowns)
{
    const glm::dvec3 ray = rayThrough(pixel, camera, unknowns);
    if (ray.y > -kHorizon) return std::nullopt;
    return ray / -ray.y;
}

/// A known length in units of the camera's height; nothing when it is not on the floor.
std::optional<double> lengthPerHeight(const KnownLength& length,
                                      const Camera& camera,
                                      const Unknowns& unknowns)
{
    const auto from = floorPoint(length.from_px, camera, unknowns);
    if (!from) return std::nullopt;
    if (length.on == KnownLength::On::Floor) {
        const auto to = floorPoint(length.to_px, camera, unknowns);
        if (!to) return std::nullopt;
        return glm::length(*to - *from);
    }
    // The point of the ray that is horizontally nearest to the vertical; its height is the length.
    const glm::dvec3 ray = rayThrough(length.to_px, camera, unknowns);
    const glm::dvec2 level(ray.x, ray.z);
    const double along = glm::dot(level, glm::dvec2(from->x, from->z)) / glm::dot(level, level);
    const double height = along * ray.y + 1.0;
    if (!std::isfinite(height) || along <= 0.0 || height <= 0.0) return std::nullopt;
    return height;
}

/// Root of Σ (∂value/∂end · σ)² over the two marked ends, as a share of the value.
double markedShare(const KnownLength& length, double value, const Camera& camera, double sigma_px)
{
    double sum = 0.0;
    for (int coordinate = 0; coordinate < 4; ++coordinate) {
        KnownLength varied[2] = {length, length};
        for (int side = 0; side < 2; ++side) {
            glm::dvec2& end = coordinate < 2 ? varied[side].from_px : varied[side].to_px;
            end[coordinate % 2] += side == 0 ? kStepPx : -kStepPx;
        }
        const auto plus = lengthPerHeight(varied[0], camera, {});
        const auto minus = lengthPerHeight(varied[1], camera, {});
        if (!plus || !minus) continue;
        const double change = (*plus - *minus) / (2.0 * kStepPx) * sigma_px / value;
        sum += change * change;
    }
    return std::sqrt(sum);
}

/// Camera height that fits the lengths best: m_i ≈ h·l_i with standard deviations h·l_i·share_i.
std::optional<double> fittedHeight(const Camera& camera,
                                   const Unknowns& unknowns,
                                   const std::vector<double>& shares)
{
    double numerator = 0.0;
    double denominator = 0.0;
    for (std::size_t i = 0; i < unknowns.lengths.size(); ++i) {
        const auto per_height = lengthPerHeight(unknowns.lengths[i], camera, unknowns);
        if (!per_height || !(*per_height > 0.0)) return std::nullopt;
        const double weight = 1.0 / (shares[i] * shares[i]);
        numerator += weight * unknowns.lengths[i].metres / *per_height;
        denominator += weight;
    }
    return numerator / denominator;
}

struct Scene {
    const Camera& camera;
    const std::vector<double>& shares;
    bool height_given;
};

std::optional<glm::dvec3> positionAt(const Scene& scene, const Unknowns& unknowns)
{
    const auto origin = floorPoint(unknowns.origin_px, scene.camera, unknowns);
    if (!origin) return std::nullopt;
    double height = unknowns.height_m;
    if (!scene.height_given) {
        const auto fitted = fittedHeight(scene.camera, unknowns, scene.shares);
        if (!fitted) return std::nullopt;
        height = *fitted;
    }
    return -height * *origin;
}

/// ∂position for one change of the unknowns, by central differences, times its σ.
glm::dvec3 effect(const Scene& scene,
                  const Unknowns& centre,
                  double step,
                  double sigma,
                  const std::function<void(Unknowns&, double)>& vary)
{
    Unknowns plus = centre;
    Unknowns minus = centre;
    vary(plus, step);
    vary(minus, -step);
    const auto p = positionAt(scene, plus);
    const auto m = positionAt(scene, minus);
    if (!p || !m) return glm::dvec3(0.0);
    return (*p - *m) / (2.0 * step) * sigma;
}

glm::dvec3 positionSigma(const Scene& scene,
                         const Unknowns& centre,
                         const OrientationEstimate& orientation,
                         double sigma_px,
                         double height_sigma_m)
{
    glm::dvec3 variance(0.0);
    glm::dvec3 by[4];
    for (int i = 0; i < 4; ++i)
        by[i] = effect(scene, centre, kStep, 1.0, [i](Unknowns& unknowns, double change) {
            if (i < 3)
                unknowns.rotation[i] += change;
            else
                unknowns.log_focal += change;
        });
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            variance += by[i] * by[j] * orientation.covariance[i][j];
    const auto add =
        [&](double step, double sigma, const std::function<void(Unknowns&, double)>& vary) {
            const glm::dvec3 change = effect(scene, centre, step, sigma, vary);
            variance += change * change;
        };
    for (int k = 0; k < 2; ++k) {
        add(kStepPx, sigma_px, [k](Unknowns& u, double change) { u.origin_px[k] += change; });
        for (std::size_t i = 0; !scene.height_given && i < centre.lengths.size(); ++i) {
            add(kStepPx, sigma_px, [i, k](Unknowns& u, double change) {
                u.lengths[i].from_px[k] += change;
            });
            add(kStepPx, sigma_px, [i, k](Unknowns& u, double change) {
                u.lengths[i].to_px[k] += change;
            });
        }
    }
    if (scene.height_given && height_sigma_m > 0.0)
        add(1e-4 * centre.height_m, height_sigma_m, [](Unknowns& u, double change) {
            u.height_m += change;
        });
    return glm::sqrt(glm::max(variance, glm::dvec3(0.0)));
}

/// ln-share by which the unknown rotation and focal length may change a length.
double orientationShare(const KnownLength& length,
                        double value,
                        const Camera& camera,
                        const OrientationEstimate& orientation)
{
    double by[4] = {};
    for (int i = 0; i < 4; ++i) {
        Unknowns varied[2];
        for (int side = 0; side < 2; ++side) {
            const double change = side == 0 ? kStep : -kStep;
            if (i < 3)
                varied[side].rotation[i] = change;
            else
                varied[side].log_focal = change;
        }
        const auto plus = lengthPerHeight(length, camera, varied[0]);
        const auto minus = lengthPerHeight(length, camera, varied[1]);
        if (plus && minus) by[i] = (*plus - *minus) / (2.0 * kStep) / value;
    }
    double variance = 0.0;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
            variance += by[i] * by[j] * orientation.covariance[i][j];
    return std::sqrt(std::max(variance, 0.0));
}

Findings checkLengths(const Unknowns& unknowns,
                      const std::vector<double>& shares,
                      double height_m,
                      double height_sigma_m,
                      const Camera& camera,
                      const OrientationEstimate& orientation)
{
    Findings findings;
    for (std::size_t i = 0; i < unknowns.lengths.size(); ++i) {
        const KnownLength& length = unknowns.lengths[i];
        const double per_height = *lengthPerHeight(length, camera, unknowns);
        const double measured = height_m * per_height;
        const double off = measured / length.metres - 1.0;
        const double sigma = std::hypot(shares[i],
                                        orientationShare(length, per_height, camera, orientation),
                                        height_sigma_m / height_m);
        if (std::abs(off) < std::max(kDisagreementShare, kDisagreementSigmas * sigma)) continue;
        findings.push_back(
            {Severity::Warning,
             "scale-disagrees",
             fmt::format("known length {} is given as {:.3f} m but comes out as {:.3f} m ({:+.1f} "
                         "%, expected within {:.1f} %) with the camera {:.3f} m above the floor; "
                         "check its ends and its number",
                         i,
                         length.metres,
                         measured,
                         100.0 * off,
                         300.0 * sigma,
                         height_m)});
    }
    return findings;
}

}  // namespace

CameraPlace placeCamera(const LineSet& lines,
                        const Camera& camera,
                        const OrientationEstimate& orientation,
                        double sigma_px,
                        const std::string& source)
{
    if (!lines.camera_height_m && lines.lengths.empty())
        throw NoAnswerError(
            source, "scale", "no scale: give the camera's height or a known length");
    Unknowns centre;
    centre.origin_px = lines.origin_px;
    centre.lengths = lines.lengths;
    const auto origin = floorPoint(lines.origin_px, camera, centre);
    if (!origin)
        throw NoAnswerError(
            source,
            "origin_px",
            fmt::format("({:.1f}, {:.1f}) lies on or above the horizon, so no floor "
                        "point is seen there; mark a point on the floor",
                        lines.origin_px.x,
                        lines.origin_px.y));
    std::vector<double> shares;
    for (std::size_t i = 0; i < lines.lengths.size(); ++i) {
        const auto per_height = lengthPerHeight(lines.lengths[i], camera, centre);
        if (!per_height || !(*per_height > 0.0))
            throw NoAnswerError(source,
                                fmt::format("scale.lengths[{}]", i),
                                "does not lie on the floor or straight above a floor point as seen "
                                "from this camera; check its ends");
        shares.push_back(markedShare(lines.lengths[i], *per_height, camera, sigma_px));
    }
    const bool height_given = lines.camera_height_m.has_value();
    const double height =
        height_given ? *lines.camera_height_m : *fittedHeight(camera, centre, shares);
    centre.height_m = height;

    const Scene scene{camera, shares, height_given};
    CameraPlace place;
    place.position_m = -height * *origin;
    place.position_sigma_m =
        positionSigma(scene, centre, orientation, sigma_px, lines.camera_height_sigma_m);
    place.findings = checkLengths(centre,
                                  shares,
                                  height,
                                  height_given ? lines.camera_height_sigma_m : 0.0,
                                  camera,
                                  orientation);
    return place;
}

}  // namespace insitu
