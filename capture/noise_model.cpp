#include "capture/noise_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// A sensor of four to six micrometre pixels, as interchangeable-lens cameras have them.
constexpr double kElectronsAtIso100 = 32'000.0;
constexpr double kReadElectrons = 5.0;
constexpr double kUnknownIso = 800.0;
/// At the ends of the ISO range of cameras, so that odd metadata leaves a usable model.
constexpr double kLeastIso = 25.0;
constexpr double kGreatestIso = 409'600.0;

}  // namespace

double NoiseModel::variance(const ResponseCurve& response, int channel, double code) const
{
    const ChannelNoise& noise = channels[static_cast<std::size_t>(channel)];
    const double z = std::clamp(code, 0.5, 254.5);
    const double slope = response.decode(channel, z + 0.5) - response.decode(channel, z - 0.5);
    return noise.read_variance + noise.gain * response.decode(channel, code) +
           noise.code_variance * slope * slope;
}

Findings NoiseModel::validate() const
{
    Findings findings;
    for (std::size_t c = 0; c < channels.size(); ++c) {
        const ChannelNoise& noise = channels[c];
        const double sum = noise.read_variance + noise.gain + noise.code_variance;
        if (std::isfinite(sum) && noise.read_variance >= 0.0 && noise.gain >= 0.0 &&
            noise.code_variance > 0.0)
            continue;
        findings.push_back({Severity::Error,
                            "noise-model-invalid",
                            fmt::format("channel {}: read variance {}, gain {}, code variance {}; "
                                        "they must be finite and not negative, the last above 0",
                                        "RGB"[c],
                                        noise.read_variance,
                                        noise.gain,
                                        noise.code_variance)});
    }
    return findings;
}

NoiseModel assumedNoise(const ResponseCurve& response, std::optional<double> iso, int max_code)
{
    const double known = iso && std::isfinite(*iso) && *iso > 0.0 ? *iso : kUnknownIso;
    const double electrons =
        kElectronsAtIso100 * 100.0 / std::clamp(known, kLeastIso, kGreatestIso);
    const double code_step = 255.0 / max_code;
    NoiseModel model;
    for (std::size_t c = 0; c < model.channels.size(); ++c) {
        const double electron = response.exposure[c][255] / electrons;
        model.channels[c].gain = electron;
        model.channels[c].read_variance = kReadElectrons * electron * kReadElectrons * electron;
        model.channels[c].code_variance = code_step * code_step / 12.0;
    }
    return model;
}

}  // namespace insitu
