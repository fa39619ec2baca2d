#pragma once

#include "composite/tonemap/separable.h"

#include <vector>

namespace insitu::tonemap {

/// The local part of makeReinhardLocal(). Private to this module.
class ReinhardAdaptation : public LocalAdaptation {
public:
    explicit ReinhardAdaptation(double key);

    [[nodiscard]] int halo() const override;
    void adapt(const LuminancePatch& patch,
               const WantedBlocks& blocks,
               float* adapted) const override;

private:
    /// All pixels of [x0, x1) x [y0, y1).
    void adaptBox(
        const LuminancePatch& patch, int x0, int y0, int x1, int y1, float* adapted) const;

    double key_;
    /// One-sided weights by distance of every scale; their two-sided sum is 1.
    std::vector<std::vector<float>> taps_;
};

}  // namespace insitu::tonemap
