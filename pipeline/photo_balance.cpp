#include "pipeline/photo_balance.h"

#include "core/color.h"
#include "core/quantile.h"
#include "pipeline/common_surfaces.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

namespace insitu {

namespace {

constexpr std::size_t kMinPixels = 100;
/// Darker than this share of the clipping limit noise and black level matter.
constexpr double kDark = 0.02;
/// Colour is off when it differs by more than this, as a logarithm: rooms with equal balance show
/// up to 3 % (docs/validation.md).
constexpr double kColorOff = 0.05;
constexpr double kColorSigmas = 3.0;
/// A channel whose ratios scatter more than this tells nothing: it is black, or the room is wrong.
constexpr double kUselessSpread = 0.4;
const double kExposureOff = std::log(1.25);

/// Logarithms of photograph / probe: red, green, blue, luminance.
using Ratios = std::array<std::vector<double>, 4>;

void addRatios(const Rgb& taken, const Rgb& seen, Ratios& ratios)
{
    for (int c = 0; c < 3; ++c)
        if (taken[c] > 0.0f && seen[c] > 0.0f)
            ratios[static_cast<std::size_t>(c)].push_back(
                std::log(static_cast<double>(taken[c]) / static_cast<double>(seen[c])));
    ratios[3].push_back(std::log(static_cast<double>(luminance(taken)) / luminance(seen)));
}

/// How far the faces' colours scatter about the whole's, weighted by how much is seen of each.
double colorSigma(std::map<std::size_t, Ratios>& faces, std::size_t c, double whole)
{
    double total = 0.0;
    double squares = 0.0;
    for (auto& [face, ratios] : faces) {
        if (ratios[c].size() < kMinPixels / 4 || ratios[1].size() < kMinPixels / 4) continue;
        const double weight = static_cast<double>(ratios[c].size());
        const double off = quantile(ratios[c], 0.5) - quantile(ratios[1], 0.5) - whole;
        total += weight;
        squares += weight * weight * off * off;
    }
    return total > 0.0 ? std::sqrt(squares) / total : 0.0;
}

struct ColorJudgement {
    bool off = false;
    bool doubtful = false;  ///< off, but the surfaces disagree by as much
};

ColorJudgement judgeColor(const PhotoBalance& balance)
{
    ColorJudgement judgement;
    for (int c = 0; c < 3; ++c) {
        if (std::max(balance.spread[c], balance.spread.g) >= kUselessSpread) continue;
        const double log_color = std::abs(std::log(balance.measured[c] / balance.measured.g));
        if (log_color <= kColorOff) continue;
        if (log_color > kColorSigmas * balance.color_sigma[c])
            judgement.off = true;
        else
            judgement.doubtful = true;
    }
    return judgement;
}

std::string gainsText(glm::dvec3 gains)
{
    return fmt::format("{:.3f} (red), {:.3f} (green), {:.3f} (blue)", gains.r, gains.g, gains.b);
}

}  // namespace

PhotoBalance measurePhotoBalance(const Image<Rgb>& radiance,
                                 glm::dvec3 clip,
                                 const Camera& camera,
                                 const SceneProxy& proxy,
                                 const EnvironmentMap& probe,
                                 glm::dvec3 probe_center_m)
{
    Ratios all;
    std::map<std::size_t, Ratios> faces;
    for (const CommonPixel& common : commonPixels(camera, proxy, probe, probe_center_m)) {
        const Rgb taken = radiance(common.pixel.x, common.pixel.y);
        const glm::dvec3 share = glm::dvec3(taken) / clip;
        const double brightest = std::max({share.r, share.g, share.b});
        if (!(brightest < 0.95 && brightest > kDark)) continue;
        addRatios(taken, common.seen, all);
        addRatios(taken, common.seen, faces[common.face]);
    }
    PhotoBalance balance;
    if (all[3].size() < kMinPixels) return balance;
    balance.pixels = all[3].size();
    balance.luminance = std::exp(quantile(all[3], 0.5));
    balance.luminance_spread = 0.5 * (quantile(all[3], 0.75) - quantile(all[3], 0.25));
    for (int c = 0; c < 3; ++c) {
        std::vector<double>& list = all[static_cast<std::size_t>(c)];
        balance.measured[c] = balance.luminance;
        balance.spread[c] = kUselessSpread;
        if (2 * list.size() < balance.pixels) continue;  // mostly black
        balance.measured[c] = std::exp(quantile(list, 0.5));
        balance.spread[c] = 0.5 * (quantile(list, 0.75) - quantile(list, 0.25));
    }
    for (int c = 0; c < 3; ++c)
        balance.color_sigma[c] = colorSigma(
            faces, static_cast<std::size_t>(c), std::log(balance.measured[c] / balance.measured.g));
    return balance;
}

void choosePhotoBalance(const ProjectWhiteBalance& wanted, bool unit_known, PhotoBalance& balance)
{
    using Mode = ProjectWhiteBalance::Mode;
    balance.used = wanted.mode == Mode::Given ? wanted.gains : glm::dvec3(1.0);
    if (wanted.mode == Mode::Given) return;
    if (balance.pixels == 0) {
        if (wanted.mode == Mode::Solved)
            balance.findings.push_back(
                {Severity::Warning,
                 "photo-white-balance-doubtful",
                 "photograph and light probe see no surface in common: exposure and white "
                 "balance cannot be solved; give \"white_balance\" as three numbers"});
        else if (!unit_known)
            balance.findings.push_back(
                {Severity::Warning,
                 "light-scale-assumed",
                 "photograph and light share no known unit, and no surface that both see tells "
                 "their scale: it is taken to be 1; give \"white_balance\" as three numbers"});
        return;
    }
    const ColorJudgement color = judgeColor(balance);
    if (wanted.mode == Mode::Solved || (wanted.mode == Mode::Auto && color.off)) {
        for (int c = 0; c < 3; ++c)
            balance.used[c] =
                balance.spread[c] < kUselessSpread ? balance.measured[c] : balance.luminance;
        balance.findings.push_back(
            {Severity::Info,
             "photo-white-balance-solved",
             fmt::format(
                 "the photograph has {} times the probe's light, by {} pixels that both see "
                 "(spread {:.0f} %): its exposure and white balance are taken from that, and so "
                 "are those of all light that is put into it",
                 gainsText(balance.used),
                 balance.pixels,
                 100.0 * std::max({balance.spread.r, balance.spread.g, balance.spread.b}))});
        return;
    }
    if (wanted.mode == Mode::Auto && color.doubtful)
        balance.findings.push_back(
            {Severity::Warning,
             "photo-white-balance-doubtful",
             fmt::format("surfaces seen by both have {} times the probe's light in the "
                         "photograph, but disagree too much to tell a tint from wrong "
                         "dimensions: its colour is not changed; \"white_balance\": \"solved\" "
                         "takes it",
                         gainsText(balance.measured))});
    if (!unit_known) {
        balance.used = glm::dvec3(balance.luminance);
        balance.findings.push_back(
            {Severity::Info,
             "light-scale-from-photograph",
             fmt::format("photograph and light share no known unit; the light is scaled by {:.4g} "
                         "so that surfaces seen by both agree (spread {:.0f} %)",
                         balance.luminance,
                         100.0 * balance.luminance_spread)});
    } else if (std::abs(std::log(balance.luminance)) > kExposureOff) {
        balance.findings.push_back(
            {Severity::Warning,
             "light-photo-mismatch",
             fmt::format("surfaces seen by both are {:.2f} times as bright in the light probe as "
                         "in the photograph (spread {:.0f} %): check the exposures, the ball's "
                         "reflectance and the room's dimensions",
                         1.0 / balance.luminance,
                         100.0 * balance.luminance_spread)});
    }
}

void scaleLight(RenderLayers& layers, glm::dvec3 gains)
{
    if (gains == glm::dvec3(1.0)) return;
    const Rgb scale(gains);
    for (auto* image : {&layers.object,
                        &layers.irradiance_with,
                        &layers.irradiance_without,
                        &layers.probe_radiance})
        for (Rgb& value : image->pixels())
            value *= scale;
    const float brightness = luminance(scale);
    for (float& value : layers.object_variance.pixels())
        value *= brightness * brightness;
}

}  // namespace insitu
