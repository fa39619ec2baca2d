#include "lighting/light_reference.h"

#include "core/check.h"
#include "core/color.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

const double kHighestLog = std::log(1e6);
/// Steps of the search in log s: fine against the 1 that a change of slope takes.
constexpr int kGridSteps = 600;
/// Known worse than this, the references say nothing.
constexpr double kUselessLogSigma = 0.5;
/// Root mean square residual, or excess, in standard deviations, that is told.
constexpr double kDisagreement = 3.0;

/// One measurement in one channel (or in luminance).
struct Term {
    double log_irradiance = 0.0;
    double measured = 0.0;
    double clipped = 0.0;
    double weight = 0.0;
};
struct TermGroup {
    std::vector<Term> terms;
    double scale_weight = 0.0;  ///< 1 / σ_g²; 0: its factor is free
};

/// Σ of squared residuals in standard deviations with the groups' factors at their best, and the
/// information about log s.
struct Cost {
    double squares = 0.0;
    double information = 0.0;
};

Cost costAt(const std::vector<TermGroup>& groups, double log_s)
{
    const double s = std::exp(log_s);
    Cost cost;
    for (const TermGroup& group : groups) {
        double weights = group.scale_weight;
        double mean = 0.0;
        double mean_slope = 0.0;
        double squares = 0.0;
        double slopes = 0.0;
        for (const Term& term : group.terms) {
            const double all = term.measured + s * term.clipped;
            const double residual = term.log_irradiance - std::log(all);
            const double slope = s * term.clipped / all;
            weights += term.weight;
            mean += term.weight * residual;
            mean_slope += term.weight * slope;
            squares += term.weight * residual * residual;
            slopes += term.weight * slope * slope;
        }
        cost.squares += squares - mean * mean / weights;
        cost.information += slopes - mean_slope * mean_slope / weights;
    }
    return cost;
}

struct Minimum {
    double log_s = 0.0;
    double information = 0.0;
    double squares = 0.0;  ///< of the references alone
};

Minimum minimise(const std::vector<TermGroup>& groups, double log_s0, double prior_weight)
{
    const auto total = [&](double log_s) {
        const double off = log_s - log_s0;
        return costAt(groups, log_s).squares + prior_weight * off * off;
    };
    double best = 0.0;
    for (int i = 1; i <= kGridSteps; ++i) {
        const double log_s = kHighestLog * i / kGridSteps;
        if (total(log_s) < total(best)) best = log_s;
    }
    // Golden section in the cells around.
    const double step = kHighestLog / kGridSteps;
    double low = std::max(0.0, best - step);
    double high = std::min(kHighestLog, best + step);
    const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
    for (int i = 0; i < 60; ++i) {
        const double a = high - golden * (high - low);
        const double b = low + golden * (high - low);
        if (total(a) < total(b))
            high = b;
        else
            low = a;
    }
    Minimum minimum;
    minimum.log_s = 0.5 * (low + high);
    const Cost cost = costAt(groups, minimum.log_s);
    minimum.information = cost.information + prior_weight;
    minimum.squares = cost.squares;
    return minimum;
}

double luminanceOf(glm::dvec3 color)
{
    return luminance(Rgb(color));
}

/// The terms of channel c, or of luminance (c = 3) with the clipped part times `factor`.
std::vector<TermGroup> termsOf(std::span<const ReferenceGroup> groups,
                               std::span<const PredictedIrradiance> predicted,
                               int c,
                               glm::dvec3 factor)
{
    std::vector<TermGroup> all;
    std::size_t at = 0;
    for (const ReferenceGroup& group : groups) {
        TermGroup terms;
        if (!group.scale_free)
            terms.scale_weight = group.common_log_sigma > 0.0
                                     ? 1.0 / (group.common_log_sigma * group.common_log_sigma)
                                     : 1e12;
        for (const LightReference& place : group.places) {
            const PredictedIrradiance& known = predicted[at++];
            if (c < 3 && group.luminance_only) continue;
            Term term;
            const double irradiance = c < 3 ? place.irradiance[c] : luminanceOf(place.irradiance);
            term.measured = c < 3 ? known.measured[c] : luminanceOf(known.measured);
            term.clipped = c < 3 ? known.clipped[c] : luminanceOf(known.clipped * factor);
            // A channel without light says nothing.
            if (!(irradiance > 0.0) || !(term.measured + term.clipped > 0.0)) continue;
            term.log_irradiance = std::log(irradiance);
            term.weight = 1.0 / (place.log_sigma * place.log_sigma);
            terms.terms.push_back(term);
        }
        if (!terms.terms.empty()) all.push_back(std::move(terms));
    }
    return all;
}

/// By how much a reference with a known scale says less than was measured without what is clipped.
double excessOf(const std::vector<TermGroup>& groups)
{
    double excess = 0.0;
    for (const TermGroup& group : groups) {
        if (group.scale_weight == 0.0) continue;
        for (const Term& term : group.terms) {
            if (!(term.measured > 0.0)) continue;
            const double less = std::log(term.measured + term.clipped) - term.log_irradiance;
            const double sigma = std::sqrt(1.0 / term.weight + 1.0 / group.scale_weight);
            if (less > kDisagreement * sigma) excess = std::max(excess, less);
        }
    }
    return excess;
}

std::size_t countTerms(const std::vector<TermGroup>& groups)
{
    std::size_t count = 0;
    for (const TermGroup& group : groups)
        count += group.terms.size();
    return count;
}

std::string namesOf(std::span<const ReferenceGroup> groups)
{
    std::string names;
    for (std::size_t i = 0; i < groups.size(); ++i)
        names += (i == 0 ? "" : i + 1 == groups.size() ? " and " : ", ") + groups[i].name;
    return names;
}

double worst(glm::dvec3 v)
{
    return std::max({v.x, v.y, v.z});
}

}  // namespace

std::optional<ClippedSolution> solveClipped(std::span<const ReferenceGroup> groups,
                                            std::span<const PredictedIrradiance> predicted,
                                            const ClippedPrior& prior)
{
    std::size_t places = 0;
    for (const ReferenceGroup& group : groups)
        places += group.places.size();
    INSITU_CHECK(places == predicted.size(), "{} and {}", places, predicted.size());
    const bool by_luminance =
        std::ranges::all_of(groups, [](const ReferenceGroup& g) { return g.luminance_only; });

    // In luminance the factor sought is one on the prior's colour.
    const double least = std::min({prior.factor.x, prior.factor.y, prior.factor.z});
    const glm::dvec3 color = prior.factor / least;
    ClippedSolution solution;
    double squares = 0.0;
    std::size_t count = 0;
    bool told = false;
    for (int c = 0; c < (by_luminance ? 1 : 3); ++c) {
        const std::vector<TermGroup> terms =
            termsOf(groups, predicted, by_luminance ? 3 : c, color);
        double prior_weight = 0.0;
        if (prior.log_sigma) {
            const double sigma = by_luminance ? worst(*prior.log_sigma) : (*prior.log_sigma)[c];
            prior_weight = 1.0 / (sigma * sigma);
        }
        const Minimum found =
            minimise(terms, std::log(by_luminance ? least : prior.factor[c]), prior_weight);
        const double own = found.information - prior_weight;
        const bool tells = own * kUselessLogSigma * kUselessLogSigma >= 1.0;
        squares += found.squares;
        count += countTerms(terms);
        solution.excess = std::max(solution.excess, excessOf(terms));
        told = told || tells;
        if (by_luminance && tells) {
            solution.factor = color * std::exp(found.log_s);
            solution.log_sigma = glm::dvec3(1.0 / std::sqrt(found.information));
        } else if (tells) {
            solution.factor[c] = std::exp(found.log_s);
            solution.log_sigma[c] = 1.0 / std::sqrt(found.information);
        } else {
            solution.open[c] = std::ranges::any_of(
                predicted, [&](const PredictedIrradiance& p) { return p.clipped[c] > 0.0; });
        }
    }
    if (!told) return std::nullopt;
    solution.residual = std::sqrt(squares / std::max<double>(1.0, static_cast<double>(count)));
    return solution;
}

std::vector<PredictedIrradiance> predictIrradiance(std::span<const ReferenceGroup> groups,
                                                   const EnvironmentMap& environment)
{
    const EnvironmentMap bound{environment.clipped};
    std::vector<PredictedIrradiance> predicted;
    for (const ReferenceGroup& group : groups)
        for (const LightReference& place : group.places) {
            PredictedIrradiance here;
            if (!bound.pixels.empty()) here.clipped = irradiance(bound, place.normal);
            here.measured = glm::max(irradiance(environment, place.normal) - here.clipped, 0.0);
            predicted.push_back(here);
        }
    return predicted;
}

void scaleClipped(EnvironmentMap& environment, glm::dvec3 factor)
{
    for (std::size_t i = 0; i < environment.clipped.pixelCount(); ++i) {
        Rgb& clipped = environment.clipped.pixels()[i];
        environment.pixels.pixels()[i] += (Rgb(factor) - 1.0f) * clipped;
        clipped *= Rgb(factor);
    }
}

ReferenceEffect referenceEffect(std::span<const PredictedIrradiance> predicted,
                                const ClippedSolution& solution)
{
    ReferenceEffect effect;
    double most = -1.0;
    for (const PredictedIrradiance& place : predicted) {
        const double clipped = luminanceOf(place.clipped);
        if (clipped <= most) continue;
        most = clipped;
        const double solved = luminanceOf(place.clipped * solution.factor);
        effect.before = luminanceOf(place.measured) + clipped;
        effect.after = luminanceOf(place.measured) + solved;
        effect.sigma =
            effect.after > 0.0
                ? luminanceOf(place.clipped * solution.factor * solution.log_sigma) / effect.after
                : 0.0;
    }
    return effect;
}

Findings referenceFindings(std::span<const ReferenceGroup> groups,
                           std::span<const PredictedIrradiance> predicted,
                           const ClippedSolution& solution)
{
    const ReferenceEffect effect = referenceEffect(predicted, solution);
    Findings findings;
    findings.push_back(
        {Severity::Info,
         "light-clipped-solved",
         fmt::format("lights that are clipped in every exposure were scaled by {:.3g} (red), "
                     "{:.3g} (green), {:.3g} (blue), each within {:.1f} %, by {}: where it was "
                     "measured the irradiance is {:.4g} within {:.1f} %, at least {:.4g} without",
                     solution.factor.r,
                     solution.factor.g,
                     solution.factor.b,
                     100.0 * worst(solution.log_sigma),
                     namesOf(groups),
                     effect.after,
                     100.0 * effect.sigma,
                     effect.before)});
    static constexpr std::array<const char*, 3> kChannels = {"red", "green", "blue"};
    for (std::size_t c = 0; c < 3; ++c)
        if (solution.open[static_cast<int>(c)])
            findings.push_back({Severity::Warning,
                                "light-clipped-unsolved",
                                fmt::format("{} says nothing about the {} of lights that are "
                                            "clipped in every exposure: it keeps its bound",
                                            namesOf(groups),
                                            kChannels[c])});
    if (solution.excess > 0.0)
        findings.push_back(
            {Severity::Warning,
             "light-reference-disagrees",
             fmt::format("{} shows {:.0f} % less light than the probe saw at least: check "
                         "its reflectance, its place, what it faces and whether its light was the "
                         "probe's",
                         namesOf(groups),
                         -100.0 * std::expm1(-solution.excess))});
    else if (solution.residual > kDisagreement)
        findings.push_back(
            {Severity::Warning,
             "light-reference-disagrees",
             fmt::format("what {} tells of the clipped lights differs by {:.1f} times its stated "
                         "deviation: check reflectances, places and what they face, and that the "
                         "light did not change",
                         namesOf(groups),
                         solution.residual)});
    return findings;
}

Findings checkReferences(std::span<const ReferenceGroup> groups,
                         std::span<const PredictedIrradiance> predicted)
{
    const std::vector<TermGroup> terms = termsOf(groups, predicted, 3, glm::dvec3(1.0));
    const double residual = std::sqrt(
        costAt(terms, 0.0).squares / std::max<double>(1.0, static_cast<double>(countTerms(terms))));
    const bool disagrees = residual > kDisagreement;
    return {{disagrees ? Severity::Warning : Severity::Info,
             disagrees ? "light-reference-disagrees" : "light-reference-unneeded",
             fmt::format("no light is clipped in every exposure: nothing is solved; {} differs "
                         "from the probe by {:.1f} times the stated deviation",
                         namesOf(groups),
                         residual)}};
}

Findings applyReferences(std::span<const ReferenceGroup> groups, EnvironmentMap& environment)
{
    const bool clipped = std::ranges::any_of(environment.clipped.pixels(),
                                             [](const Rgb& part) { return part != Rgb(0.0f); });
    const std::vector<PredictedIrradiance> predicted = predictIrradiance(groups, environment);
    if (!clipped) return groups.empty() ? Findings{} : checkReferences(groups, predicted);
    if (!groups.empty()) {
        if (const auto solution = solveClipped(groups, predicted)) {
            scaleClipped(environment, solution->factor);
            return referenceFindings(groups, predicted, *solution);
        }
    }
    // The bound, on a surface that faces what is clipped.
    const EnvironmentMap bound{environment.clipped};
    glm::dvec3 towards(0.0);
    for (int y = 0; y < bound.pixels.height(); ++y)
        for (int x = 0; x < bound.pixels.width(); ++x)
            towards += static_cast<double>(luminance(bound.pixels(x, y))) *
                       environmentTexelSolidAngle(bound.pixels.width(), bound.pixels.height(), y) *
                       environmentDirectionFromUv(
                           {(x + 0.5) / bound.pixels.width(), (y + 0.5) / bound.pixels.height()});
    const double length = glm::length(towards);
    const glm::dvec3 normal = length > 0.0 ? towards / length : glm::dvec3(0.0, 1.0, 0.0);
    const double least = luminanceOf(irradiance(bound, normal));
    const double all = luminanceOf(irradiance(environment, normal));
    return {{Severity::Warning,
             "light-clipped-unsolved",
             fmt::format(
                 "lights that are clipped in every exposure give at least {:.2g} % of the "
                 "light on a surface that faces them, perhaps much more: shadows may be "
                 "too weak; {}",
                 all > 0.0 ? 100.0 * least / all : 0.0,
                 groups.empty()
                     ? std::string("add shorter exposures, or a grey card, a grey ball or "
                                   "readings of a light meter as references")
                     : namesOf(groups) + " does not tell, as it gets too little of their light")}};
}

}  // namespace insitu
