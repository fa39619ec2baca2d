#include "core/color.h"
#include "core/parallel.h"
#include "core/random.h"
#include "lighting/room_light.h"
#include "lighting/sampling.h"
#include "lighting/see_through.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

using std::numbers::pi;

namespace {

/// No Lambert surface reflects more; what is brighter shines by itself.
constexpr float kMaxReflectance = 0.95f;
/// [GibCha03] section 4.2: for surfaces that no picture saw.
constexpr float kUnseenReflectance = 0.5f;
/// Share of a cell's irradiance that may be in doubt before the cell says little of its face.
constexpr double kLittleDoubt = 0.1;
constexpr std::size_t kMinFaceCells = 20;
/// Sets the random numbers of clipped lights apart from those of the others.
constexpr std::uint64_t kClippedStream = 0x9e3779b97f4a7c15;

}  // namespace

void RoomLight::listClipped()
{
    clipped_sources_.clear();
    double sum = 0.0;
    const auto add = [&](std::size_t texel, bool far, Rgb light, double size) {
        const double power = static_cast<double>(luminance(light)) * size;
        if (!(power > 0.0)) return;
        sum += power;
        clipped_sources_.push_back({texel, far, sum});
    };
    for (std::size_t face = 0; face < clipped_.faceCount(); ++face)
        for (const std::size_t i : clipped_.texelsOf(face))
            if (clipped_.valid(i)) add(i, false, clipped_[i], texelArea(face));
    const Image<Rgb>& far = outside_.clipped;
    for (std::size_t i = 0; i < far.pixelCount(); ++i)
        add(i,
            true,
            far.pixels()[i],
            environmentTexelSolidAngle(
                far.width(), far.height(), static_cast<int>(i) / far.width()));
}

glm::dvec3 RoomLight::clippedIrradianceAt(glm::dvec3 x,
                                          glm::dvec3 normal,
                                          double selector,
                                          glm::vec2 u) const
{
    const double total = clipped_sources_.back().cumulative;
    const auto chosen = std::ranges::lower_bound(clipped_sources_.begin(),
                                                 clipped_sources_.end() - 1,
                                                 selector * total,
                                                 {},
                                                 &ClippedSource::cumulative);
    const double below = chosen == clipped_sources_.begin() ? 0.0 : (chosen - 1)->cumulative;
    const double probability = (chosen->cumulative - below) / total;
    if (chosen->far) {
        const Image<Rgb>& far = outside_.clipped;
        const glm::dvec3 direction = directionInTexel(far.width(), far.height(), chosen->texel, u);
        const double cosine = glm::dot(direction, normal);
        if (cosine <= 0.0) return glm::dvec3(0.0);
        const auto hit = intersect(x, direction);
        if (hit && !hit->opening) return glm::dvec3(0.0);
        const int row = static_cast<int>(chosen->texel) / far.width();
        const double size = environmentTexelSolidAngle(far.width(), far.height(), row);
        return glm::dvec3(far.pixels()[chosen->texel]) * (cosine * size / probability);
    }
    const auto texel = clipped_.texel(chosen->texel);
    const glm::dvec3 way = proxy_.pointOn(texel.face, clipped_.uv(texel, glm::dvec2(u))) - x;
    const double distance = glm::length(way);
    if (!(distance > 1e-9)) return glm::dvec3(0.0);
    const glm::dvec3 direction = way / distance;
    const double cosine = glm::dot(direction, normal);
    if (cosine <= 0.0) return glm::dvec3(0.0);
    const auto hit = intersect(x, direction);
    if (!hit || hit->face != texel.face ||
        std::abs(hit->distance_m - distance) > 1e-6 * (1.0 + distance))
        return glm::dvec3(0.0);
    const double there = std::abs(glm::dot(direction, hit->normal));
    return glm::dvec3(clipped_[chosen->texel]) *
           (cosine * there * texelArea(texel.face) / (distance * distance * probability));
}

glm::dvec3 RoomLight::irradianceOver(std::span<const glm::dvec3> places,
                                     glm::dvec3 normal,
                                     std::uint64_t cell,
                                     const RoomLightOptions& options,
                                     BandIrradiance* bands,
                                     Doubt* doubt) const
{
    // What was measured or guessed: cosine and light sampling joined by the balance heuristic
    // [Veach97, 9.2].
    glm::dvec3 sum(0.0);
    const glm::dmat3 frame = frameFromNormal(normal);
    const auto add = [&](const DrawnArrival& drawn) {
        const auto& [direction, arrival, density] = drawn;
        const double cosine = glm::dot(direction, normal);
        if (cosine <= 0.0) return;
        const double weight = cosine / (cosine / pi + density) / options.rays_per_cell;
        const Rgb clipped = clippedOf(arrival, direction);
        const glm::dvec3 radiance = glm::dvec3(arrival.radiance) - glm::dvec3(clipped);
        sum += radiance * weight;
        if (!arrival.hit || arrival.hit->opening) {
            const std::uint8_t band = outsideBand(direction);
            if (band != kMeasured) (*bands)[band] += radiance * weight;
        } else if (proxy_.faces()[arrival.hit->face].solid && clipped == Rgb(0.0f)) {
            const glm::dvec3 change =
                weight * (glm::dvec3(radianceBehind(*arrival.hit, direction)) - radiance);
            doubt->lower += glm::min(change, glm::dvec3(0.0));
            doubt->higher += glm::max(change, glm::dvec3(0.0));
        }
    };
    const int strata = static_cast<int>(std::sqrt(options.rays_per_cell));
    for (int s = 0; s < options.rays_per_cell; ++s) {
        RandomStream random(options.seed, cell, static_cast<std::uint64_t>(s));
        const glm::dvec3 x = places[static_cast<std::size_t>(s) % places.size()];
        glm::vec2 u = random.uniform2();
        if (s < strata * strata)
            u = (u + glm::vec2(s % strata, s / strata)) / static_cast<float>(strata);
        const glm::dvec3 direction = frame * cosineHemisphere(u);
        add(arriveWithPdf(x, direction));
        const double selector = random.uniformDouble();
        if (const auto drawn = draw(x, selector, random.uniform2())) add(*drawn);
    }
    // What is clipped by itself, systematically: it may become a thousand times as strong, and so
    // would its noise.
    const int count = clipped_sources_.empty() ? 0 : std::max(1, options.rays_per_cell / 2);
    for (int s = 0; s < count; ++s) {
        RandomStream random(options.seed ^ kClippedStream, cell, static_cast<std::uint64_t>(s));
        // 5 is coprime to the number of places of a whole cell.
        const glm::dvec3 x = places[static_cast<std::size_t>(s) * 5 % places.size()];
        const double selector = (s + random.uniformDouble()) / count;
        const glm::dvec3 part = clippedIrradianceAt(x, normal, selector, random.uniform2()) /
                                static_cast<double>(count);
        sum += part;
        (*bands)[kClippedBand] += part;
    }
    return sum;
}

void RoomLight::gatherCells(const RoomLightOptions& options, Progress& progress)
{
    constexpr int kGrid = 4;
    cell_bands_.resize(cell_irradiance_.size());
    cell_doubt_.resize(cell_irradiance_.size());
    cell_radiance_.resize(cell_irradiance_.size());
    cell_shines_.resize(cell_irradiance_.size());
    listClipped();
    parallelFor(0, static_cast<std::int64_t>(cell_irradiance_.size()), [&](std::int64_t number) {
        const std::size_t cell = static_cast<std::size_t>(number);
        const auto texel = cell_irradiance_.texel(cell);
        const ProxyFace& face = proxy_.faces()[texel.face];

        // Radiance and irradiance of the same places: of those that were seen, if any.
        std::vector<glm::dvec2> seen;
        std::vector<glm::dvec2> unseen;
        for (int k = 0; k < kGrid * kGrid; ++k) {
            const glm::dvec2 uv =
                cell_irradiance_.uv(texel, {(k % kGrid + 0.5) / kGrid, (k / kGrid + 0.5) / kGrid});
            const std::size_t at = radiance_.texelAt(texel.face, uv);
            if (radiance_.valid(at))
                (probe_saw_[at] || photo_saw_[at] ? seen : unseen).push_back(uv);
        }
        const std::vector<glm::dvec2>& used = seen.empty() ? unseen : seen;
        cell_irradiance_.setValid(cell, !used.empty());
        cell_reflectance_.setValid(cell, !used.empty());
        cell_bands_[cell] = {};
        cell_doubt_[cell] = {};
        cell_shines_[cell] = 0;
        if (used.empty()) return;
        Rgb radiance(0.0f);
        std::vector<glm::dvec3> places;
        for (const glm::dvec2& uv : used) {
            radiance += faceRadiance(texel.face, uv) / static_cast<float>(used.size());
            places.push_back(proxy_.pointOn(texel.face, uv));
            if (clipped_.lookUp(texel.face, uv, Rgb(0.0f)) != Rgb(0.0f)) cell_shines_[cell] = 1;
        }
        cell_radiance_[cell] = radiance;
        const Rgb irradiance(irradianceOver(
            places, face.normal, cell, options, &cell_bands_[cell], &cell_doubt_[cell]));
        cell_irradiance_[cell] = irradiance;
        for (int c = 0; c < 3; ++c)
            cell_reflectance_[cell][c] =
                irradiance[c] > 0.0f
                    ? std::min(static_cast<float>(pi) * radiance[c] / irradiance[c],
                               kMaxReflectance)
                    : kUnseenReflectance;
    });
    progress.checkpoint();
}

Rgb RoomLight::radianceBehind(const ProxyHit& solid, glm::dvec3 direction) const
{
    const auto hit = intersectBehindBoxes(proxy_, solid.point, direction);
    return hit && !hit->opening ? faceRadiance(hit->face, hit->uv) : lookUp(outside_, direction);
}

Rgb RoomLight::irradianceScale(std::size_t face, glm::dvec2 uv) const
{
    return irradiance_scale_.lookUp(face, uv, Rgb(1.0f));
}

void RoomLight::scaleDoubtfulIrradiance()
{
    irradiance_scale_ = cell_irradiance_;
    for (std::size_t i = 0; i < irradiance_scale_.size(); ++i)
        irradiance_scale_[i] = Rgb(1.0f);
    for (std::size_t face = 0; face < cell_irradiance_.faceCount(); ++face) {
        const auto cells = cell_irradiance_.texelsOf(face);
        if (proxy_.faces()[face].solid || cells.size() < kMinFaceCells) continue;
        for (int c = 0; c < 3; ++c) {
            // The face's reflectance, from the cells that no box makes doubtful.
            const auto usable = [&](std::size_t i) {
                return cell_irradiance_.valid(i) && cell_irradiance_[i][c] > 0.0f &&
                       cell_radiance_[i][c] > 0.0f;
            };
            double weights = 0.0;
            double log_reflectance = 0.0;
            for (const std::size_t i : cells) {
                if (!usable(i)) continue;
                const double doubt = (cell_doubt_[i].higher[c] - cell_doubt_[i].lower[c]) /
                                     (kLittleDoubt * cell_irradiance_[i][c]);
                const double weight = 1.0 / (1.0 + doubt * doubt);
                weights += weight;
                log_reflectance +=
                    weight * std::log(pi * cell_radiance_[i][c] / cell_irradiance_[i][c]);
            }
            if (weights < 0.2 * static_cast<double>(cells.size())) continue;
            const double reflectance = std::exp(log_reflectance / weights);
            for (const std::size_t i : cells) {
                if (!usable(i)) continue;
                const double irradiance = cell_irradiance_[i][c];
                const double wanted = pi * cell_radiance_[i][c] / reflectance;
                const double found = std::clamp(wanted,
                                                std::max(0.0, irradiance + cell_doubt_[i].lower[c]),
                                                irradiance + cell_doubt_[i].higher[c]);
                irradiance_scale_[i][c] = static_cast<float>(found / irradiance);
                cell_reflectance_[i][c] =
                    std::min(static_cast<float>(pi * cell_radiance_[i][c] / std::max(found, 1e-30)),
                             kMaxReflectance);
            }
        }
    }
}

void RoomLight::fillUnseen()
{
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        // Mean reflectance of what was seen of this face.
        glm::dvec3 reflectance(0.0);
        double seen_count = 0.0;
        const auto seen = [&](std::size_t i) { return probe_saw_[i] || photo_saw_[i]; };
        for (const std::size_t i : radiance_.texelsOf(face)) {
            if (!radiance_.valid(i) || !seen(i)) continue;
            reflectance += glm::dvec3(
                cell_reflectance_.lookUp(face, radiance_.centerUv(i), Rgb(kUnseenReflectance)));
            seen_count += 1.0;
        }
        const Rgb mean = seen_count > 0.0 ? Rgb(reflectance / seen_count) : Rgb(kUnseenReflectance);
        for (const std::size_t i : radiance_.texelsOf(face))
            if (radiance_.valid(i) && !seen(i))
                radiance_[i] = mean *
                               cell_irradiance_.lookUp(face, radiance_.centerUv(i), Rgb(0.0f)) /
                               static_cast<float>(pi);
    }
}

void RoomLight::reportCoverage(glm::dvec3 reference)
{
    double unseen = 0.0;
    double total = 0.0;
    for (std::size_t face = 0; face < radiance_.faceCount(); ++face) {
        for (const std::size_t i : radiance_.texelsOf(face)) {
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

    // The share of the light through openings, where the objects stand, that nobody saw.
    if (portal_triangles_.empty() || !outside_table_) return;
    double extended = 0.0;
    double through = 0.0;
    const Image<Rgb>& far = outside_.pixels;
    for (int y = 0; y < far.height(); ++y) {
        const double solid_angle = environmentTexelSolidAngle(far.width(), far.height(), y);
        for (int x = 0; x < far.width(); ++x) {
            const auto hit = proxy_.intersect(
                reference,
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
             fmt::format("{:.1f} % of the light through the openings (at the objects) is "
                         "taken from the nearest direction that the probe saw through them",
                         100.0 * extended / through)});
}

}  // namespace insitu
