#include "lighting/room_light.h"

#include "core/color.h"
#include "core/parallel.h"
#include "core/random.h"
#include "lighting/sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// Rooms larger than this many texels get larger texels.
constexpr double kMaxTexels = 1.5e6;
/// Points per texel side at which the probe is looked up.
constexpr int kBakeGrid = 2;
/// No Lambert surface reflects more; what is brighter shines by itself.
constexpr float kMaxReflectance = 0.95f;
/// [GibCha03] section 4.2: for surfaces that no picture saw.
constexpr float kUnseenReflectance = 0.5f;

double totalArea(const SceneProxy& proxy)
{
    double sum = 0.0;
    for (std::size_t f = 0; f < proxy.faces().size(); ++f)
        sum += proxy.area(f);
    return sum;
}

}  // namespace

RoomLight::RoomLight(const SceneProxy& proxy,
                     const EnvironmentMap& probe,
                     glm::dvec3 probe_center_m,
                     const std::optional<PhotographedRadiance>& photograph,
                     const RoomLightOptions& options,
                     Progress& progress)
    : proxy_(proxy),
      radiance_(proxy, std::max(options.texel_m, std::sqrt(totalArea(proxy) / kMaxTexels))),
      probe_saw_(radiance_.size(), 0),
      photo_saw_(radiance_.size(), 0),
      cell_irradiance_(proxy,
                       std::max(options.cell_m, std::sqrt(totalArea(proxy) / (kMaxTexels / 64.0)))),
      cell_reflectance_(cell_irradiance_)
{
    bakeProbe(probe, probe_center_m, progress);
    if (photograph) fillFromPhotograph(*photograph);
    extendBeyondOpenings(probe, probe_center_m);
    buildTables(options.reference_point_m);

    // Surfaces that nobody saw need the light that falls on them, which needs all surfaces: twice.
    gatherCells(options, progress);
    reportCoverage();
    if (hasFinding(findings_, "light-unseen-surfaces")) {
        fillUnseen();
        buildTables(options.reference_point_m);
        gatherCells(options, progress);
        fillUnseen();
        buildTables(options.reference_point_m);
    }
}

void RoomLight::bakeProbe(const EnvironmentMap& probe, glm::dvec3 center, Progress& progress)
{
    // Average the probe over the points of each texel that it saw and that are no opening.
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        progress.checkpoint();
        const int columns = radiance_.columns(face);
        parallelFor(0, radiance_.rows(face), [&](std::int64_t row) {
            for (int column = 0; column < columns; ++column) {
                const typename FaceGrid<Rgb>::Texel texel{face, column, static_cast<int>(row)};
                const std::size_t index =
                    radiance_.firstOf(face) + static_cast<std::size_t>(row * columns + column);
                Rgb sum(0.0f);
                int seen = 0;
                int solid = 0;
                for (int k = 0; k < kBakeGrid * kBakeGrid; ++k) {
                    const glm::dvec2 inside((k % kBakeGrid + 0.5) / kBakeGrid,
                                            (k / kBakeGrid + 0.5) / kBakeGrid);
                    const glm::dvec2 uv = radiance_.uv(texel, inside);
                    if (proxy_.faces()[face].triangle && uv.x + uv.y > 1.0) continue;
                    const glm::dvec3 point = proxy_.pointOn(face, uv);
                    if (proxy_.insideOpening(face, point)) continue;
                    ++solid;
                    const glm::dvec3 way = point - center;
                    const bool facing = proxy_.faces()[face].two_sided ||
                                        glm::dot(way, proxy_.faces()[face].normal) < 0.0;
                    if (!facing || !proxy_.mutuallyVisible(center, point)) continue;
                    sum += lookUp(probe, glm::normalize(way));
                    ++seen;
                }
                radiance_.setValid(index, solid > 0);
                if (seen == 0) continue;
                radiance_[index] = sum / static_cast<float>(seen);
                probe_saw_[index] = 1;
            }
        });
    }
}

void RoomLight::fillFromPhotograph(const PhotographedRadiance& photograph)
{
    const Camera& camera = photograph.camera;
    parallelFor(0, static_cast<std::int64_t>(radiance_.faceCount()), [&](std::int64_t f) {
        const std::size_t face = static_cast<std::size_t>(f);
        const std::size_t end =
            radiance_.firstOf(face) +
            static_cast<std::size_t>(radiance_.columns(face) * radiance_.rows(face));
        for (std::size_t i = radiance_.firstOf(face); i < end; ++i) {
            if (probe_saw_[i] || !radiance_.valid(i)) continue;
            const glm::dvec3 point =
                proxy_.pointOn(face, radiance_.uv(radiance_.texel(i), glm::dvec2(0.5)));
            const auto pixel = camera.project(point);
            if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x >= camera.width ||
                pixel->y >= camera.height || !proxy_.mutuallyVisible(camera.position_m, point))
                continue;
            radiance_[i] = sampleBilinear(photograph.radiance, pixel->x, pixel->y);
            photo_saw_[i] = 1;
        }
    });
}

void RoomLight::extendBeyondOpenings(const EnvironmentMap& probe, glm::dvec3 center)
{
    const int width = probe.pixels.width();
    const int height = probe.pixels.height();
    outside_ = probe;
    outside_seen_.assign(probe.pixels.pixelCount(), 0);

    // A texel is seen when the ways through its centre and corners all leave the room.
    const auto leaves = [&](double x, double y) {
        const auto hit =
            proxy_.intersect(center, environmentDirectionFromUv({x / width, y / height}));
        return !hit || hit->opening;
    };
    parallelFor(0, height, [&](std::int64_t y) {
        for (int x = 0; x < width; ++x) {
            const double row = static_cast<double>(y);
            const bool seen = leaves(x + 0.5, row + 0.5) && leaves(x, row) && leaves(x + 1, row) &&
                              leaves(x, row + 1) && leaves(x + 1, row + 1);
            outside_seen_[static_cast<std::size_t>(y * width + x)] = seen;
        }
    });

    // Texels on the rim of what is seen are the nearest ones to all that is not.
    struct RimTexel {
        glm::vec3 direction;
        Rgb radiance;
    };
    std::vector<RimTexel> rim;
    const auto seenAt = [&](int x, int y) {
        return outside_seen_[static_cast<std::size_t>(y * width + (x + width) % width)] != 0;
    };
    const auto directionOf = [&](int x, int y) {
        return environmentDirectionFromUv({(x + 0.5) / width, (y + 0.5) / height});
    };
    bool all_seen = true;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            all_seen = all_seen && seenAt(x, y);
            if (!seenAt(x, y)) continue;
            const bool inner = y > 0 && y + 1 < height && seenAt(x - 1, y) && seenAt(x + 1, y) &&
                               seenAt(x, y - 1) && seenAt(x, y + 1);
            if (!inner) rim.push_back({glm::vec3(directionOf(x, y)), probe.pixels(x, y)});
        }
    }
    if (all_seen) return;
    if (rim.empty()) {
        if (!proxy_.openings().empty())
            findings_.push_back({Severity::Warning,
                                 "light-opening-unseen",
                                 "the probe sees nothing through the openings; what lies beyond "
                                 "them is taken from the probe's own directions"});
        return;
    }
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (seenAt(x, y)) continue;
            const glm::vec3 direction(directionOf(x, y));
            const RimTexel* nearest = &rim.front();
            float best = -2.0f;
            for (const RimTexel& texel : rim) {
                const float closeness = glm::dot(direction, texel.direction);
                if (closeness > best) {
                    best = closeness;
                    nearest = &texel;
                }
            }
            outside_.pixels(x, y) = nearest->radiance;
        }
    });
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
        const std::size_t end =
            radiance_.firstOf(face) +
            static_cast<std::size_t>(radiance_.columns(face) * radiance_.rows(face));
        for (std::size_t i = radiance_.firstOf(face); i < end; ++i) {
            if (!radiance_.valid(i)) continue;
            const glm::dvec3 way =
                proxy_.pointOn(face, radiance_.uv(radiance_.texel(i), glm::dvec2(0.5))) - reference;
            const double d2 = std::max(glm::dot(way, way), 0.05);
            const double cosine =
                std::max(std::abs(glm::dot(way, proxy_.faces()[face].normal)) / std::sqrt(d2), 0.1);
            weights[i] = luminance(radiance_[i]) * texelArea(face) * cosine / d2;
            surface_power += weights[i];
        }
    }
    if (surface_power > 0.0) texel_table_.emplace(weights);

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
    if (far_power > 0.0) outside_table_.emplace(far_weights);

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

double RoomLight::outsidePdf(glm::dvec3 direction) const
{
    if (!(outside_share_ > 0.0)) return 0.0;
    const Image<Rgb>& far = outside_.pixels;
    const glm::dvec2 uv = environmentUvFromDirection(direction);
    const int x = std::clamp(static_cast<int>(uv.x * far.width()), 0, far.width() - 1);
    const int y = std::clamp(static_cast<int>(uv.y * far.height()), 0, far.height() - 1);
    return outside_share_ *
           outside_table_->probability(static_cast<std::size_t>(y * far.width() + x)) /
           environmentTexelSolidAngle(far.width(), far.height(), y);
}

RoomLight::Arrival RoomLight::arrive(glm::dvec3 x, glm::dvec3 direction) const
{
    Arrival arrival;
    arrival.hit = proxy_.intersect(x, direction);
    const auto& hit = arrival.hit;
    if (hit && !hit->opening) {
        const double cosine = std::abs(glm::dot(hit->normal, direction));
        arrival.light.radiance = faceRadiance(hit->face, hit->uv);
        arrival.light.distance_m = hit->distance_m;
        arrival.light.pdf = texelPdf(hit->face, hit->uv) * hit->distance_m * hit->distance_m /
                            std::max(cosine, 1e-9);
        return arrival;
    }
    arrival.light.radiance = lookUp(outside_, direction);
    arrival.light.pdf = outsidePdf(direction);
    if (hit) {
        const double cosine = std::abs(glm::dot(hit->normal, direction));
        arrival.light.distance_m = hit->distance_m;
        arrival.light.pdf += portal_share_ / portal_cumulative_area_.back() * hit->distance_m *
                             hit->distance_m / std::max(cosine, 1e-9);
    }
    return arrival;
}

IncidentLight RoomLight::incident(glm::dvec3 x, glm::dvec3 direction) const
{
    return arrive(x, direction).light;
}

std::optional<LightSample> RoomLight::sample(glm::dvec3 x, double selector, glm::vec2 u) const
{
    const auto drawn = draw(x, selector, u);
    if (!drawn) return std::nullopt;
    const IncidentLight& light = drawn->arrival.light;
    return LightSample{drawn->direction, light.distance_m, light.radiance, light.pdf};
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
    const Arrival arrival = arrive(x, way / length);
    const bool sees_surface = arrival.hit && !arrival.hit->opening;
    if (sees_surface != on_surface) return std::nullopt;
    if (on_surface && (arrival.hit->face != wanted_face ||
                       std::abs(arrival.hit->distance_m - length) > 1e-6 * (1.0 + length)))
        return std::nullopt;
    if (!(arrival.light.pdf > 0.0)) return std::nullopt;
    return DrawnArrival{way / length, arrival};
}

glm::dvec3 RoomLight::cellIrradianceAt(glm::dvec3 x,
                                       glm::dvec3 normal,
                                       std::uint64_t cell,
                                       const RoomLightOptions& options) const
{
    // Cosine and light sampling joined by the balance heuristic [Veach97, 9.2].
    glm::dvec3 sum(0.0);
    const glm::dmat3 frame = frameFromNormal(normal);
    for (int s = 0; s < options.rays_per_cell; ++s) {
        RandomStream random(options.seed, cell, static_cast<std::uint64_t>(s));
        const glm::dvec3 direction = frame * cosineHemisphere(random.uniform2());
        const double cosine = glm::dot(direction, normal);
        const IncidentLight seen = incident(x, direction);
        if (cosine > 0.0) sum += glm::dvec3(seen.radiance) * (cosine / (cosine / pi + seen.pdf));
        const double selector = random.uniformDouble();
        const auto drawn = sample(x, selector, random.uniform2());
        if (!drawn) continue;
        const double drawn_cosine = glm::dot(drawn->direction, normal);
        if (drawn_cosine > 0.0)
            sum += glm::dvec3(drawn->radiance) * (drawn_cosine / (drawn_cosine / pi + drawn->pdf));
    }
    return sum / static_cast<double>(options.rays_per_cell);
}

void RoomLight::gatherCells(const RoomLightOptions& options, Progress& progress)
{
    constexpr int kGrid = 4;
    parallelFor(0, static_cast<std::int64_t>(cell_irradiance_.size()), [&](std::int64_t number) {
        const std::size_t cell = static_cast<std::size_t>(number);
        const auto texel = cell_irradiance_.texel(cell);
        const ProxyFace& face = proxy_.faces()[texel.face];
        const glm::dvec2 center = cell_irradiance_.uv(texel, glm::dvec2(0.5));
        const glm::dvec3 x = proxy_.pointOn(texel.face, center);

        Rgb radiance(0.0f);
        int count = 0;
        for (int k = 0; k < kGrid * kGrid; ++k) {
            const glm::dvec2 uv =
                cell_irradiance_.uv(texel, {(k % kGrid + 0.5) / kGrid, (k / kGrid + 0.5) / kGrid});
            if (!radiance_.valid(radiance_.texelAt(texel.face, uv))) continue;
            radiance += faceRadiance(texel.face, uv);
            ++count;
        }
        cell_irradiance_.setValid(cell, count > 0);
        cell_reflectance_.setValid(cell, count > 0);
        if (count == 0) return;
        const Rgb irradiance(cellIrradianceAt(x, face.normal, cell, options));
        cell_irradiance_[cell] = irradiance;
        for (int c = 0; c < 3; ++c)
            cell_reflectance_[cell][c] =
                irradiance[c] > 0.0f ? std::min(static_cast<float>(pi) * radiance[c] /
                                                    (static_cast<float>(count) * irradiance[c]),
                                                kMaxReflectance)
                                     : kUnseenReflectance;
    });
    progress.checkpoint();
}

void RoomLight::fillUnseen()
{
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        // Mean reflectance of what was seen of this face.
        glm::dvec3 reflectance(0.0);
        double seen_count = 0.0;
        const std::size_t end =
            radiance_.firstOf(face) +
            static_cast<std::size_t>(radiance_.columns(face) * radiance_.rows(face));
        const auto seen = [&](std::size_t i) { return probe_saw_[i] || photo_saw_[i]; };
        const auto uvOf = [&](std::size_t i) {
            return radiance_.uv(radiance_.texel(i), glm::dvec2(0.5));
        };
        for (std::size_t i = radiance_.firstOf(face); i < end; ++i) {
            if (!radiance_.valid(i) || !seen(i)) continue;
            reflectance +=
                glm::dvec3(cell_reflectance_.lookUp(face, uvOf(i), Rgb(kUnseenReflectance)));
            seen_count += 1.0;
        }
        const Rgb mean = seen_count > 0.0 ? Rgb(reflectance / seen_count) : Rgb(kUnseenReflectance);
        for (std::size_t i = radiance_.firstOf(face); i < end; ++i)
            if (radiance_.valid(i) && !seen(i))
                radiance_[i] = mean * cell_irradiance_.lookUp(face, uvOf(i), Rgb(0.0f)) /
                               static_cast<float>(pi);
    }
}

void RoomLight::reportCoverage()
{
    double unseen = 0.0;
    double total = 0.0;
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        const std::size_t end =
            radiance_.firstOf(face) +
            static_cast<std::size_t>(radiance_.columns(face) * radiance_.rows(face));
        for (std::size_t i = radiance_.firstOf(face); i < end; ++i) {
            if (!radiance_.valid(i)) continue;
            total += texelArea(face);
            if (!probe_saw_[i] && !photo_saw_[i]) unseen += texelArea(face);
        }
    }
    if (unseen > 0.0)
        findings_.push_back(
            {Severity::Info,
             "light-unseen-surfaces",
             fmt::format(
                 "{:.1f} % of the room's surfaces were seen neither by the probe nor by the "
                 "photograph; their radiance is gathered light times the mean reflectance",
                 100.0 * unseen / total)});

    // The share of the light through openings, at the middle of the room, that nobody saw.
    if (portal_triangles_.empty() || !outside_table_) return;
    double extended = 0.0;
    double through = 0.0;
    const Image<Rgb>& far = outside_.pixels;
    glm::dvec3 middle(0.0);
    for (const ProxyFace& face : proxy_.faces())
        middle += (face.corner + 0.5 * (face.edge_u + face.edge_v)) / double(proxy_.faces().size());
    for (int y = 0; y < far.height(); ++y) {
        const double solid_angle = environmentTexelSolidAngle(far.width(), far.height(), y);
        for (int x = 0; x < far.width(); ++x) {
            const auto hit = proxy_.intersect(
                middle,
                environmentDirectionFromUv({(x + 0.5) / far.width(), (y + 0.5) / far.height()}));
            if (!hit || !hit->opening) continue;
            const double power = luminance(far(x, y)) * solid_angle;
            through += power;
            if (!outside_seen_[static_cast<std::size_t>(y * far.width() + x)]) extended += power;
        }
    }
    if (through > 0.0 && extended > 0.0)
        findings_.push_back(
            {Severity::Info,
             "light-opening-extended",
             fmt::format(
                 "{:.1f} % of the light through the openings (at the middle of the room) is "
                 "taken from the nearest direction that the probe saw through them",
                 100.0 * extended / through)});
}

}  // namespace insitu
