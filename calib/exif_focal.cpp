#include "calib/exif_focal.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr double kFilmWidthMm = 36.0;
constexpr double kFilmDiagonalMm = 43.2666153;  // √(36² + 24²)
constexpr double kLensShare = 0.01;
constexpr double kEquivalentShare = 0.02;

/// Standard deviation of a number rounded to the digits it shows: whole, tenths or finer.
double roundingSigma(double number)
{
    const auto isMultipleOf = [number](double digit) {
        return std::abs(number / digit - std::round(number / digit)) < 1e-6;
    };
    const double digit = isMultipleOf(1.0) ? 1.0 : isMultipleOf(0.1) ? 0.1 : 0.0;
    return digit / std::sqrt(12.0);
}

bool usable(const std::optional<double>& number)
{
    return number && std::isfinite(*number) && *number > 0.0;
}

/// 1 % of the lens and the rounding of the millimetres, when they are there.
double lensSigma(const std::optional<double>& focal_mm)
{
    return usable(focal_mm) ? std::hypot(roundingSigma(*focal_mm) / *focal_mm, kLensShare)
                            : kLensShare;
}

}  // namespace

std::optional<FocalPrior> focalFromExif(const PhotoMetadata& metadata, int width, int height)
{
    const double long_side = std::max(width, height);
    const bool has_film = usable(metadata.focal_35mm);
    const double by_width = has_film ? *metadata.focal_35mm / kFilmWidthMm * long_side : 0.0;
    if (usable(metadata.focal_px) && std::abs(*metadata.focal_px - by_width) > 1e-3 * by_width)
        return FocalPrior{*metadata.focal_px, lensSigma(metadata.focal_mm)};
    if (!has_film) return std::nullopt;
    const double film = *metadata.focal_35mm;
    if (usable(metadata.focal_mm) && std::abs(*metadata.focal_mm - film) <= 0.5)
        return FocalPrior{*metadata.focal_mm / kFilmWidthMm * long_side,
                          lensSigma(metadata.focal_mm)};
    const double by_diagonal = film / kFilmDiagonalMm * std::hypot(width, height);
    const double mean = 0.5 * (by_width + by_diagonal);
    return FocalPrior{
        mean,
        std::hypot(
            roundingSigma(film) / film, kEquivalentShare, 0.5 * (by_diagonal - by_width) / mean)};
}

}  // namespace insitu
