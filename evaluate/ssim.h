#pragma once

#include "core/image.h"

namespace insitu {

/// Structural similarity of two grey pictures.
struct StructuralSimilarity {
    double mean = 1.0;  ///< of `map`, 1 = the same
    Image<float> map;   ///< of each window that lies wholly inside; in [-1, 1]
};

/// Window of 11x11 pixels weighted with a Gaussian of standard deviation 1.5, K1 = 0.01, K2 = 0.03.
///
/// reference, picture   same size, at least 11x11; display-encoded grey
/// range                largest code, 255 or 1
/// Throws InputError when sizes differ, are too small, or a value is not finite.
/// Source: [Wang04] equations 13 to 17.
[[nodiscard]] StructuralSimilarity structuralSimilarity(const Image<float>& reference,
                                                        const Image<float>& picture,
                                                        double range);

/// sRGB-encoded luminance of display-linear colour, [0, 1]: what `structuralSimilarity` compares,
/// with range 1.
[[nodiscard]] Image<float> encodedGrey(const Image<Rgb>& display);

}  // namespace insitu
