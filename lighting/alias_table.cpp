#include "lighting/alias_table.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {
constexpr double kOneBelow = 1.0 - 0x1p-53;  ///< the largest double below 1
}

AliasTable::AliasTable(std::span<const double> weights)
{
    INSITU_CHECK(weights.size() < 0xFFFFFFFFull, "{} weights", weights.size());
    for (std::size_t i = 0; i < weights.size(); ++i) {
        INSITU_CHECK(
            std::isfinite(weights[i]) && weights[i] >= 0.0, "weight {} is {}", i, weights[i]);
        total_weight_ += weights[i];
    }
    INSITU_CHECK(total_weight_ > 0.0 && std::isfinite(total_weight_),
                 "{} weights sum to {}",
                 weights.size(),
                 total_weight_);

    const std::size_t n = weights.size();
    probabilities_.resize(n);
    slots_.resize(n);
    std::vector<std::uint32_t> poor;
    std::vector<std::uint32_t> rich;
    std::vector<double> scaled(n);
    for (std::size_t i = 0; i < n; ++i) {
        probabilities_[i] = weights[i] / total_weight_;
        scaled[i] = probabilities_[i] * static_cast<double>(n);
        slots_[i].alias = static_cast<std::uint32_t>(i);
        (scaled[i] < 1.0 ? poor : rich).push_back(static_cast<std::uint32_t>(i));
    }

    // Fill each slot that has too little with the rest of one that has too much.
    while (!poor.empty() && !rich.empty()) {
        const std::uint32_t small = poor.back();
        const std::uint32_t large = rich.back();
        poor.pop_back();
        slots_[small] = {scaled[small], large};
        scaled[large] -= 1.0 - scaled[small];
        if (scaled[large] < 1.0) {
            rich.pop_back();
            poor.push_back(large);
        }
    }

    // Slots left among the poor differ from full by rounding only, unless they weigh nothing.
    const auto heaviest = static_cast<std::uint32_t>(
        std::max_element(weights.begin(), weights.end()) - weights.begin());
    for (const std::uint32_t slot : poor)
        if (weights[slot] == 0.0) slots_[slot] = {0.0, heaviest};
}

AliasTable::Draw AliasTable::sample(double u) const
{
    const double scaled = std::clamp(u, 0.0, kOneBelow) * static_cast<double>(size());
    const std::size_t slot = std::min(static_cast<std::size_t>(scaled), size() - 1);
    const double within = scaled - static_cast<double>(slot);
    const auto& [threshold, alias] = slots_[slot];
    const bool own = within < threshold;
    const double rest =
        own ? within / threshold : (within - threshold) / std::max(1.0 - threshold, 1e-300);
    return {own ? slot : alias, std::min(rest, kOneBelow)};
}

}  // namespace insitu
