#include "composite/match/camera_match.h"

#include "composite/match/layer_blur.h"
#include "core/parallel.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Blur and defocus below this do not show, pixels.
constexpr double kVisibleBlur = 0.1;
constexpr double kSignificant = 3.0;
/// Code of a grey of 18 % in sRGB, 8 bit.
constexpr double kMiddleGrey = 118.0;

/// Pixels of a linear picture that tell of the camera: neither clipped nor black.
Image<std::uint8_t> wellExposed(const EncodedImage& photo)
{
    Image<std::uint8_t> usable(photo.codes.width(), photo.codes.height());
    const int low = photo.max_code / 128;
    const int high = photo.max_code - low;
    for (std::size_t i = 0; i < usable.pixelCount(); ++i) {
        const glm::ivec3 code(photo.codes.pixels()[i]);
        usable.pixels()[i] =
            std::min({code.r, code.g, code.b}) >= low && std::max({code.r, code.g, code.b}) <= high;
    }
    return usable;
}

/// Catmull–Rom look-up at continuous coordinates, clamped to the edge pixels. [CatRom74]
float sampleCubic(const Image<Rgb>& image, int channel, double x, double y)
{
    const auto weights = [](double t) {
        return std::array<double, 4>{((-0.5 * t + 1.0) * t - 0.5) * t,
                                     (1.5 * t - 2.5) * t * t + 1.0,
                                     ((-1.5 * t + 2.0) * t + 0.5) * t,
                                     (0.5 * t - 0.5) * t * t};
    };
    const double fx = std::floor(x - 0.5);
    const double fy = std::floor(y - 0.5);
    const auto wx = weights(x - 0.5 - fx);
    const auto wy = weights(y - 0.5 - fy);
    double sum = 0.0;
    for (int j = 0; j < 4; ++j) {
        const int sy = std::clamp(static_cast<int>(fy) + j - 1, 0, image.height() - 1);
        for (int i = 0; i < 4; ++i) {
            const int sx = std::clamp(static_cast<int>(fx) + i - 1, 0, image.width() - 1);
            sum += wx[static_cast<std::size_t>(i)] * wy[static_cast<std::size_t>(j)] *
                   image(sx, sy)[channel];
        }
    }
    return static_cast<float>(sum);
}

/// Moves red and blue to where the lens shows them.
void magnifyChannels(const CameraMatch& match, PhotoLayers& layers)
{
    const PhotoLayers straight = layers;
    parallelFor(0, layers.object.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < layers.object.width(); ++x)
            for (const int c : {0, 2}) {
                const glm::dvec2 from =
                    match.centre_px + (glm::dvec2(x + 0.5, y + 0.5) - match.centre_px) /
                                          (1.0 + match.magnification[c]);
                const auto at = [&](const Image<Rgb>& image) {
                    return std::max(0.0f, sampleCubic(image, c, from.x, from.y));
                };
                layers.object(x, y)[c] = at(straight.object);
                layers.coverage(x, y)[c] = std::min(1.0f, at(straight.coverage));
                // Exactly as before where the objects change nothing around.
                const float with = at(straight.irradiance_with);
                const float without = at(straight.irradiance_without);
                if (with == without) continue;
                layers.irradiance_with(x, y)[c] = with;
                layers.irradiance_without(x, y)[c] = without;
            }
    });
}

void vignette(const CameraMatch& match, PhotoLayers& layers)
{
    const double half_diagonal = 0.5 * std::hypot(layers.object.width(), layers.object.height());
    for (int y = 0; y < layers.object.height(); ++y)
        for (int x = 0; x < layers.object.width(); ++x) {
            if (layers.object(x, y) == Rgb(0.0f)) continue;
            const double r =
                glm::length(glm::dvec2(x + 0.5, y + 0.5) - match.centre_px) / half_diagonal;
            const auto factor = static_cast<float>(match.vignetting.factor(r));
            layers.object(x, y) *= factor;
            layers.object_variance(x, y) *= factor * factor;
        }
}

LayerBlur blurOf(const RenderLayers& layers,
                 const CameraMatch& match,
                 const Image<float>& receiver_depth_m)
{
    LayerBlur blur;
    const auto base = static_cast<float>(match.blur_px);
    blur.object_sigma_px = Image<float>(layers.object.width(), layers.object.height(), base);
    blur.receiver_sigma_px = blur.object_sigma_px;
    blur.max_sigma_px = base;
    if (!match.depth_of_field) return blur;
    const auto defocus = [&](const Image<float>& depth_m, Image<float>& sigma_px) {
        for (std::size_t i = 0; i < depth_m.pixelCount(); ++i) {
            if (!(depth_m.pixels()[i] > 0.0f)) continue;
            const double out = match.depth_of_field->sigmaAt(depth_m.pixels()[i]);
            sigma_px.pixels()[i] = static_cast<float>(
                std::min(std::hypot(match.blur_px, out), BlurTaps::kMaxReach / 3.0));
            blur.max_sigma_px = std::max(blur.max_sigma_px, sigma_px.pixels()[i]);
        }
    };
    defocus(layers.depth_m, blur.object_sigma_px);
    defocus(receiver_depth_m, blur.receiver_sigma_px);
    return blur;
}

}  // namespace

Findings CameraMatchOptions::validate() const
{
    Findings findings;
    if (vignetting_a && !(*vignetting_a > -1.0 && std::isfinite(*vignetting_a)))
        findings.push_back(
            {Severity::Error, "option-out-of-range", "vignetting_a must be finite and > -1"});
    if (focus_m && !(*focus_m > 0.0 && std::isfinite(*focus_m)))
        findings.push_back(
            {Severity::Error, "option-out-of-range", "focus_m must be finite and > 0"});
    return findings;
}

void leaveOut(const std::string& part, CameraMatchOptions& options)
{
    bool CameraMatchOptions::*const members[] = {&CameraMatchOptions::grain,
                                                 &CameraMatchOptions::blur,
                                                 &CameraMatchOptions::vignetting,
                                                 &CameraMatchOptions::chromatic_aberration,
                                                 &CameraMatchOptions::depth_of_field,
                                                 &CameraMatchOptions::dither};
    bool known = part == kMatchParts.back();
    for (std::size_t i = 0; i < std::size(members); ++i) {
        if (part != kMatchParts[i] && part != kMatchParts.back()) continue;
        options.*members[i] = false;
        known = true;
    }
    INSITU_CHECK(known, "{}", part);
}

double DepthOfField::sigmaAt(double depth_m) const
{
    // A disc's variance along one axis is (diameter/4)².
    return 0.25 * diameter_px * std::abs(1.0 / depth_m - 1.0 / focus_m);
}

CameraMatchEstimate estimateCameraMatch(const EncodedImage& photo,
                                        const ResponseCurve& response,
                                        const Image<Rgb>& radiance,
                                        const Image<float>& depth_m,
                                        const MatchedCamera& camera,
                                        const CameraMatchOptions& options)
{
    requireValid(options.validate(), "camera match options");
    CameraMatchEstimate estimate;
    CameraMatch& match = estimate.match;
    match.centre_px = camera.principal_px;
    match.seed = options.seed;
    match.dither = options.dither;
    std::vector<std::string> told;
    if (options.grain) {
        GrainEstimate grain = estimateGrain(photo, response);
        append(estimate.findings, std::move(grain.findings));
        match.grain = std::move(grain.model);
        const double sigma = match.grain.sigmaAt(1, kMiddleGrey);
        if (sigma > 0.0) told.push_back(fmt::format("grain of {:.1f} codes at middle grey", sigma));
    }
    const bool focus = options.depth_of_field && camera.aperture_px_m > 0.0;
    const bool find_focus = focus && !options.focus_m && !depth_m.empty();
    const Image<std::uint8_t> usable = wellExposed(photo);
    std::vector<EdgeProfile> edges;
    if (options.blur || options.chromatic_aberration || find_focus)
        edges = edgeProfiles(radiance, usable);
    if (focus && options.focus_m)
        match.depth_of_field = DepthOfField{camera.aperture_px_m, *options.focus_m};
    else if (find_focus)
        match.depth_of_field = estimateFocus(edges, depth_m, camera.aperture_px_m);
    if (options.blur) {
        estimate.blur = estimateBlur(edges);
        append(estimate.findings, estimate.blur.findings);
        // Edges out of focus are part of the above; the lens has them by itself.
        if (match.depth_of_field)
            estimate.blur.sigma_px =
                blurInFocus(edges, depth_m, *match.depth_of_field).value_or(estimate.blur.sigma_px);
        if (estimate.blur.sigma_px >= kVisibleBlur) {
            match.blur_px = estimate.blur.sigma_px;
            told.push_back(fmt::format("blur of {:.2f} px", match.blur_px));
        }
    }
    if (match.depth_of_field)
        told.push_back(fmt::format("focus at {:.2f} m", match.depth_of_field->focus_m));
    if (options.chromatic_aberration) {
        estimate.aberration = estimateChromaticAberration(edges, camera.principal_px);
        if (estimate.aberration.significant) {
            match.magnification = estimate.aberration.magnification;
            const double corner_px = glm::length(camera.principal_px);
            told.push_back(fmt::format("red {:+.2f} px and blue {:+.2f} px outwards in the corners",
                                       match.magnification.r * corner_px,
                                       match.magnification.b * corner_px));
        }
    }
    if (options.vignetting && options.vignetting_a)
        match.vignetting.a = *options.vignetting_a;
    else if (options.vignetting && options.estimate_vignetting) {
        estimate.vignetting = estimateVignetting(radiance, usable, camera.principal_px);
        if (estimate.vignetting.a > kSignificant * estimate.vignetting.sigma)
            match.vignetting = estimate.vignetting;
    }
    if (match.vignetting.a != 0.0)
        told.push_back(fmt::format("corners darker by {:.0f} %",
                                   100.0 * (1.0 - match.vignetting.factor(1.0))));
    if (!told.empty())
        estimate.findings.push_back(
            {Severity::Info,
             "camera-matched",
             fmt::format("the objects get what the photograph shows: {}", fmt::join(told, ", "))});
    return estimate;
}

PhotoLayers matchLayers(const RenderLayers& layers,
                        const CameraMatch& match,
                        const Image<float>& receiver_depth_m)
{
    PhotoLayers result{layers.object,
                       Image<Rgb>(layers.alpha.width(), layers.alpha.height()),
                       layers.irradiance_without,
                       layers.irradiance_with,
                       layers.probe_radiance,
                       layers.object_variance,
                       layers.depth_m};
    for (std::size_t i = 0; i < layers.alpha.pixelCount(); ++i)
        result.coverage.pixels()[i] = Rgb(layers.alpha.pixels()[i]);
    if (match.vignetting.a != 0.0) vignette(match, result);
    if (match.blur_px > 0.0 || match.depth_of_field)
        blurLayers(blurOf(layers, match, receiver_depth_m), result);
    if (match.magnification != glm::dvec3(0.0)) magnifyChannels(match, result);
    return result;
}

}  // namespace insitu
