#include "composite/match/grain_finish.h"

#include "core/random.h"

#include <algorithm>
#include <cmath>

namespace insitu {

double PhotoNoise::slope(int channel, double code) const
{
    const double below = std::max(0.0, code - 0.5);
    const double above = std::min(255.0, code + 0.5);
    const double rise = response_.decode(channel, above) - response_.decode(channel, below);
    return rise > 0.0 ? (above - below) * relative_exposure_ / rise : 0.0;
}

double PhotoNoise::radianceVariance(int channel, double code) const
{
    const double rise = slope(channel, code);
    if (!(rise > 0.0)) return 0.0;
    const double sigma = codeSigma(channel, code);
    return (sigma * sigma + kRoundingVariance * code_step_ * code_step_) / (rise * rise);
}

GrainFinisher::GrainFinisher(const CameraMatch& match,
                             const PhotoNoise& noise,
                             const Image<std::uint8_t>& influence)
    : match_(match), noise_(noise), width_(influence.width())
{
    int x1 = 0;
    int y1 = 0;
    x0_ = influence.width();
    y0_ = influence.height();
    for (int y = 0; y < influence.height(); ++y)
        for (int x = 0; x < influence.width(); ++x) {
            if (!influence(x, y)) continue;
            x0_ = std::min(x0_, x);
            y0_ = std::min(y0_, y);
            x1 = std::max(x1, x + 1);
            y1 = y + 1;
        }
    if (x1 > x0_) texture_ = grainTexture(match.grain, x0_, y0_, x1 - x0_, y1 - y0_, match.seed);
}

std::uint16_t GrainFinisher::finish(
    int x, int y, int channel, const PixelChange& change, int max_code) const
{
    const double code_before = noise_.codeOf(channel, change.before);
    const double code = noise_.codeOf(channel, change.after);
    const double slope_before = noise_.slope(channel, code_before);
    const double photo_sigma = slope_before > 0.0 && change.before > 0.0
                                   ? noise_.codeSigma(channel, code_before) / slope_before *
                                         (change.after - change.object) / change.before
                                   : 0.0;
    const double existing =
        noise_.slope(channel, code) * std::hypot(photo_sigma, std::sqrt(change.object_variance));
    const double wanted = noise_.codeSigma(channel, code);
    const double lacking = std::sqrt(std::max(0.0, wanted * wanted - existing * existing));
    double rounding = 0.5;
    // Grain of half a code hides the steps by itself.
    if (match_.dither && max_code == 255 && std::hypot(lacking, existing) < 0.5) {
        RandomStream random(match_.seed ^ 0xD17E4u,
                            static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(width_) +
                                static_cast<std::uint64_t>(x),
                            static_cast<std::uint64_t>(channel));
        rounding = random.uniformDouble();
    }
    const double noisy = code + lacking * texture_(x - x0_, y - y0_)[channel];
    return static_cast<std::uint16_t>(
        std::clamp(std::floor(noisy * max_code / 255.0 + rounding), 0.0, double(max_code)));
}

}  // namespace insitu
