#include "composite/differential.h"

#include "composite/box_filter.h"
#include "core/parallel.h"
#include "core/random.h"

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

/// Variance of a photographed radiance that its grain makes, by channel.
class RadianceNoise {
public:
    RadianceNoise(const CameraMatch& match, const ResponseCurve& response, double relative_exposure)
        : match_(match), response_(response), relative_exposure_(relative_exposure)
    {
    }
    /// Rise of the 8-bit code with the radiance there.
    [[nodiscard]] double slope(int channel, double code) const
    {
        const double low = response_.decode(channel, std::max(0.0, code - 0.5));
        const double high = response_.decode(channel, std::min(255.0, code + 0.5));
        const double codes = std::min(255.0, code + 0.5) - std::max(0.0, code - 0.5);
        return high > low ? codes * relative_exposure_ / (high - low) : 0.0;
    }
    [[nodiscard]] double codeSigma(int channel, double code) const
    {
        return match_.grain.sigmaAt(channel, code);
    }
    [[nodiscard]] double variance(int channel, double code) const
    {
        const double rise = slope(channel, code);
        if (!(rise > 0.0)) return 0.0;
        // Rounding to codes is noise too.
        const double sigma = codeSigma(channel, code);
        return (sigma * sigma + 1.0 / 12.0) / (rise * rise);
    }

private:
    const CameraMatch& match_;
    const ResponseCurve& response_;
    double relative_exposure_;
};

/// ρ/π of every pixel's receiver; 0 where there is none.
Image<Rgb> reflectanceOverPi(const EncodedImage& photo,
                             const Image<Rgb>& radiance,
                             const PhotoLayers& layers,
                             const CompositeOptions& options,
                             const RadianceNoise& noise)
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
                noise.variance(c, photo.codes.pixels()[i][c] * 255.0 / photo.max_code) /
                (irradiance * irradiance);
            const double share = variance > 0.0 ? std::clamp(1.0 - made / variance, 0.0, 1.0) : 0.0;
            mixed.pixels()[i][c] = static_cast<float>(mean + share * (own.pixels()[i][c] - mean));
        }
    return mixed;
}

/// A rectangle of pixels, x0 <= x < x1.
struct PixelBox {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

PixelBox boxOf(const Image<std::uint8_t>& mask)
{
    PixelBox box{mask.width(), mask.height(), 0, 0};
    for (int y = 0; y < mask.height(); ++y)
        for (int x = 0; x < mask.width(); ++x)
            if (mask(x, y))
                box = {std::min(box.x0, x),
                       std::min(box.y0, y),
                       std::max(box.x1, x + 1),
                       std::max(box.y1, y + 1)};
    return box;
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

/// One channel of a changed pixel on its way to a code, 8-bit steps.
struct CodeChange {
    double before = 0.0;    ///< expected code of the photograph as it was
    double after = 0.0;     ///< expected code with the objects
    double lacking = 0.0;   ///< deviation of the grain that is still to be added
    double existing = 0.0;  ///< deviation of what is there: the photograph's and the renderer's
};

/// Grain, dither and rounding of the changed pixels.
class Finisher {
public:
    Finisher(const CameraMatch& match, const Image<std::uint8_t>& influence)
        : match_(match), box_(boxOf(influence))
    {
        if (box_.x1 > box_.x0)
            texture_ = grainTexture(
                match.grain, box_.x0, box_.y0, box_.x1 - box_.x0, box_.y1 - box_.y0, match.seed);
    }
    /// The code of the photograph's depth.
    [[nodiscard]] std::uint16_t finish(
        int x, int y, int channel, int width, const CodeChange& change, int max_code) const
    {
        const double step = max_code / 255.0;
        const double noisy =
            change.after + change.lacking * texture_(x - box_.x0, y - box_.y0)[channel];
        double rounding = 0.5;
        // Grain of a whole code hides the steps by itself.
        if (match_.dither && max_code == 255 && std::hypot(change.lacking, change.existing) < 0.5) {
            RandomStream random(match_.seed ^ 0xD17E4u,
                                static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(width) +
                                    static_cast<std::uint64_t>(x),
                                static_cast<std::uint64_t>(channel));
            rounding = random.uniformDouble();
        }
        return static_cast<std::uint16_t>(
            std::clamp(std::floor(noisy * step + rounding), 0.0, double(max_code)));
    }

private:
    const CameraMatch& match_;
    PixelBox box_;
    Image<Rgb> texture_;
};

Composite compositeInOwnPrimaries(const EncodedImage& photo,
                                  const ResponseCurve& response,
                                  double relative_exposure,
                                  const RenderLayers& rendered,
                                  const CompositeOptions& options,
                                  const CameraMatch& match,
                                  const Image<float>& receiver_depth_m)
{
    INSITU_CHECK(photo.codes.sameSize(rendered.object),
                 "photograph {}x{}, layers {}x{}",
                 photo.codes.width(),
                 photo.codes.height(),
                 rendered.object.width(),
                 rendered.object.height());
    const int width = photo.codes.width();
    const int height = photo.codes.height();
    const double clip_code = options.clip_fraction * photo.max_code;

    Composite composite;
    composite.image = photo;
    composite.linear = Image<Rgb>(width, height);
    composite.influence = Image<std::uint8_t>(width, height);
    composite.layers = matchLayers(rendered, match, receiver_depth_m);
    const PhotoLayers& layers = composite.layers;
    Image<Rgb> radiance = photographedRadiance(photo, response, relative_exposure);
    const std::size_t clipped = restoreClipped(photo, layers.probe_radiance, clip_code, radiance);
    const RadianceNoise noise(match, response, relative_exposure);
    const Image<Rgb> reflectance = reflectanceOverPi(photo, radiance, layers, options, noise);
    const auto codeOf = [&](int c, double value) {
        return response.encode(c, value * relative_exposure);
    };

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
            bool influenced = rendered.alpha(x, y) > 0.0f;
            for (int c = 0; c < 3; ++c)
                influenced = influenced || std::abs(codeOf(c, after[c]) - codeOf(c, before[c])) *
                                                   photo.max_code / 255.0 >=
                                               options.influence_codes;
            if (!influenced) continue;
            composite.influence(x, y) = 1;
            changed.fetch_add(1);
        }
    });

    const Finisher finisher(match, composite.influence);
    parallelFor(0, height, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < width; ++x) {
            if (!composite.influence(x, y)) continue;
            bool was_clipped = false;
            for (int c = 0; c < 3; ++c) {
                const std::uint16_t was = photo.codes(x, y)[c];
                const double before = radiance(x, y)[c];
                const double after = composite.linear(x, y)[c];
                CodeChange code{codeOf(c, before), codeOf(c, after)};
                const double rise = noise.slope(c, code.after);
                const double old_rise = noise.slope(c, code.before);
                // The photograph's noise goes with its share of the light.
                const double kept = after - layers.object(x, y)[c];
                const double photo_sigma =
                    old_rise > 0.0 && before > 0.0
                        ? noise.codeSigma(c, code.before) / old_rise * kept / before
                        : 0.0;
                code.existing =
                    rise * std::hypot(photo_sigma, std::sqrt(layers.object_variance(x, y)));
                const double wanted = noise.codeSigma(c, code.after);
                code.lacking =
                    std::sqrt(std::max(0.0, wanted * wanted - code.existing * code.existing));
                std::uint16_t now = finisher.finish(x, y, c, width, code, photo.max_code);
                // A clipped channel stays as it came unless the light falls below the clipping.
                if (was >= clip_code) {
                    was_clipped = true;
                    now = std::min(now, was);
                }
                composite.image.codes(x, y)[c] = now;
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
                                const RenderLayers& layers,
                                const CompositeOptions& options,
                                const glm::dmat3& rec709_from_linear,
                                const CameraMatch& match,
                                const Image<float>& receiver_depth_m)
{
    requireValid(options.validate(), "composite options");
    if (rec709_from_linear == glm::dmat3(1.0))
        return compositeInOwnPrimaries(
            photo, response, relative_exposure, layers, options, match, receiver_depth_m);
    const glm::dmat3 own_from_rec709 = glm::inverse(rec709_from_linear);
    RenderLayers own = layers;
    for (Image<Rgb>* image :
         {&own.object, &own.irradiance_without, &own.irradiance_with, &own.probe_radiance})
        (void)convertPixels(*image, own_from_rec709);
    Composite composite = compositeInOwnPrimaries(
        photo, response, relative_exposure, own, options, match, receiver_depth_m);
    for (Image<Rgb>* image : {&composite.linear,
                              &composite.layers.object,
                              &composite.layers.irradiance_without,
                              &composite.layers.irradiance_with,
                              &composite.layers.probe_radiance})
        (void)convertPixels(*image, rec709_from_linear);
    return composite;
}

}  // namespace insitu
