#pragma once

#include "lighting/hidden_light.h"

#include <span>

namespace insitu {

/// How finely a picture of hidden light is summed.
struct HiddenPictureOptions {
    /// Side of the squares that are begun with, pixels; a power of two in [2, 64].
    int step = 8;
    /// Squares are cut until interpolation between their corners is off by no more than this at
    /// their middle and the middles of their edges, as a share of the irradiance without the
    /// object; what is interpolated is half as far apart. > 0.
    double max_error = 0.01;
    /// As in hiddenShares().
    float bias_texels = 0.0f;

    [[nodiscard]] Findings validate() const;
};

/// Irradiance that an object hides from the pixels of a picture that shows one plane: what is exact
/// for every pixel (hiddenIrradiance), summed for a part of them and interpolated in between. For
/// frames while an object is moved: shadows that are narrower than half a square may be missed.
///
/// places_local   width·height, row by row, of the pixels' centres; a linear function of these up
///                to perspective
/// Returns the share of the pixels that were summed. InputError for bad options. Same bytes for any
/// number of threads.
double hiddenIrradianceOfPicture(const ObjectLight& object,
                                 int width,
                                 int height,
                                 std::span<const glm::vec3> places_local,
                                 glm::vec3 unit_normal,
                                 const HiddenPictureOptions& options,
                                 std::span<Rgb> hidden);

}  // namespace insitu
