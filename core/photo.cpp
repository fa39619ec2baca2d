#include "core/photo.h"

#include "core/color.h"
#include "core/parallel.h"
#include "core/quantile.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Where the largest value comes to lie, a share of all codes: below what counts as clipped.
constexpr double kLargest = 0.98;
/// The curve is linear up to this share of the median.
constexpr double kLinear = 0.01;
/// But the median counts as no less than this share of the largest value.
constexpr double kLeastMedian = 1e-7;

/// value = scale · sinh(steepness · code / 255); of black pictures value = code / 255.
ResponseCurve curveOver(double median, double largest)
{
    ResponseCurve curve;
    curve.source = "linear";
    const double scale = kLinear * std::max(median, kLeastMedian * largest);
    const double steepness = largest > 0.0 ? std::asinh(largest / scale) / kLargest : 0.0;
    for (std::size_t z = 0; z < 256; ++z) {
        const double code = static_cast<double>(z) / 255.0;
        const double value = largest > 0.0 ? scale * std::sinh(steepness * code) : code;
        for (auto& table : curve.exposure)
            table[z] = value;
    }
    return curve;
}

}  // namespace

Photo photoFromRadiance(Image<Rgb> radiance)
{
    Photo photo;
    double largest = 0.0;
    std::vector<double> luminances;
    luminances.reserve(radiance.pixelCount());
    for (const Rgb& pixel : radiance.pixels()) {
        largest = std::max<double>(largest, std::max({pixel.r, pixel.g, pixel.b}));
        luminances.push_back(luminance(pixel));
    }
    const double median = luminances.empty() ? 0.0 : quantile(luminances, 0.5);
    photo.metadata.color.name = "linear";
    photo.metadata.color.transfer = curveOver(median, largest);
    photo.metadata.color.transfer_is_response = true;
    photo.image.max_code = 65535;
    photo.image.codes = Image<glm::u16vec3>(radiance.width(), radiance.height());
    const ResponseCurve& curve = photo.metadata.color.transfer;
    parallelFor(0, radiance.height(), [&](std::int64_t row) {
        const auto y = static_cast<int>(row);
        for (int x = 0; x < radiance.width(); ++x)
            for (int c = 0; c < 3; ++c)
                photo.image.codes(x, y)[c] = static_cast<std::uint16_t>(
                    std::lround(curve.encode(c, radiance(x, y)[c]) * 257.0));
    });
    photo.radiance = std::move(radiance);
    return photo;
}

}  // namespace insitu
