#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// Draws indices in proportion to weights in constant time.
/// Source: [Walker77], built as in [Vose91], "A linear algorithm for generating random numbers with
/// a given distribution".
class AliasTable {
public:
    /// Weights are finite, >= 0, at least one is > 0 (LogicError otherwise).
    explicit AliasTable(std::span<const double> weights);

    struct Draw {
        std::size_t index = 0;
        /// What is left of u: again uniform in [0, 1), for use within the drawn item. A table of n
        /// items takes log2(n) bits from u and about as many for its own decision.
        double remapped = 0.0;
    };
    /// u in [0, 1).
    [[nodiscard]] Draw sample(double u) const;
    [[nodiscard]] double probability(std::size_t index) const { return probabilities_[index]; }
    [[nodiscard]] std::size_t size() const { return probabilities_.size(); }
    /// Sum of the weights as given.
    [[nodiscard]] double totalWeight() const { return total_weight_; }

private:
    /// One memory access a draw: large tables are read at random.
    struct Slot {
        double threshold = 1.0;  ///< share of the slot that keeps its own index
        std::uint32_t alias = 0;
    };
    std::vector<double> probabilities_;
    std::vector<Slot> slots_;
    double total_weight_ = 0.0;
};

}  // namespace insitu
