#include "calib/exif_focal.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr double kFilmWidthMm = 36.0;
constexpr double kFilmDiagonalMm = 43.2666153;  // √(36² + 24²)
constexpr double kLensShare = 0.01;
constexpr double kEquivalentShare = 0.02;
constexpr double kUncertainShare = 0.03;

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

}  // namespace

std::optional<FocalPrior> focalFromExif(const PhotoMetadata& metadata, int width, int height)
{
    const double long_side = std::max(width, height);
    const bool has_mm = usable(metadata.focal_mm);
    if (usable(metadata.focal_35mm)) {
        const double film = *metadata.focal_35mm;
        if (has_mm && std::abs(*metadata.focal_mm - film) <= 0.5) {
            const double mm = *metadata.focal_mm;
            return FocalPrior{mm / kFilmWidthMm * long_side,
                              std::hypot(roundingSigma(mm) / mm, kLensShare)};
        }
        const double by_width = film / kFilmWidthMm * long_side;
        const double by_diagonal = film / kFilmDiagonalMm * std::hypot(width, height);
        const double mean = 0.5 * (by_width + by_diagonal);
        return FocalPrior{mean,
                          std::hypot(roundingSigma(film) / film,
                                     kEquivalentShare,
                                     0.5 * (by_diagonal - by_width) / mean)};
    }
    if (usable(metadata.focal_px)) return FocalPrior{*metadata.focal_px, kUncertainShare};
    return std::nullopt;
}

}  // namespace insitu
