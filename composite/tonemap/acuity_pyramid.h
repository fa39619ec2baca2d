#pragma once

#include "composite/tonemap/scene_strip.h"
#include "core/image.h"

#include <vector>

namespace insitu::tonemap {

/// A picture at ever halved resolution, to be sampled at any level between. Private to this module.
/// Source: [Mollis04] 5.4, after [Ward97] 4.6.
class AcuityPyramid {
public:
    /// `levels` halvings, at least 0; the strip's rows must outlive the pyramid. Boxes of 2x2
    /// pixels, the last one of an odd size repeated. The strip begins at a multiple of 2^levels.
    AcuityPyramid(const SceneStrip& strip, int levels);

    /// Linear within the two levels about `level` and between them; level 0 is the pixel itself.
    /// What a level holds 2^(level + 1) rows around the pixel must lie in the strip, or beyond the
    /// scene.
    [[nodiscard]] Rgb sample(int x, int y, float level) const;

private:
    [[nodiscard]] SceneStrip at(int level) const;

    SceneStrip strip_;
    struct Level {
        Image<Rgb> rows;
        int first = 0;
        int height = 0;  ///< of the whole level
    };
    std::vector<Level> halved_;
};

}  // namespace insitu::tonemap
