#include "lighting/environment_light.h"

#include "core/check.h"
#include "core/color.h"
#include "lighting/sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

bool isUsable(const Rgb& c)
{
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b) && c.r >= 0.0f &&
           c.g >= 0.0f && c.b >= 0.0f;
}

}  // namespace

EnvironmentLight::EnvironmentLight(EnvironmentMap environment,
                                   std::vector<Portal> portals,
                                   std::vector<AreaLamp> lamps)
    : environment_(std::move(environment)), lamps_(std::move(lamps)), portal_count_(portals.size())
{
    buildSky();
    for (const Portal& portal : portals)
        targets_.push_back(makeTarget(portal.quad, sky_brightness_, true));
    for (const AreaLamp& lamp : lamps_) {
        INSITU_CHECK(isUsable(lamp.radiance),
                     "lamp radiance ({}, {}, {})",
                     lamp.radiance.r,
                     lamp.radiance.g,
                     lamp.radiance.b);
        targets_.push_back(
            makeTarget(lamp.quad, static_cast<double>(luminance(lamp.radiance)), lamp.two_sided));
    }
}

void EnvironmentLight::buildSky()
{
    const Image<Rgb>& image = environment_.pixels;
    const int width = image.width();
    const int height = image.height();
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            INSITU_CHECK(isUsable(image(x, y)), "environment pixel ({}, {}) is unusable", x, y);

    // The mean of the bilinear look-up over a texel has weights (1, 6, 1)/8 along each axis.
    std::vector<double> weights(image.pixelCount());
    std::vector<double> row_mean(static_cast<std::size_t>(width));
    double total = 0.0;
    for (int y = 0; y < height; ++y) {
        const int above = std::max(y - 1, 0);
        const int below = std::min(y + 1, height - 1);
        for (int x = 0; x < width; ++x)
            row_mean[static_cast<std::size_t>(x)] =
                (static_cast<double>(luminance(image(x, above))) +
                 6.0 * static_cast<double>(luminance(image(x, y))) +
                 static_cast<double>(luminance(image(x, below)))) /
                8.0;
        const double solid_angle = environmentTexelSolidAngle(width, height, y);
        for (int x = 0; x < width; ++x) {
            const double mean = (row_mean[static_cast<std::size_t>((x + width - 1) % width)] +
                                 6.0 * row_mean[static_cast<std::size_t>(x)] +
                                 row_mean[static_cast<std::size_t>((x + 1) % width)]) /
                                8.0;
            const std::size_t texel =
                static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(x);
            weights[texel] = mean * solid_angle;
            total += weights[texel];
        }
    }
    if (!(total > 0.0)) return;
    sky_table_.emplace(weights);
    sky_density_.resize(weights.size());
    for (std::size_t texel = 0; texel < weights.size(); ++texel) {
        const int y = static_cast<int>(texel / static_cast<std::size_t>(width));
        sky_density_[texel] = static_cast<float>(sky_table_->probability(texel) /
                                                 environmentTexelSolidAngle(width, height, y));
    }
    sky_brightness_ = total / (4.0 * pi);
}

EnvironmentLight::Target EnvironmentLight::makeTarget(const Quad& quad,
                                                      double brightness,
                                                      bool two_sided)
{
    const glm::dvec3 across = glm::cross(quad.edge_u, quad.edge_v);
    Target target;
    target.quad = quad;
    target.area = glm::length(across);
    INSITU_CHECK(std::isfinite(target.area) && target.area > 0.0, "area {}", target.area);
    target.normal = across / target.area;
    target.across_u = glm::cross(quad.edge_v, target.normal) / target.area;
    target.across_v = glm::cross(target.normal, quad.edge_u) / target.area;
    target.brightness = brightness;
    target.two_sided = two_sided;
    return target;
}

std::optional<EnvironmentLight::Crossing> EnvironmentLight::cross(const Target& target,
                                                                  glm::dvec3 x,
                                                                  glm::dvec3 direction)
{
    const double cosine = glm::dot(direction, target.normal);
    if (cosine == 0.0 || (!target.two_sided && cosine > 0.0)) return std::nullopt;
    const glm::dvec3 to_corner = target.quad.corner - x;
    const double distance = glm::dot(to_corner, target.normal) / cosine;
    if (!(distance > 0.0) || !std::isfinite(distance)) return std::nullopt;
    const glm::dvec3 p = distance * direction - to_corner;
    const double s = glm::dot(target.across_u, p);
    const double t = glm::dot(target.across_v, p);
    if (s < 0.0 || s > 1.0 || t < 0.0 || t > 1.0) return std::nullopt;
    // dω = dA |cos| / d².
    return Crossing{distance, distance * distance / (target.area * std::abs(cosine))};
}

double EnvironmentLight::estimate(const Target& target, glm::dvec3 x)
{
    const glm::dvec3 centre =
        target.quad.corner + 0.5 * (target.quad.edge_u + target.quad.edge_v) - x;
    if (!target.two_sided && !(glm::dot(target.quad.corner - x, target.normal) < 0.0)) return 0.0;
    return target.brightness * target.area / (glm::dot(centre, centre) + target.area);
}

std::span<const double> EnvironmentLight::sharesAt(glm::dvec3 x) const
{
    // Scratch of the calling thread: valid until its next call, which saves an allocation per ray.
    thread_local std::vector<double> shares;
    shares.assign(targets_.size() + 1, 0.0);
    // With portals the environment is seen through them alone: it keeps only the least share.
    const double least_sky = 1e-6 * sky_brightness_;
    shares[0] = portal_count_ > 0 ? least_sky : 2.0 * pi * sky_brightness_;
    for (std::size_t i = 0; i < targets_.size(); ++i)
        shares[i + 1] = estimate(targets_[i], x);

    double total = 0.0;
    int contributing = 0;
    for (const double share : shares) {
        total += share;
        contributing += share > 0.0 ? 1 : 0;
    }
    if (!(total > 0.0)) return shares;
    const double least = std::min(0.1, 0.5 / contributing);
    for (double& share : shares)
        if (share > 0.0) share = least + (1.0 - contributing * least) * share / total;
    return shares;
}

double EnvironmentLight::skyPdf(glm::dvec3 direction) const
{
    const int width = environment_.pixels.width();
    const int height = environment_.pixels.height();
    const glm::ivec2 at = environmentTexelAt(width, height, direction);
    const std::size_t texel = static_cast<std::size_t>(at.y) * static_cast<std::size_t>(width) +
                              static_cast<std::size_t>(at.x);
    return static_cast<double>(sky_density_[texel]);
}

glm::dvec3 EnvironmentLight::drawSky(double u, double v) const
{
    const AliasTable::Draw draw = sky_table_->sample(u);
    return directionInTexel(environment_.pixels.width(),
                            environment_.pixels.height(),
                            draw.index,
                            {static_cast<float>(draw.remapped), static_cast<float>(v)});
}

std::optional<glm::dvec3> EnvironmentLight::drawDirection(std::span<const double> shares,
                                                          glm::dvec3 x,
                                                          double selector,
                                                          glm::vec2 u) const
{
    double remaining = selector;
    std::size_t strategy = shares.size();
    for (std::size_t i = 0; i < shares.size(); ++i) {
        if (!(shares[i] > 0.0)) continue;
        strategy = i;
        if (remaining < shares[i]) break;
        remaining -= shares[i];
    }
    if (strategy == shares.size()) return std::nullopt;
    if (strategy > 0) {
        const Quad& quad = targets_[strategy - 1].quad;
        const glm::dvec3 point = quad.corner + static_cast<double>(u.x) * quad.edge_u +
                                 static_cast<double>(u.y) * quad.edge_v;
        const double distance = glm::length(point - x);
        if (!(distance > 0.0)) return std::nullopt;
        return (point - x) / distance;
    }
    const double fine = remaining / shares[0];
    return drawSky(fine, static_cast<double>(u.y));
}

IncidentLight EnvironmentLight::arrive(std::span<const double> shares,
                                       glm::dvec3 x,
                                       glm::dvec3 direction) const
{
    IncidentLight light;
    const AreaLamp* nearest = nullptr;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
        const std::optional<Crossing> crossing = cross(targets_[i], x, direction);
        if (!crossing) continue;
        light.pdf += shares[i + 1] * crossing->pdf;
        if (i < portal_count_ || crossing->distance_m >= light.distance_m) continue;
        light.distance_m = crossing->distance_m;
        nearest = &lamps_[i - portal_count_];
    }
    if (shares[0] > 0.0) light.pdf += shares[0] * skyPdf(direction);
    if (nearest != nullptr)
        light.radiance = nearest->radiance;
    else if (sky_table_)
        light.radiance = lookUp(environment_, direction);
    return light;
}

std::optional<LightSample> EnvironmentLight::sample(glm::dvec3 x,
                                                    double selector,
                                                    glm::vec2 u) const
{
    const std::span<const double> shares = sharesAt(x);
    const std::optional<glm::dvec3> direction = drawDirection(shares, x, selector, u);
    if (!direction) return std::nullopt;
    const IncidentLight light = arrive(shares, x, *direction);
    if (!(light.pdf > 0.0)) return std::nullopt;
    return LightSample{*direction, light.distance_m, light.radiance, light.pdf};
}

IncidentLight EnvironmentLight::incident(glm::dvec3 x, glm::dvec3 direction) const
{
    return arrive(sharesAt(x), x, direction);
}

}  // namespace insitu
