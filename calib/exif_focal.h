#pragma once

#include "calib/orientation.h"
#include "core/photo.h"

#include <optional>

namespace insitu {

/// Focal length in pixels that a photograph's EXIF tells, with how far it can be trusted.
///
/// In this order: (1) PhotoMetadata::focal_px when it came from the focal-plane resolution, i.e.
/// when the 35 mm equivalent would have given another number; (2) FocalLength in millimetres when
/// FocalLengthIn35mmFilm is the same number rounded, since then the sensor is the 36 mm wide full
/// frame and the millimetres are the finer statement; (3) FocalLengthIn35mmFilm, an integer, as the
/// mean of the two conventions in use (equal width 36 mm, equal diagonal 43.27 mm).
///
/// sigma (of ln f) is the rounding of the number as written (uniform: one digit / √12), half the
/// difference of the two conventions, and 1 % for what a lens does otherwise (nominal values,
/// breathing with focus); 2 % in case (3), where makers add the rounding of their crop factor.
/// Nothing when EXIF tells no focal length. The picture must be uncropped; nothing in EXIF tells.
[[nodiscard]] std::optional<FocalPrior> focalFromExif(const PhotoMetadata& metadata,
                                                      int width,
                                                      int height);

}  // namespace insitu
