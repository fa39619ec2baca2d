#pragma once

#include "core/check.h"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace insitu {

/// The value that the share `q` in [0, 1] of the others lies below: element floor(q (n - 1)) in
/// order, not between two. Reorders the values, of which there must be one.
[[nodiscard]] inline double quantile(std::vector<double>& values, double q)
{
    INSITU_CHECK(!values.empty() && q >= 0.0 && q <= 1.0, "{} of {} values", q, values.size());
    const auto at =
        values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace insitu
