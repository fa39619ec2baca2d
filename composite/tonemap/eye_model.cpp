#include "composite/tonemap/eye_model.h"

#include "core/color.h"

#include <algorithm>
#include <cmath>

namespace insitu {

double justNoticeableDifference(double luminance)
{
    const double log = std::log10(std::max(luminance, 1e-12));
    double log_threshold = 0.0;
    if (log < -3.94)
        log_threshold = -2.86;
    else if (log < -1.44)
        log_threshold = std::pow(0.405 * log + 1.6, 2.18) - 2.86;
    else if (log < -0.0184)
        log_threshold = log - 0.395;
    else if (log < 1.9)
        log_threshold = std::pow(0.249 * log + 0.65, 2.7) - 0.72;
    else
        log_threshold = log - 1.255;
    return std::pow(10.0, log_threshold);
}

double acuity(double luminance)
{
    const double log = std::log10(std::max(luminance, 1e-12));
    return std::max(1.0, 17.25 * std::atan(1.4 * log + 0.35) + 25.72);
}

double scotopicLuminance(const Rgb& color)
{
    // Rec. 709 to CIE XYZ (ITU-R BT.709-6 primaries, D65).
    const double x = 0.4124 * color.r + 0.3576 * color.g + 0.1805 * color.b;
    const double y = static_cast<double>(luminance(color));
    const double z = 0.0193 * color.r + 0.1192 * color.g + 0.9505 * color.b;
    return x > 0.0 ? std::max(0.0, y * (1.33 * (1.0 + (y + z) / x) - 1.68)) : 0.0;
}

double coneShare(double luminance)
{
    constexpr double kBottom = 0.0056;
    constexpr double kTop = 5.6;
    return std::clamp((luminance - kBottom) / (kTop - kBottom), 0.0, 1.0);
}

}  // namespace insitu
