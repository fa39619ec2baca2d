#include "evaluate/error_metrics.h"

#include "core/color.h"
#include "core/parallel.h"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

namespace insitu {

namespace {

/// Sums over one row, or over rows that were added in order.
struct Sums {
    std::int64_t pixels = 0;
    std::int64_t black_pixels = 0;
    glm::dvec3 squared{0.0};
    glm::dvec3 smallest{std::numeric_limits<double>::infinity()};
    glm::dvec3 largest{-std::numeric_limits<double>::infinity()};
    double relative_squared = 0.0;
    double relative_absolute = 0.0;
    double max_difference = 0.0;

    void add(const Sums& row)
    {
        pixels += row.pixels;
        black_pixels += row.black_pixels;
        squared += row.squared;
        smallest = glm::min(smallest, row.smallest);
        largest = glm::max(largest, row.largest);
        relative_squared += row.relative_squared;
        relative_absolute += row.relative_absolute;
        max_difference = std::max(max_difference, row.max_difference);
    }
};

bool isFinite(const Rgb& c)
{
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}

void requireFinite(const Rgb& c, const char* image, int x, int y)
{
    if (!isFinite(c))
        throw InputError(image, fmt::format("pixel ({}, {})", x, y), "is not a finite colour");
}

void addPixel(Sums& sums, const Rgb& reference, const Rgb& picture)
{
    const glm::dvec3 expected(reference);
    const glm::dvec3 actual(picture);
    const glm::dvec3 difference = actual - expected;
    ++sums.pixels;
    sums.squared += difference * difference;
    sums.smallest = glm::min(sums.smallest, glm::min(expected, actual));
    sums.largest = glm::max(sums.largest, glm::max(expected, actual));
    for (int c = 0; c < 3; ++c)
        sums.max_difference = std::max(sums.max_difference, std::abs(difference[c]));
    const double reference_luminance = luminance(reference);
    if (reference_luminance <= 0.0) {
        ++sums.black_pixels;
        return;
    }
    const double relative = (reference_luminance - luminance(picture)) / reference_luminance;
    sums.relative_squared += relative * relative;
    sums.relative_absolute += std::abs(relative);
}

Sums sumRow(const Image<Rgb>& reference, const Image<Rgb>& picture, const PixelMask& mask, int y)
{
    Sums sums;
    for (int x = 0; x < reference.width(); ++x) {
        if (!mask.empty() && mask(x, y) == 0) continue;
        requireFinite(reference(x, y), "reference", x, y);
        requireFinite(picture(x, y), "picture", x, y);
        addPixel(sums, reference(x, y), picture(x, y));
    }
    return sums;
}

ErrorMetrics metricsFromSums(const Sums& sums)
{
    ErrorMetrics metrics;
    metrics.pixels = sums.pixels;
    metrics.black_pixels = sums.black_pixels;
    metrics.max_difference = sums.max_difference;
    metrics.rmse = glm::sqrt(sums.squared / static_cast<double>(sums.pixels));
    metrics.range = sums.largest - sums.smallest;
    for (int c = 0; c < 3; ++c)
        if (metrics.range[c] > 0.0) metrics.nrmse_channels[c] = metrics.rmse[c] / metrics.range[c];
    metrics.nrmse =
        (metrics.nrmse_channels.x + metrics.nrmse_channels.y + metrics.nrmse_channels.z) / 3.0;
    const auto relative_pixels = static_cast<double>(sums.pixels - sums.black_pixels);
    if (relative_pixels > 0.0) {
        metrics.rms_percent = 100.0 * std::sqrt(sums.relative_squared / relative_pixels);
        metrics.mean_percent = 100.0 * sums.relative_absolute / relative_pixels;
    }
    return metrics;
}

void checkMask(const PixelMask& mask, int width, int height)
{
    INSITU_CHECK(mask.empty() || (mask.width() == width && mask.height() == height),
                 "mask {}x{}, images {}x{}",
                 mask.width(),
                 mask.height(),
                 width,
                 height);
}

}  // namespace

std::optional<ErrorMetrics> compareImages(const Image<Rgb>& reference,
                                          const Image<Rgb>& picture,
                                          const PixelMask& mask)
{
    INSITU_CHECK(reference.sameSize(picture),
                 "{}x{} and {}x{}",
                 reference.width(),
                 reference.height(),
                 picture.width(),
                 picture.height());
    checkMask(mask, reference.width(), reference.height());
    std::vector<Sums> rows(static_cast<std::size_t>(reference.height()));
    parallelFor(0, reference.height(), [&](std::int64_t y) {
        rows[static_cast<std::size_t>(y)] = sumRow(reference, picture, mask, static_cast<int>(y));
    });
    Sums total;
    for (const Sums& row : rows)
        total.add(row);
    if (total.pixels == 0) return std::nullopt;
    return metricsFromSums(total);
}

CodeDifference compareCodes(const EncodedImage& reference,
                            const EncodedImage& picture,
                            const PixelMask& mask)
{
    INSITU_CHECK(reference.codes.sameSize(picture.codes) && reference.max_code == picture.max_code,
                 "{}x{} to {}, {}x{} to {}",
                 reference.codes.width(),
                 reference.codes.height(),
                 reference.max_code,
                 picture.codes.width(),
                 picture.codes.height(),
                 picture.max_code);
    checkMask(mask, reference.codes.width(), reference.codes.height());
    CodeDifference result;
    for (std::size_t i = 0; i < reference.codes.pixelCount(); ++i) {
        if (!mask.empty() && mask.pixels()[i] == 0) continue;
        ++result.pixels;
        const glm::ivec3 difference = glm::abs(glm::ivec3(picture.codes.pixels()[i]) -
                                               glm::ivec3(reference.codes.pixels()[i]));
        const int largest = std::max({difference.x, difference.y, difference.z});
        if (largest > 0) ++result.differing_pixels;
        result.max_codes = std::max(result.max_codes, largest);
    }
    return result;
}

Image<Rgb> decodeSrgb(const EncodedImage& image)
{
    std::vector<float> linear(static_cast<std::size_t>(image.max_code) + 1);
    for (std::size_t code = 0; code < linear.size(); ++code)
        linear[code] = static_cast<float>(
            linearFromSrgb(static_cast<double>(code) / static_cast<double>(image.max_code)));
    Image<Rgb> result(image.codes.width(), image.codes.height());
    for (std::size_t i = 0; i < result.pixelCount(); ++i) {
        const glm::u16vec3 codes = image.codes.pixels()[i];
        for (int c = 0; c < 3; ++c) {
            INSITU_CHECK(codes[c] <= image.max_code, "code {} of {}", codes[c], image.max_code);
            result.pixels()[i][c] = linear[codes[c]];
        }
    }
    return result;
}

}  // namespace insitu
