#pragma once

#include "composite/photo_layers.h"
#include "core/finding.h"
#include "core/photo.h"

#include <glm/glm.hpp>

#include <optional>
#include <vector>

namespace insitu {

/// A part of the photograph that stands before the objects, as somebody marked it.
struct ForegroundMark {
    std::vector<glm::dvec2> polygon_px;  ///< its outline (even-odd where it crosses itself), or
    Image<float> mask;                   ///< its coverage in [0, 1], of the photograph's size
    /// It hides objects that are farther from the camera than this, metres, > 0; without, all.
    std::optional<double> distance_m;
    /// Standard deviation of the blur of its edge, pixels, in [0, 100].
    double feather_px = 0.7;
    /// Half the side of the window in which the edge moves to one of the picture's, pixels, in
    /// [0, 200]; 0: it stays where it was marked.
    int refine_px = 0;

    /// Of the numbers.
    [[nodiscard]] Findings validate() const;
};

/// Coverage of every pixel by the mark, [0, 1]: exactly 0 and 1 farther from its edge than the
/// feather and the refinement reach. The refined edge follows from what the picture shows on both
/// sides of it, in light (sRGB codes), smoothed by a guided filter of the codes; its blur is the
/// picture's, the feather only what the refinement begins with. InputError: a
/// number out of range, not one of polygon and mask, fewer than three corners, a mask that is not
/// of the photograph's size. Source: [HeSunTan13] section 3.
[[nodiscard]] Image<float> foregroundCoverage(const ForegroundMark& mark,
                                              const EncodedImage& photo);

/// Puts the objects of the layers behind the foreground. With m its coverage and B what the pixel
/// would show without it, the pixel was m F + (1 - m) B and becomes
///   m F + (1 - m) (object + (1 - alpha) (B + change)),
/// which needs B only: it is taken from the pixels around that the foreground leaves free; m is
/// taken as large as it must be for F not to be negative. Where m = 1 the layers change nothing, so
/// that the photograph stays byte for byte: the layers have their blur already. `radiance` is the
/// photograph's, in the layers' unit.
void putBehindForeground(const Image<float>& coverage,
                         std::optional<double> distance_m,
                         const Image<Rgb>& radiance,
                         PhotoLayers& layers);

/// Guided filter of `input` in [0, 1] with a colour guide: where the guide is of one colour the
/// result is smooth, where it has an edge the result has it too. `epsilon`: variance of the guide
/// below which it counts as of one colour.
[[nodiscard]] Image<float> guidedFilter(const Image<Rgb>& guide,
                                        const Image<float>& input,
                                        int radius_px,
                                        double epsilon);

}  // namespace insitu
