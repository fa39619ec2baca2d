#pragma once

#include "core/image.h"

#include <vector>

namespace insitu::tonemap {

/// A picture at ever halved resolution, to be sampled at any level between. Private to this module.
/// Source: [Mollis04] 5.4, after [Ward97] 4.6.
class AcuityPyramid {
public:
    /// `levels` halvings, at least 0; the scene must outlive the pyramid. Boxes of 2x2 pixels, the
    /// last one of an odd size repeated.
    AcuityPyramid(const Image<Rgb>& scene, int levels);

    /// Linear within the two levels about `level` and between them; level 0 is the pixel itself.
    [[nodiscard]] Rgb sample(int x, int y, float level) const;

private:
    [[nodiscard]] const Image<Rgb>& at(int level) const;

    const Image<Rgb>& scene_;
    std::vector<Image<Rgb>> halved_;
};

}  // namespace insitu::tonemap
