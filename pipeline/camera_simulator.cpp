#include "pipeline/camera_simulator.h"

#include "core/io/exif.h"
#include "core/parallel.h"
#include "core/random.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

double sCurve(double k, double y)
{
    return (1.0 - k) * y + k * y * y * (3.0 - 2.0 * y);
}

/// Separable Gaussian, cut at 3σ, renormalised at the borders.
Image<Rgb> blurred(const Image<Rgb>& image, double sigma)
{
    const int radius = static_cast<int>(std::ceil(3.0 * sigma));
    std::vector<float> kernel;
    for (int i = -radius; i <= radius; ++i)
        kernel.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma))));

    const auto pass = [&](const Image<Rgb>& from, int step_x, int step_y) {
        Image<Rgb> to(from.width(), from.height());
        parallelFor(0, from.height(), [&](std::int64_t row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < from.width(); ++x) {
                Rgb sum{0.0f};
                float weight = 0.0f;
                for (int i = -radius; i <= radius; ++i) {
                    const int sx = x + i * step_x;
                    const int sy = y + i * step_y;
                    if (sx < 0 || sy < 0 || sx >= from.width() || sy >= from.height()) continue;
                    const float w = kernel[static_cast<std::size_t>(i + radius)];
                    sum += w * from(sx, sy);
                    weight += w;
                }
                to(x, y) = sum / weight;
            }
        });
        return to;
    };
    return pass(pass(image, 1, 0), 0, 1);
}

}  // namespace

double encodeTone(const ToneCurve& curve, int channel, double exposure)
{
    const double clipped = std::clamp(exposure, 0.0, 1.0);
    return sCurve(curve.contrast[channel], std::pow(clipped, 1.0 / curve.gamma[channel]));
}

double decodeTone(const ToneCurve& curve, int channel, double value)
{
    // Bisection: s is increasing on [0, 1] for every contrast in [0, 1].
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (sCurve(curve.contrast[channel], middle) < value ? low : high) = middle;
    }
    return value >= 1.0 ? 1.0 : std::pow(0.5 * (low + high), curve.gamma[channel]);
}

ResponseCurve responseTable(const ToneCurve& curve)
{
    ResponseCurve table;
    table.source = "simulated";
    for (int c = 0; c < 3; ++c)
        for (int z = 0; z < 256; ++z)
            table.exposure[static_cast<std::size_t>(c)][static_cast<std::size_t>(z)] =
                z == 0 ? 0.0 : decodeTone(curve, c, z / 255.0);
    return table;
}

double sensorScale(const Image<Rgb>& radiance, const SimulatedRoom& room, double seconds)
{
    // Compare in sensor exposure: each channel has its own exposure for the code.
    std::vector<float> values;
    values.reserve(radiance.pixelCount() * 3);
    for (const Rgb& pixel : radiance.pixels())
        for (int c = 0; c < 3; ++c)
            values.push_back(pixel[c] / static_cast<float>(decodeTone(
                                            room.body.response, c, room.plate_code / 255.0)));
    const auto rank = static_cast<std::ptrdiff_t>(
        std::ceil(room.plate_percentile / 100.0 * static_cast<double>(values.size())));
    const auto nth = values.begin() + std::max<std::ptrdiff_t>(rank - 1, 0);
    std::nth_element(values.begin(), nth, values.end());
    if (!(*nth > 0.0f))
        throw InputError(room.file.string(), "the picture is black: no light reaches the camera");
    return 1.0 / (static_cast<double>(*nth) * seconds);
}

EncodedImage photograph(const Image<Rgb>& radiance,
                        const SimulatedCameraBody& body,
                        double sensor_scale,
                        double seconds,
                        std::uint64_t seed,
                        std::uint64_t shot)
{
    const Image<Rgb> light = body.blur_px > 0.0 ? blurred(radiance, body.blur_px) : radiance;
    EncodedImage photo;
    photo.codes = Image<glm::u16vec3>(light.width(), light.height());
    const double gain = sensor_scale * seconds;
    parallelFor(0, light.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < light.width(); ++x) {
            const auto pixel =
                static_cast<std::uint64_t>(row) * static_cast<std::uint64_t>(light.width()) +
                static_cast<std::uint64_t>(x);
            RandomStream random(seed, pixel, shot);
            for (int c = 0; c < 3; ++c) {
                const double exposure = gain * static_cast<double>(light(x, y)[c]);
                const double sigma =
                    std::sqrt(body.read_noise * body.read_noise + body.photon_noise * exposure);
                const double noisy = exposure + sigma * random.normal();
                photo.codes(x, y)[c] = static_cast<std::uint16_t>(
                    std::lround(255.0 * encodeTone(body.response, c, noisy)));
            }
        }
    });
    return photo;
}

std::vector<std::uint8_t> simulatedExif(const SimulatedCameraBody& body,
                                        double seconds,
                                        double focal_px,
                                        int width)
{
    constexpr double kSensorWidthMm = 36.0;
    PhotoMetadata metadata;
    metadata.exposure = {seconds, body.f_number, body.iso};
    metadata.focal_mm = focal_px * kSensorWidthMm / width;
    metadata.focal_35mm = metadata.focal_mm;
    metadata.make = body.make;
    metadata.model = body.model;
    return makeExif(metadata);
}

}  // namespace insitu
