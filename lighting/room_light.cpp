#include "lighting/room_light.h"

#include "core/color.h"
#include "lighting/sampling.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Rooms larger than this many texels get larger texels.
constexpr double kMaxTexels = 1.5e6;

double totalArea(const SceneProxy& proxy)
{
    double sum = 0.0;
    for (std::size_t f = 0; f < proxy.faces().size(); ++f)
        sum += proxy.area(f);
    return sum;
}

/// Clipped lights are stronger than they look: draws them at least this often.
constexpr double kClippedShare = 0.3;

template <class IsClipped>
void liftClipped(std::vector<double>& weights, const IsClipped& is_clipped)
{
    double clipped = 0.0;
    double total = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        total += weights[i];
        if (is_clipped(i)) clipped += weights[i];
    }
    if (!(clipped > 0.0) || clipped >= kClippedShare * total) return;
    const double lift = kClippedShare / (1.0 - kClippedShare) * (total - clipped) / clipped;
    for (std::size_t i = 0; i < weights.size(); ++i)
        if (is_clipped(i)) weights[i] *= lift;
}

/// The proxy, once the options are found valid: the members are made from both.
const SceneProxy& checked(const SceneProxy& proxy, const RoomLightOptions& options)
{
    requireValid(options.validate(), "light options");
    return proxy;
}

}  // namespace

Findings RoomLightOptions::validate() const
{
    Findings findings;
    const auto demand = [&](bool holds, const char* message) {
        if (!holds) findings.push_back({Severity::Error, "option-out-of-range", message});
    };
    demand(texel_m > 0.0 && std::isfinite(texel_m), "texel_m must be > 0");
    demand(cell_m > 0.0 && std::isfinite(cell_m), "cell_m must be > 0");
    demand(rays_per_cell > 0, "rays_per_cell must be > 0");
    demand(std::isfinite(glm::dot(reference_point_m, reference_point_m)),
           "reference_point_m must be finite");
    return findings;
}

RoomLight::RoomLight(const SceneProxy& proxy,
                     const EnvironmentMap& probe,
                     glm::dvec3 probe_center_m,
                     const std::optional<PhotographedRadiance>& photograph,
                     const RoomLightOptions& options,
                     Progress& progress)
    : proxy_(checked(proxy, options)),
      radiance_(proxy, std::max(options.texel_m, std::sqrt(totalArea(proxy) / kMaxTexels))),
      probe_saw_(radiance_.size(), 0),
      photo_saw_(radiance_.size(), 0),
      clipped_(radiance_),
      cell_irradiance_(proxy,
                       std::max(options.cell_m, std::sqrt(totalArea(proxy) / (kMaxTexels / 64.0)))),
      cell_reflectance_(cell_irradiance_)
{
    findGaps(probe, probe_center_m);
    bakeProbe(probe, probe_center_m, progress);
    if (photograph) {
        fillFromPhotograph(*photograph);
        lookThroughBoxes(*photograph);
    }
    extendBeyondOpenings(probe, probe_center_m);
    buildTables(options.reference_point_m);

    // Surfaces that nobody saw need the light that falls on them, which needs all surfaces: twice.
    gatherCells(options, progress);
    fitUnmeasured(options, progress);
    reportCoverage(options.reference_point_m);
    if (hasFinding(findings_, "light-unseen-surfaces")) {
        fillUnseen();
        buildTables(options.reference_point_m);
        gatherCells(options, progress);
        fillUnseen();
        buildTables(options.reference_point_m);
    }
    scaleDoubtfulIrradiance();
}

double RoomLight::texelArea(std::size_t face) const
{
    const ProxyFace& f = proxy_.faces()[face];
    return glm::length(glm::cross(f.edge_u, f.edge_v)) /
           (static_cast<double>(radiance_.columns(face)) * radiance_.rows(face));
}

void RoomLight::buildTables(glm::dvec3 reference)
{
    // Surface texels: by the irradiance they can give at the reference point.
    std::vector<double> weights(radiance_.size(), 0.0);
    double surface_power = 0.0;
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        for (const std::size_t i : radiance_.texelsOf(face)) {
            if (!radiance_.valid(i)) continue;
            const glm::dvec3 way = proxy_.pointOn(face, radiance_.centerUv(i)) - reference;
            const double d2 = std::max(glm::dot(way, way), 0.05);
            const double cosine =
                std::max(std::abs(glm::dot(way, proxy_.faces()[face].normal)) / std::sqrt(d2), 0.1);
            weights[i] = luminance(radiance_[i]) * texelArea(face) * cosine / d2;
            surface_power += weights[i];
        }
    }
    if (surface_power > 0.0) {
        liftClipped(weights, [&](std::size_t i) { return clipped_[i] != Rgb(0.0f); });
        texel_table_.emplace(weights);
    }

    // Far directions: seen ones by their power, extended ones rarely.
    const Image<Rgb>& far = outside_.pixels;
    std::vector<double> far_weights(far.pixelCount(), 0.0);
    double far_power = 0.0;
    for (int y = 0; y < far.height(); ++y) {
        const double solid_angle = environmentTexelSolidAngle(far.width(), far.height(), y);
        for (int x = 0; x < far.width(); ++x) {
            const std::size_t i = static_cast<std::size_t>(y * far.width() + x);
            const double power = luminance(far(x, y)) * solid_angle;
            far_weights[i] = power * (outside_seen_[i] ? 1.0 : 0.02);
            if (outside_seen_[i]) far_power += power;
        }
    }
    if (far_power > 0.0) {
        if (!outside_.clipped.empty())
            liftClipped(far_weights,
                        [&](std::size_t i) { return outside_.clipped.pixels()[i] != Rgb(0.0f); });
        outside_table_.emplace(far_weights);
    }

    portal_triangles_.clear();
    portal_cumulative_area_.clear();
    double area = 0.0;
    for (const ProxyFace& face : proxy_.faces()) {
        for (const std::size_t opening : face.openings) {
            const std::vector<glm::dvec3>& c = proxy_.openings()[opening].corners_m;
            for (std::size_t i = 1; i + 1 < c.size(); ++i) {
                area += 0.5 * glm::length(glm::cross(c[i] - c[0], c[i + 1] - c[0]));
                portal_triangles_.push_back({c[0], c[i], c[i + 1]});
                portal_cumulative_area_.push_back(area);
            }
        }
    }

    const double total = surface_power + far_power;
    const double far_share =
        far_power > 0.0 ? (texel_table_ ? std::clamp(far_power / total, 0.1, 0.9) : 1.0) : 0.0;
    texel_share_ = texel_table_ ? 1.0 - far_share : 0.0;
    portal_share_ = portal_triangles_.empty() ? 0.0 : 0.5 * far_share;
    outside_share_ = far_share - portal_share_;
}

Rgb RoomLight::faceRadiance(std::size_t face, glm::dvec2 uv) const
{
    return radiance_.lookUp(face, uv, Rgb(0.0f));
}

Rgb RoomLight::probeRadiance(std::size_t face, glm::dvec2 uv) const
{
    return probe_saw_[radiance_.texelAt(face, uv)] ? faceRadiance(face, uv) : Rgb(0.0f);
}

double RoomLight::texelPdf(std::size_t face, glm::dvec2 uv) const
{
    return texel_share_ > 0.0
               ? texel_share_ * texel_table_->probability(radiance_.texelAt(face, uv)) /
                     texelArea(face)
               : 0.0;
}

std::uint8_t RoomLight::outsideBand(glm::dvec3 direction) const
{
    const Image<Rgb>& far = outside_.pixels;
    const glm::ivec2 texel = environmentTexelAt(far.width(), far.height(), direction);
    return outside_band_[static_cast<std::size_t>(texel.y * far.width() + texel.x)];
}

double RoomLight::outsidePdf(glm::dvec3 direction) const
{
    if (!(outside_share_ > 0.0)) return 0.0;
    const Image<Rgb>& far = outside_.pixels;
    const glm::ivec2 texel = environmentTexelAt(far.width(), far.height(), direction);
    return outside_share_ *
           outside_table_->probability(static_cast<std::size_t>(texel.y * far.width() + texel.x)) /
           environmentTexelSolidAngle(far.width(), far.height(), texel.y);
}

std::optional<ProxyHit> RoomLight::intersect(glm::dvec3 x, glm::dvec3 direction) const
{
    auto hit = proxy_.intersect(x, direction);
    while (hit && !gap_.empty() && gap_[radiance_.texelAt(hit->face, hit->uv)]) {
        const double passed = hit->distance_m;
        hit = proxy_.intersect(hit->point, direction);
        if (hit) hit->distance_m += passed;
    }
    return hit;
}

RoomLight::Arrival RoomLight::arrive(glm::dvec3 x, glm::dvec3 direction) const
{
    Arrival arrival;
    arrival.hit = intersect(x, direction);
    if (arrival.hit) arrival.distance_m = arrival.hit->distance_m;
    arrival.radiance = arrival.hit && !arrival.hit->opening
                           ? faceRadiance(arrival.hit->face, arrival.hit->uv)
                           : lookUp(outside_, direction);
    return arrival;
}

double RoomLight::pdf(const Arrival& arrival, glm::dvec3 direction) const
{
    if (!arrival.hit) return outsidePdf(direction);
    const ProxyHit& hit = *arrival.hit;
    const double cosine = std::abs(glm::dot(hit.normal, direction));
    const double per_area = hit.distance_m * hit.distance_m / std::max(cosine, 1e-9);
    return hit.opening
               ? outsidePdf(direction) + portal_share_ / portal_cumulative_area_.back() * per_area
               : texelPdf(hit.face, hit.uv) * per_area;
}

Rgb RoomLight::clippedOf(const Arrival& arrival, glm::dvec3 direction) const
{
    if (clipped_sources_.empty()) return Rgb(0.0f);
    return arrival.hit && !arrival.hit->opening
               ? clipped_.lookUp(arrival.hit->face, arrival.hit->uv, Rgb(0.0f))
               : lookUpClipped(outside_, direction);
}

IncidentLight RoomLight::incident(glm::dvec3 x, glm::dvec3 direction) const
{
    const DrawnArrival drawn = arriveWithPdf(x, direction);
    return {drawn.arrival.radiance, drawn.arrival.distance_m, drawn.pdf};
}

RoomLight::DrawnArrival RoomLight::arriveWithPdf(glm::dvec3 x, glm::dvec3 direction) const
{
    const Arrival arrival = arrive(x, direction);
    return {direction, arrival, pdf(arrival, direction)};
}

std::optional<LightSample> RoomLight::sample(glm::dvec3 x, double selector, glm::vec2 u) const
{
    const auto drawn = draw(x, selector, u);
    if (!drawn) return std::nullopt;
    return LightSample{
        drawn->direction, drawn->arrival.distance_m, drawn->arrival.radiance, drawn->pdf};
}

std::optional<RoomLight::DrawnArrival> RoomLight::draw(glm::dvec3 x,
                                                       double selector,
                                                       glm::vec2 u) const
{
    glm::dvec3 target;
    std::size_t wanted_face = 0;
    const bool on_surface = selector < texel_share_;
    bool far = false;
    if (on_surface) {
        const auto drawn = texel_table_->sample(selector / texel_share_);
        const auto texel = radiance_.texel(drawn.index);
        wanted_face = texel.face;
        target = proxy_.pointOn(texel.face, radiance_.uv(texel, glm::dvec2(u)));
    } else if (selector < texel_share_ + portal_share_) {
        const double place =
            (selector - texel_share_) / portal_share_ * portal_cumulative_area_.back();
        const auto chosen = std::lower_bound(
            portal_cumulative_area_.begin(), portal_cumulative_area_.end() - 1, place);
        const auto& t =
            portal_triangles_[static_cast<std::size_t>(chosen - portal_cumulative_area_.begin())];
        const glm::dvec2 b = uniformTriangle(u);
        target = t[0] + b.x * (t[1] - t[0]) + b.y * (t[2] - t[0]);
    } else {
        if (!(outside_share_ > 0.0)) return std::nullopt;
        const double rest = (selector - texel_share_ - portal_share_) / outside_share_;
        const auto drawn = outside_table_->sample(std::clamp(rest, 0.0, 0.9999999));
        target =
            directionInTexel(outside_.pixels.width(), outside_.pixels.height(), drawn.index, u);
        far = true;
    }

    // The drawn place counts only when it is what is seen from x.
    const glm::dvec3 way = far ? target : target - x;
    const double length = glm::length(way);
    if (!(length > 1e-9)) return std::nullopt;
    const glm::dvec3 direction = way / length;
    const Arrival arrival = arrive(x, direction);
    const bool sees_surface = arrival.hit && !arrival.hit->opening;
    if (sees_surface != on_surface) return std::nullopt;
    if (on_surface && (arrival.hit->face != wanted_face ||
                       std::abs(arrival.hit->distance_m - length) > 1e-6 * (1.0 + length)))
        return std::nullopt;
    const double density = pdf(arrival, direction);
    if (!(density > 0.0)) return std::nullopt;
    return DrawnArrival{direction, arrival, density};
}

}  // namespace insitu
