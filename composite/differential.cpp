#include "composite/differential.h"

#include "composite/box_filter.h"
#include "composite/match/grain_finish.h"
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numbers>
#include <vector>

namespace insitu {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
/// Side of the neighbourhood that tells noise from clipping, pixels: wider than JPEG's 8x8 blocks.
constexpr int kClipWindow = 11;
/// Coverage from which a pixel is the object's: the tails of its blur below it count by what they
/// change.
constexpr float kCovered = 1.0f / 512.0f;

/// ρ/π of every pixel's receiver; 0 where there is none.
Image<Rgb> reflectanceOverPi(const EncodedImage& photo,
                             const Image<Rgb>& radiance,
                             const PhotoLayers& layers,
                             const CompositeOptions& options,
                             const PhotoNoise& noise)
{
    Image<Rgb> own(radiance.width(), radiance.height());
    const float limit = static_cast<float>(options.max_reflectance) / kPi;
    for (std::size_t i = 0; i < own.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c) {
            const float irradiance = layers.irradiance_without.pixels()[i][c];
            if (irradiance > 0.0f)
                own.pixels()[i][c] = std::min(radiance.pixels()[i][c] / irradiance, limit);
        }
    if (options.form == CompositeForm::Ratio) return own;
    const Image<Rgb> smooth = boxFilter<glm::dvec3>(own, options.reflectance_window);
    if (options.form == CompositeForm::Difference) return smooth;

    // Local variance, less what noise makes of it, is the receiver's own texture.
    Image<Rgb> squares(own.width(), own.height());
    for (std::size_t i = 0; i < own.pixelCount(); ++i)
        squares.pixels()[i] = own.pixels()[i] * own.pixels()[i];
    squares = boxFilter<glm::dvec3>(squares, options.reflectance_window);
    Image<Rgb> mixed(own.width(), own.height());
    for (std::size_t i = 0; i < own.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c) {
            const double mean = smooth.pixels()[i][c];
            const double variance = squares.pixels()[i][c] - mean * mean;
            const double irradiance = layers.irradiance_without.pixels()[i][c];
            if (!(irradiance > 0.0)) continue;
            const double made =
                noise.radianceVariance(c, photo.codes.pixels()[i][c] * 255.0 / photo.max_code) /
                (irradiance * irradiance);
            const double share = variance > 0.0 ? std::clamp(1.0 - made / variance, 0.0, 1.0) : 0.0;
            mixed.pixels()[i][c] = static_cast<float>(mean + share * (own.pixels()[i][c] - mean));
        }
    return mixed;
}

/// Raises clipped channels to what the light probe knows of them; returns how many pixels had any.
///
/// Where another channel of the pixel is not clipped it gives the level and the probe only the
/// colour, since the probe sees the surface less sharply than the photograph does. A clipped pixel
/// among unclipped ones is clipped by its noise and lies near the bound: the probe counts by how
/// far more than half of the neighbourhood is clipped.
std::size_t restoreClipped(const EncodedImage& photo,
                           const Image<Rgb>& probe,
                           double clip_code,
                           Image<Rgb>& radiance)
{
    Image<Rgb> is_clipped(radiance.width(), radiance.height());
    for (std::size_t i = 0; i < radiance.pixelCount(); ++i)
        for (int c = 0; c < 3; ++c)
            is_clipped.pixels()[i][c] = photo.codes.pixels()[i][c] >= clip_code ? 1.0f : 0.0f;
    const Image<Rgb> clipped_share = boxFilter<glm::dvec3>(is_clipped, kClipWindow);

    std::size_t count = 0;
    for (std::size_t i = 0; i < radiance.pixelCount(); ++i) {
        const glm::u16vec3 code = photo.codes.pixels()[i];
        const Rgb seen = probe.pixels()[i];
        Rgb& value = radiance.pixels()[i];
        float known = 0.0f;
        float known_probe = 0.0f;
        bool any = false;
        for (int c = 0; c < 3; ++c) {
            if (code[c] >= clip_code) {
                any = true;
                continue;
            }
            known += value[c];
            known_probe += seen[c];
        }
        if (!any) continue;
        ++count;
        const float level = known_probe > 0.0f ? known / known_probe : 1.0f;
        for (int c = 0; c < 3; ++c) {
            if (code[c] < clip_code) continue;
            const float belief = std::clamp(2.0f * clipped_share.pixels()[i][c] - 1.0f, 0.0f, 1.0f);
            value[c] += belief * std::max(0.0f, level * seen[c] - value[c]);
        }
    }
    return count;
}

Composite compositeInOwnPrimaries(const EncodedImage& photo,
                                  const ResponseCurve& response,
                                  double relative_exposure,
                                  const PhotoLayers& layers,
                                  const CompositeOptions& options,
                                  const CameraMatch& match)
{
    INSITU_CHECK(photo.codes.sameSize(layers.object),
                 "photograph {}x{}, layers {}x{}",
                 photo.codes.width(),
                 photo.codes.height(),
                 layers.object.width(),
                 layers.object.height());
    const int width = photo.codes.width();
    const int height = photo.codes.height();
    const double clip_code = options.clip_fraction * photo.max_code;

    Composite composite;
    composite.image = photo;
    composite.linear = Image<Rgb>(width, height);
    composite.influence = Image<std::uint8_t>(width, height);
    Image<Rgb> radiance = photographedRadiance(photo, response, relative_exposure);
    const std::size_t clipped = restoreClipped(photo, layers.probe_radiance, clip_code, radiance);
    const PhotoNoise noise(match.grain, response, relative_exposure, photo.max_code);
    const Image<Rgb> reflectance = reflectanceOverPi(photo, radiance, layers, options, noise);

    std::atomic<std::size_t> changed{0};
    std::atomic<std::size_t> changed_clipped{0};
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            const Rgb uncovered = Rgb(1.0f) - layers.coverage(x, y);
            const Rgb change = reflectance(x, y) *
                               (layers.irradiance_with(x, y) - layers.irradiance_without(x, y));
            const Rgb before = radiance(x, y);
            const Rgb after =
                layers.object(x, y) + uncovered * glm::max(before + change, Rgb(0.0f));
            composite.linear(x, y) = after;
            const Rgb covered = layers.coverage(x, y);
            bool influenced = std::max({covered.r, covered.g, covered.b}) >= kCovered;
            for (int c = 0; c < 3; ++c)
                influenced =
                    influenced || std::abs(noise.codeOf(c, after[c]) - noise.codeOf(c, before[c])) *
                                          photo.max_code / 255.0 >=
                                      options.influence_codes;
            if (!influenced) continue;
            composite.influence(x, y) = 1;
            changed.fetch_add(1);
        }
    });

    const GrainFinisher finisher(match, noise, composite.influence);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (!composite.influence(x, y)) continue;
            bool was_clipped = false;
            for (int c = 0; c < 3; ++c) {
                const PixelChange change{radiance(x, y)[c],
                                         composite.linear(x, y)[c],
                                         layers.object(x, y)[c],
                                         layers.object_variance(x, y)};
                std::uint16_t code = finisher.finish(x, y, c, change, photo.max_code);
                // A clipped channel stays as it came unless the light falls below the clipping.
                const std::uint16_t was = photo.codes(x, y)[c];
                if (was >= clip_code) {
                    was_clipped = true;
                    code = std::min(code, was);
                }
                composite.image.codes(x, y)[c] = code;
            }
            if (was_clipped) changed_clipped.fetch_add(1);
        }
    });
    composite.influence_fraction =
        static_cast<double>(changed) /
        std::max<double>(1.0, static_cast<double>(radiance.pixelCount()));
    if (changed_clipped > 0)
        composite.findings.push_back(
            {Severity::Info,
             "composite-clipped-pixels",
             fmt::format(
                 "{:.1f} % of the photograph is clipped; {} pixels the objects affect are "
                 "among them: there the light probe or the bound stands for the photograph",
                 100.0 * static_cast<double>(clipped) / static_cast<double>(radiance.pixelCount()),
                 changed_clipped.load())});
    return composite;
}

}  // namespace

const char* compositeFormName(CompositeForm form)
{
    switch (form) {
        case CompositeForm::Ratio:
            return "ratio";
        case CompositeForm::Difference:
            return "difference";
        case CompositeForm::Mixed:
            return "mixed";
    }
    return "ratio";
}

Findings CompositeOptions::validate() const
{
    Findings findings;
    const auto demand = [&](bool holds, const char* message) {
        if (!holds) findings.push_back({Severity::Error, "option-out-of-range", message});
    };
    demand(reflectance_window >= 1 && reflectance_window % 2 == 1,
           "reflectance_window must be odd and >= 1");
    demand(max_reflectance > 0.0 && max_reflectance <= 1.0, "max_reflectance must be in (0, 1]");
    demand(clip_fraction > 0.5 && clip_fraction <= 1.0, "clip_fraction must be in (0.5, 1]");
    demand(influence_codes >= 0.0, "influence_codes must be >= 0");
    return findings;
}

Image<Rgb> photographedRadiance(const EncodedImage& photo,
                                const ResponseCurve& response,
                                double relative_exposure,
                                const glm::dmat3& rec709_from_linear)
{
    INSITU_CHECK(relative_exposure > 0.0, "relative exposure {}", relative_exposure);
    // One table look-up a channel: every code of the picture's depth once.
    std::array<std::vector<float>, 3> table;
    for (int c = 0; c < 3; ++c) {
        auto& channel = table[static_cast<std::size_t>(c)];
        channel.resize(static_cast<std::size_t>(photo.max_code) + 1);
        for (int code = 0; code <= photo.max_code; ++code)
            channel[static_cast<std::size_t>(code)] = static_cast<float>(
                response.decode(c, code * 255.0 / photo.max_code) / relative_exposure);
    }
    Image<Rgb> radiance(photo.codes.width(), photo.codes.height());
    for (std::size_t i = 0; i < radiance.pixelCount(); ++i) {
        const glm::u16vec3 code = photo.codes.pixels()[i];
        radiance.pixels()[i] = {table[0][code.r], table[1][code.g], table[2][code.b]};
    }
    (void)convertPixels(radiance, rec709_from_linear);
    return radiance;
}

Composite compositeDifferential(const EncodedImage& photo,
                                const ResponseCurve& response,
                                double relative_exposure,
                                const PhotoLayers& layers,
                                const CompositeOptions& options,
                                const glm::dmat3& rec709_from_linear,
                                const CameraMatch& match)
{
    requireValid(options.validate(), "composite options");
    if (rec709_from_linear == glm::dmat3(1.0))
        return compositeInOwnPrimaries(photo, response, relative_exposure, layers, options, match);
    const glm::dmat3 own_from_rec709 = glm::inverse(rec709_from_linear);
    PhotoLayers own = layers;
    for (Image<Rgb>* image :
         {&own.object, &own.irradiance_without, &own.irradiance_with, &own.probe_radiance})
        (void)convertPixels(*image, own_from_rec709);
    Composite composite =
        compositeInOwnPrimaries(photo, response, relative_exposure, own, options, match);
    (void)convertPixels(composite.linear, rec709_from_linear);
    return composite;
}

Image<Rgb> radianceOfComposite(const Photo& photo, const Composite& composite)
{
    INSITU_CHECK(photo.radiance.sameSize(composite.linear),
                 "{}x{} and {}x{}",
                 photo.radiance.width(),
                 photo.radiance.height(),
                 composite.linear.width(),
                 composite.linear.height());
    const ResponseCurve& curve = photo.metadata.color.transfer;
    const int max_code = composite.image.max_code;
    Image<Rgb> radiance = photo.radiance;
    for (std::size_t i = 0; i < radiance.pixelCount(); ++i) {
        if (composite.influence.pixels()[i] == 0) continue;
        const glm::u16vec3 code = composite.image.codes.pixels()[i];
        for (int c = 0; c < 3; ++c)
            radiance.pixels()[i][c] =
                code[c] < max_code ? static_cast<float>(curve.decode(c, code[c] * 255.0 / max_code))
                                   : composite.linear.pixels()[i][c];
    }
    return radiance;
}

}  // namespace insitu
