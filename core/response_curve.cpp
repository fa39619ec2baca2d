#include "core/response_curve.h"

#include "core/color.h"

#include <algorithm>
#include <cmath>

namespace insitu {

double ResponseCurve::decode(int channel, double code) const
{
    const auto& table = exposure[static_cast<std::size_t>(channel)];
    const double z = std::clamp(code, 0.0, 255.0);
    const std::size_t low = std::min<std::size_t>(static_cast<std::size_t>(z), 254);
    const double t = z - static_cast<double>(low);
    return table[low] + t * (table[low + 1] - table[low]);
}

double ResponseCurve::encode(int channel, double exposure_value) const
{
    const auto& table = exposure[static_cast<std::size_t>(channel)];
    if (!(exposure_value > table.front())) return 0.0;
    if (exposure_value >= table.back()) return 255.0;
    const auto above = std::upper_bound(table.begin(), table.end(), exposure_value);
    const std::size_t high = static_cast<std::size_t>(above - table.begin());
    const double span = table[high] - table[high - 1];
    return static_cast<double>(high - 1) + (exposure_value - table[high - 1]) / span;
}

ResponseCurve ResponseCurve::srgb()
{
    ResponseCurve curve;
    curve.source = "srgb";
    for (auto& table : curve.exposure)
        for (std::size_t z = 0; z < table.size(); ++z)
            table[z] = linearFromSrgb(static_cast<double>(z) / 255.0);
    return curve;
}

}  // namespace insitu
