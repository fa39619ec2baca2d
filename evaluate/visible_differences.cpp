#include "evaluate/visible_differences.h"

#include "core/parallel.h"
#include "evaluate/cortex_transform.h"
#include "evaluate/picture_checks.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace insitu {

namespace {

// [Daly93] III.A: response L / (L + (c L)^b) of a cell adapted to L itself.
constexpr double kResponseScale = 12.6;
constexpr double kResponseExponent = 0.63;
// III.E: slope of the psychometric function.
constexpr double kPsychometricSlope = 3.5;
constexpr double kCertain = 0.95;

double response(double luminance)
{
    return luminance / (luminance + std::pow(kResponseScale * luminance, kResponseExponent));
}

/// d ln(response) / d ln(luminance).
double responseSlope(double luminance)
{
    const double noise = std::pow(kResponseScale * luminance, kResponseExponent);
    return (1.0 - kResponseExponent) * noise / (luminance + noise);
}

struct Spectrum {
    cv::Mat plane;  ///< complex: transform of reference + i picture
    double mean_response = 0.0;
    double mean_luminance = 0.0;
};

/// Responses of both pictures as one complex picture, mirrored to a size that transforms quickly.
Spectrum transform(const Image<float>& reference,
                   const Image<float>& picture,
                   const ViewingConditions& viewing)
{
    const auto paddedSize = [](int pixels) {
        return cv::getOptimalDFTSize(pixels + std::min(pixels, 64));
    };
    Spectrum spectrum;
    spectrum.plane.create(paddedSize(reference.height()), paddedSize(reference.width()), CV_32FC2);
    const auto luminanceOf = [&](float value) {
        return viewing.black_cd_m2 + (viewing.white_cd_m2 - viewing.black_cd_m2) *
                                         std::clamp(static_cast<double>(value), 0.0, 1.0);
    };
    // Half of what is added mirrors the last pixels and half, cyclically, the first.
    const auto mirrored = [](int i, int pixels, int padded) {
        if (i < pixels) return i;
        const int beyond = i - pixels;
        const int added = padded - pixels;
        const int at = beyond < added - beyond - 1 ? pixels - 1 - beyond : added - beyond - 1;
        return std::clamp(at, 0, pixels - 1);
    };
    for (int row = 0; row < spectrum.plane.rows; ++row) {
        const int y = mirrored(row, reference.height(), spectrum.plane.rows);
        for (int column = 0; column < spectrum.plane.cols; ++column) {
            const int x = mirrored(column, reference.width(), spectrum.plane.cols);
            const double l = luminanceOf(reference(x, y));
            const double r = response(l);
            spectrum.plane.at<cv::Vec2f>(row, column) = {
                static_cast<float>(r), static_cast<float>(response(luminanceOf(picture(x, y))))};
            if (row >= reference.height() || column >= reference.width()) continue;
            spectrum.mean_response += r;
            spectrum.mean_luminance += l;
        }
    }
    spectrum.mean_response /= static_cast<double>(reference.pixelCount());
    spectrum.mean_luminance /= static_cast<double>(reference.pixelCount());
    cv::dft(spectrum.plane, spectrum.plane);
    return spectrum;
}

/// Cycles per pixel of a transform's index.
double frequencyOf(int index, int size)
{
    return static_cast<double>(2 * index > size ? index - size : index) / size;
}

/// Contrasts in units of their threshold: the spectrum weighted with sensitivity.
void weighWithSensitivity(Spectrum& spectrum, double area_deg2, const ViewingConditions& viewing)
{
    const double unit = 1.0 / (spectrum.mean_response * responseSlope(spectrum.mean_luminance));
    parallelFor(0, spectrum.plane.rows, [&](std::int64_t i) {
        const int row = static_cast<int>(i);
        const double fy = frequencyOf(row, spectrum.plane.rows);
        for (int column = 0; column < spectrum.plane.cols; ++column) {
            const double fx = frequencyOf(column, spectrum.plane.cols);
            const double cycles = viewing.pixels_per_degree * std::hypot(fx, fy);
            const double sensitivity = cycles > 0.0 ? contrastSensitivity(cycles,
                                                                          std::atan2(fy, fx),
                                                                          spectrum.mean_luminance,
                                                                          area_deg2,
                                                                          viewing.distance_m)
                                                    : 0.0;
            spectrum.plane.at<cv::Vec2f>(row, column) *= static_cast<float>(unit * sensitivity);
        }
    });
}

/// A band of both pictures: real part the reference, imaginary the other. Filters are real and
/// symmetric, so the two stay apart.
cv::Mat bandOf(const cv::Mat& spectrum, int band)
{
    cv::Mat filtered(spectrum.size(), CV_32FC2);
    parallelFor(0, spectrum.rows, [&](std::int64_t i) {
        const int row = static_cast<int>(i);
        const double fy = frequencyOf(row, spectrum.rows);
        for (int column = 0; column < spectrum.cols; ++column)
            filtered.at<cv::Vec2f>(row, column) =
                spectrum.at<cv::Vec2f>(row, column) *
                static_cast<float>(
                    cortex::bandWeight(band, frequencyOf(column, spectrum.cols), fy));
    });
    cv::dft(filtered, filtered, cv::DFT_INVERSE | cv::DFT_SCALE);
    return filtered;
}

/// Multiplies what is left of "not seen" with this band's.
void addBand(const cv::Mat& band, Image<float>& unseen)
{
    parallelFor(0, unseen.height(), [&](std::int64_t i) {
        const int y = static_cast<int>(i);
        for (int x = 0; x < unseen.width(); ++x) {
            const cv::Vec2f both = band.at<cv::Vec2f>(y, x);
            const auto a = static_cast<double>(both[0]);
            const auto b = static_cast<double>(both[1]);
            const double mask = std::min(std::abs(a), std::abs(b));
            const double visible = std::abs(a - b) / thresholdElevation(mask);
            // At threshold half of the observers see it.
            unseen(x, y) *= static_cast<float>(std::exp2(-std::pow(visible, kPsychometricSlope)));
        }
    });
}

}  // namespace

double contrastSensitivity(double cycles_per_degree,
                           double orientation,
                           double luminance,
                           double area_deg2,
                           double distance_m)
{
    constexpr double kPeak = 250.0;
    constexpr double kScale = 0.9;
    constexpr double kOblique = 0.78;
    const double a = 0.801 * std::pow(1.0 + 0.7 / luminance, -0.2);
    const double b = 0.3 * std::pow(1.0 + 100.0 / luminance, 0.15);
    const auto shape = [&](double rho) {
        const double size =
            std::pow(std::pow(3.23 * std::pow(rho * rho * area_deg2, -0.3), 5.0) + 1.0, -0.2);
        const double x = kScale * rho;
        return size * a * x * std::exp(-b * x) * std::sqrt(1.0 + 0.06 * std::exp(b * x));
    };
    const double by_distance = 0.856 * std::pow(distance_m, 0.14);
    const double by_orientation =
        0.5 * (1.0 - kOblique) * std::cos(4.0 * orientation) + 0.5 * (1.0 + kOblique);
    return kPeak * std::min(shape(cycles_per_degree / (by_distance * by_orientation)),
                            shape(cycles_per_degree));
}

double thresholdElevation(double mask)
{
    // k1 = W^(1 - 1/(1 - Q)), k2 = W^(1/(1 - Q)) with W = 6 and Q = 0.7.
    static const double k1 = std::pow(6.0, -7.0 / 3.0);
    static const double k2 = std::pow(6.0, 10.0 / 3.0);
    constexpr double kSlope = 0.7;
    constexpr double kSharpness = 4.0;
    return std::pow(1.0 + std::pow(k1 * std::pow(k2 * mask, kSlope), kSharpness), 1.0 / kSharpness);
}

Findings ViewingConditions::validate() const
{
    Findings findings;
    const auto require = [&](bool good, const std::string& message) {
        if (!good) findings.push_back({Severity::Error, "viewing-conditions", message});
    };
    require(std::isfinite(pixels_per_degree) && pixels_per_degree > 0.0,
            fmt::format("{} pixels per degree; give a number above 0", pixels_per_degree));
    require(std::isfinite(distance_m) && distance_m > 0.0,
            fmt::format("a distance of {} m; give a number above 0", distance_m));
    require(std::isfinite(white_cd_m2) && black_cd_m2 > 0.0 && black_cd_m2 < white_cd_m2,
            fmt::format(
                "a display of {} to {} cd/m²; give 0 < black < white", black_cd_m2, white_cd_m2));
    return findings;
}

VisibleDifferences visibleDifferences(const Image<float>& reference,
                                      const Image<float>& picture,
                                      const ViewingConditions& viewing,
                                      Progress& progress)
{
    requireValid(viewing.validate(), "viewing conditions");
    requireComparable(reference, picture);
    if (reference.empty()) throw InputError("picture", "is empty");
    Spectrum spectrum = transform(reference, picture, viewing);
    const double area = static_cast<double>(reference.pixelCount()) /
                        (viewing.pixels_per_degree * viewing.pixels_per_degree);
    weighWithSensitivity(spectrum, area, viewing);
    VisibleDifferences result;
    result.probability = Image<float>(reference.width(), reference.height(), 1.0f);
    for (int band = 0; band < cortex::kBands; ++band) {
        progress.checkpoint();
        addBand(bandOf(spectrum.plane, band), result.probability);
        progress.report("visible differences", (band + 1.0) / cortex::kBands);
    }
    std::int64_t seen = 0;
    std::int64_t certain = 0;
    for (float& value : result.probability.pixels()) {
        value = 1.0f - value;
        if (static_cast<double>(value) > kSeenProbability) ++seen;
        if (static_cast<double>(value) > kCertain) ++certain;
    }
    const double percent = 100.0 / static_cast<double>(reference.pixelCount());
    result.percent_seen = percent * static_cast<double>(seen);
    result.percent_certain = percent * static_cast<double>(certain);
    return result;
}

}  // namespace insitu
