#include "composite/intensity_transfers.h"

#include "core/check.h"

#include <algorithm>
#include <array>

namespace insitu {

std::vector<double> intensityTransfers(double radiance,
                                       std::span<const double> transfers,
                                       std::span<const std::uint8_t> in_first_set,
                                       const std::function<double(double radiance)>& encode)
{
    INSITU_CHECK(radiance >= 0.0 && transfers.size() == in_first_set.size(),
                 "radiance {}, {} sources in {} sets",
                 radiance,
                 transfers.size(),
                 in_first_set.size());
    std::array<double, 2> left = {radiance, radiance};
    std::array<double, 2> shown = {encode(radiance), encode(radiance)};
    std::vector<double> steps(transfers.size());
    for (std::size_t j = 0; j < transfers.size(); ++j) {
        const std::size_t set = in_first_set[j] != 0 ? 0 : 1;
        left[set] = std::max(0.0, left[set] - transfers[j]);
        const double after = encode(left[set]);
        steps[j] = shown[set] - after;
        shown[set] = after;
    }
    return steps;
}

}  // namespace insitu
