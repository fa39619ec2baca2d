#include "capture/clipped_source.h"

#include <glm/glm.hpp>

namespace insitu {

Image<Rgb> clippedPart(const MergeResult& merged)
{
    // The merge gives a clipped channel the square of its radiance as variance; conversion to other
    // primaries mixes it with its neighbours'.
    constexpr float kUnknown = 0.25f;
    if (!(merged.clipped_fraction > 0.0)) return {};
    const Image<Rgb>& radiance = merged.radiance.pixels;
    Image<Rgb> clipped(radiance.width(), radiance.height(), Rgb(0.0f));
    for (std::size_t i = 0; i < clipped.pixelCount(); ++i) {
        if ((merged.validity.pixels()[i] & kMergeClipped) == 0) continue;
        const Rgb level = glm::max(radiance.pixels()[i], Rgb(0.0f));
        for (int c = 0; c < 3; ++c)
            if (merged.variance.pixels()[i][c] >= kUnknown * level[c] * level[c])
                clipped.pixels()[i][c] = level[c];
    }
    return clipped;
}

}  // namespace insitu
