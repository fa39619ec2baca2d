#pragma once

#include "composite/tonemap/scene_strip.h"
#include "core/image.h"

#include <vector>

namespace insitu::tonemap {

/// The picture as a grid of places that the fovea may rest on, and what scatters in the eye there.
/// Private to this module.

/// Weights of the pixels that each of some cells covers, along one axis.
struct CellCover {
    std::vector<int> first;
    std::vector<float> first_weight, last_weight;  ///< the pixels between count 1
    std::vector<int> last;
};

/// Mean colour of each square degree, seen with a horizontal field of `field_of_view` radians:
/// 2 tan(field / 2) / 0.01745 pixels wide, as high as the picture's shape asks, at least 1x1, never
/// finer than the picture. Means are exact: border pixels of a cell count with the part inside.
/// Source: [Mollis04] equation 5.1.
class FovealImage {
public:
    /// Of a scene of this size.
    FovealImage(int width, int height, double field_of_view);

    /// Adds the scene's strips, from the top, each row once.
    void add(const SceneStrip& strip);
    /// Complete once all rows have been added.
    [[nodiscard]] const Image<Rgb>& image() const { return image_; }

private:
    CellCover columns_, rows_;
    Image<Rgb> image_;
    /// Sums over the rows of the cells that the last strip ended in.
    std::vector<Rgb> open_line_;
    float open_weight_ = 0.0f;
};

/// The kernel of veiling luminance for foveal images of one size: cos(angle) / angle², the angle a
/// degree for each foveal pixel, below 90°, in the frequency plane. Of frames of one size it is
/// made once.
class VeilKernel {
public:
    VeilKernel(int width, int height);

    [[nodiscard]] bool isFor(const Image<Rgb>& foveal) const
    {
        return foveal.width() == weights_.width() && foveal.height() == weights_.height();
    }
    /// Veiling luminance at each place of a foveal image of this size: mean of all other places,
    /// weighted with the kernel.
    ///
    /// One kernel for all places, so the sum is a convolution: its cost hardly grows with the
    /// field. Linear perspective makes the outer pixels of a wide field smaller than a degree; the
    /// kernel leaves this aside, as [Mollis04] 5.3 does.
    /// Source: [Ward97] 4.4, with [Mollis04] 5.3's fixed kernel.
    [[nodiscard]] Image<Rgb> veil(const Image<Rgb>& foveal) const;

private:
    Image<float> spectrum_;  ///< real, since the kernel is even; padded
    Image<float> weights_;   ///< sum of the weights of all other places
};

/// Part of the light that scatters, K of [Ward97] 4.4.
constexpr float kScattered = 0.087f;

}  // namespace insitu::tonemap
