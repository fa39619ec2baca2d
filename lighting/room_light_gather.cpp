#include "core/color.h"
#include "core/parallel.h"
#include "core/random.h"
#include "lighting/light_fit.h"
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
/// Standard deviation of the logarithm of a clipped light's strength at which it is believed.
constexpr double kBelievedLogSigma = 0.3;

}  // namespace

glm::dvec3 RoomLight::cellIrradianceAt(glm::dvec3 x,
                                       glm::dvec3 normal,
                                       std::uint64_t cell,
                                       const RoomLightOptions& options,
                                       BandIrradiance* bands,
                                       Doubt* doubt) const
{
    // Cosine and light sampling joined by the balance heuristic [Veach97, 9.2].
    glm::dvec3 sum(0.0);
    const glm::dmat3 frame = frameFromNormal(normal);
    const auto add = [&](glm::dvec3 direction, const Arrival& arrival) {
        const double cosine = glm::dot(direction, normal);
        if (cosine <= 0.0) return;
        const glm::dvec3 part =
            glm::dvec3(arrival.light.radiance) * (cosine / (cosine / pi + arrival.light.pdf));
        sum += part;
        const double share = 1.0 / options.rays_per_cell;
        if (!arrival.hit || arrival.hit->opening) {
            const std::uint8_t band = outsideBand(direction);
            if (band != kMeasured) (*bands)[band] += part * share;
        } else if (clipped_[radiance_.texelAt(arrival.hit->face, arrival.hit->uv)]) {
            (*bands)[kClippedBand] += part * share;
        } else if (proxy_.faces()[arrival.hit->face].solid) {
            const double weight = cosine / (cosine / pi + arrival.light.pdf) * share;
            const glm::dvec3 change =
                weight * (glm::dvec3(radianceBehind(*arrival.hit, direction)) -
                          glm::dvec3(arrival.light.radiance));
            doubt->lower += glm::min(change, glm::dvec3(0.0));
            doubt->higher += glm::max(change, glm::dvec3(0.0));
        }
    };
    const int strata = static_cast<int>(std::sqrt(options.rays_per_cell));
    for (int s = 0; s < options.rays_per_cell; ++s) {
        RandomStream random(options.seed, cell, static_cast<std::uint64_t>(s));
        glm::vec2 u = random.uniform2();
        if (s < strata * strata)
            u = (u + glm::vec2(s % strata, s / strata)) / static_cast<float>(strata);
        const glm::dvec3 direction = frame * cosineHemisphere(u);
        add(direction, arrive(x, direction));
        const double selector = random.uniformDouble();
        if (const auto drawn = draw(x, selector, random.uniform2()))
            add(drawn->direction, drawn->arrival);
    }
    return sum / static_cast<double>(options.rays_per_cell);
}

void RoomLight::gatherCells(const RoomLightOptions& options, Progress& progress)
{
    constexpr int kGrid = 4;
    cell_bands_.resize(cell_irradiance_.size());
    cell_doubt_.resize(cell_irradiance_.size());
    cell_radiance_.resize(cell_irradiance_.size());
    cell_shines_.resize(cell_irradiance_.size());
    parallelFor(0, static_cast<std::int64_t>(cell_irradiance_.size()), [&](std::int64_t number) {
        const std::size_t cell = static_cast<std::size_t>(number);
        const auto texel = cell_irradiance_.texel(cell);
        const ProxyFace& face = proxy_.faces()[texel.face];
        const glm::dvec2 center = cell_irradiance_.uv(texel, glm::dvec2(0.5));
        const glm::dvec3 x = proxy_.pointOn(texel.face, center);

        Rgb radiance(0.0f);
        int count = 0;
        cell_shines_[cell] = 0;
        for (int k = 0; k < kGrid * kGrid; ++k) {
            const glm::dvec2 uv =
                cell_irradiance_.uv(texel, {(k % kGrid + 0.5) / kGrid, (k / kGrid + 0.5) / kGrid});
            if (!radiance_.valid(radiance_.texelAt(texel.face, uv))) continue;
            radiance += faceRadiance(texel.face, uv);
            ++count;
            if (clipped_[radiance_.texelAt(texel.face, uv)]) cell_shines_[cell] = 1;
        }
        cell_irradiance_.setValid(cell, count > 0);
        cell_reflectance_.setValid(cell, count > 0);
        cell_bands_[cell] = {};
        cell_doubt_[cell] = {};
        if (count == 0) return;
        cell_radiance_[cell] = radiance / static_cast<float>(count);
        const Rgb irradiance(cellIrradianceAt(
            x, face.normal, cell, options, &cell_bands_[cell], &cell_doubt_[cell]));
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

std::vector<LitCell> RoomLight::litCells() const
{
    std::vector<LitCell> cells;
    for (std::size_t i = 0; i < cell_irradiance_.size(); ++i) {
        if (!cell_irradiance_.valid(i)) continue;
        const auto texel = cell_irradiance_.texel(i);
        const std::size_t here = radiance_.texelAt(texel.face, cell_irradiance_.centerUv(i));
        if ((!probe_saw_[here] && !photo_saw_[here]) || cell_shines_[i]) continue;
        LitCell cell;
        cell.face = texel.face;
        cell.area =
            proxy_.area(texel.face) / (static_cast<double>(cell_irradiance_.columns(texel.face)) *
                                       cell_irradiance_.rows(texel.face));
        cell.radiance = glm::dvec3(cell_radiance_[i]);
        cell.guessed = cell_bands_[i];
        cell.known = glm::dvec3(cell_irradiance_[i]);
        for (const glm::dvec3& band : cell.guessed)
            cell.known = glm::max(cell.known - band, glm::dvec3(0.0));
        cells.push_back(cell);
    }
    return cells;
}

void RoomLight::fitUnmeasured(const RoomLightOptions& options, Progress& progress)
{
    if (!options.fit_unmeasured) return;
    const std::vector<LitCell> cells = litCells();
    const LightFit fit = fitLightBands(cells);
    const bool openings = scaleOpenings(fit, cells);
    const bool clipped = scaleClipped(fit, cells);
    if (!openings && !clipped) return;
    buildTables(options.reference_point_m);
    gatherCells(options, progress);
}

bool RoomLight::scaleOpenings(const LightFit& fit, std::span<const LitCell> cells)
{
    double guessed = 0.0;
    double total = 0.0;
    for (const LitCell& cell : cells) {
        glm::dvec3 all = cell.known;
        for (std::size_t band = 0; band < kLightBands; ++band) {
            all += cell.guessed[band];
            if (band != kClippedBand) guessed += cell.area * luminance(Rgb(cell.guessed[band]));
        }
        total += cell.area * luminance(Rgb(all));
    }
    if (!(guessed > 0.01 * total)) return false;
    for (std::size_t i = 0; i < outside_band_.size(); ++i)
        if (outside_band_[i] != kMeasured && outside_band_[i] != kClippedBand)
            outside_.pixels.pixels()[i] *= Rgb(fit.factors[outside_band_[i]]);
    findings_.push_back(
        {Severity::Info,
         "light-opening-fitted",
         fmt::format("the light through the openings from directions the probe did not see was "
                     "scaled by {:.2f} above, {:.2f} below and {:.2f} beside what it saw "
                     "(luminance), so that it explains how bright the surfaces are",
                     luminance(Rgb(fit.factors[kAboveBand])),
                     luminance(Rgb(fit.factors[kBelowBand])),
                     luminance(Rgb(fit.factors[kBesideBand])))});
    return true;
}

bool RoomLight::scaleClipped(const LightFit& fit, std::span<const LitCell> cells)
{
    double bound = 0.0;
    double total = 0.0;
    for (const LitCell& cell : cells) {
        bound += cell.area * luminance(Rgb(cell.guessed[kClippedBand]));
        total += cell.area * luminance(Rgb(cell.known + cell.guessed[kClippedBand]));
    }
    if (!(bound > 0.0)) return false;
    const glm::dvec3 sigma = fit.log_sigma[kClippedBand];
    const glm::dvec3 factor = fit.factors[kClippedBand];
    if (std::max({sigma.r, sigma.g, sigma.b}) > kBelievedLogSigma) {
        findings_.push_back(
            {Severity::Warning,
             "light-clipped-unsolved",
             fmt::format("lights that are clipped in every exposure give at least {:.2g} % of the "
                         "light on the surfaces, perhaps much more, and no patch of their light "
                         "tells: shadows may be too weak; add shorter exposures",
                         100.0 * bound / total)});
        return false;
    }
    for (std::size_t i = 0; i < outside_band_.size(); ++i)
        if (outside_band_[i] == kClippedBand) outside_.pixels.pixels()[i] *= Rgb(factor);
    for (std::size_t i = 0; i < clipped_.size(); ++i)
        if (clipped_[i]) radiance_[i] *= Rgb(factor);
    findings_.push_back(
        {Severity::Info,
         "light-clipped-solved",
         fmt::format(
             "lights that are clipped in every exposure were scaled by {:.3g} (red), {:.3g} "
             "(green), {:.3g} (blue), each within about {:.0f} %, so that they explain how "
             "bright the surfaces are that they light",
             factor.r,
             factor.g,
             factor.b,
             100.0 * std::max({sigma.r, sigma.g, sigma.b}))});
    return true;
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
