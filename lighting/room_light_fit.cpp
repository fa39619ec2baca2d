#include "core/color.h"
#include "lighting/light_fit.h"
#include "lighting/room_light.h"

#include <algorithm>

namespace insitu {

namespace {

/// Standard deviation of the logarithm of a clipped light's strength at which it is believed.
constexpr double kBelievedLogSigma = 0.3;
/// What a patch of light says of a source's strength is off by about this, as a logarithm, whatever
/// its own scatter: in truth-room-c 8 to 45 % (docs/validation.md).
constexpr double kPatchLogSigma = 0.3;
/// Rays for the irradiance at a reference: within half a per cent.
constexpr int kReferenceRays = 16384;
constexpr double kInFrontM = 1e-3;

bool believed(const LightFit& fit)
{
    const glm::dvec3 sigma = fit.log_sigma[kClippedBand];
    return std::max({sigma.r, sigma.g, sigma.b}) <= kBelievedLogSigma;
}

}  // namespace

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
    const bool clipped = solveByReferences(options, fit, openings) || scaleClipped(fit, cells);
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
        if (outside_band_[i] != kMeasured)
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
    if (!believed(fit)) {
        findings_.push_back(
            {Severity::Warning,
             "light-clipped-unsolved",
             fmt::format("lights that are clipped in every exposure give at least {:.2g} % of the "
                         "light on the surfaces, perhaps much more, and no patch of their light "
                         "tells: shadows may be too weak; add shorter exposures",
                         100.0 * bound / total)});
        return false;
    }
    scaleClippedBy(factor);
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

void RoomLight::scaleClippedBy(glm::dvec3 factor)
{
    insitu::scaleClipped(outside_, factor);
    for (std::size_t i = 0; i < clipped_.size(); ++i) {
        radiance_[i] += (Rgb(factor) - 1.0f) * clipped_[i];
        clipped_[i] *= Rgb(factor);
    }
}

std::vector<PredictedIrradiance> RoomLight::predictReferences(const RoomLightOptions& options,
                                                              const LightFit& fit,
                                                              bool openings) const
{
    RoomLightOptions fine = options;
    fine.rays_per_cell = kReferenceRays;
    std::vector<PredictedIrradiance> predicted;
    for (const ReferenceGroup& group : options.references)
        for (const LightReference& place : group.places) {
            // A card that lies on a surface is in front of it.
            const glm::dvec3 x = place.position_m + kInFrontM * place.normal;
            BandIrradiance bands{};
            Doubt doubt;
            glm::dvec3 all = irradianceOver(std::span(&x, 1),
                                            place.normal,
                                            cell_irradiance_.size() + predicted.size(),
                                            fine,
                                            &bands,
                                            &doubt);
            for (std::size_t band = 0; openings && band < kLightBands; ++band)
                if (band != kClippedBand) all += (fit.factors[band] - 1.0) * bands[band];
            predicted.push_back(
                {glm::max(all - bands[kClippedBand], glm::dvec3(0.0)), bands[kClippedBand]});
        }
    return predicted;
}

bool RoomLight::solveByReferences(const RoomLightOptions& options,
                                  const LightFit& fit,
                                  bool openings)
{
    if (options.references.empty()) return false;
    if (clipped_sources_.empty()) {
        append(findings_,
               checkReferences(options.references, predictReferences(options, fit, openings)));
        return false;
    }
    const std::vector<PredictedIrradiance> predicted = predictReferences(options, fit, openings);
    ClippedPrior prior;
    if (believed(fit)) {
        prior.factor = fit.factors[kClippedBand];
        const glm::dvec3 sigma = fit.log_sigma[kClippedBand];
        prior.log_sigma = glm::sqrt(sigma * sigma + kPatchLogSigma * kPatchLogSigma);
    }
    const auto solution = solveClipped(options.references, predicted, prior);
    if (!solution) return false;
    scaleClippedBy(solution->factor);
    append(findings_, referenceFindings(options.references, predicted, *solution));
    return true;
}

}  // namespace insitu
