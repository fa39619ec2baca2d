#pragma once

#include "calib/orientation.h"
#include "core/photo.h"

#include <optional>

namespace insitu {

/// Focal length in pixels that a photograph's EXIF tells, with how far it can be trusted.
///
/// In this order: (1) FocalLength in millimetres when FocalLengthIn35mmFilm is the same number
/// rounded, since then the sensor is the 36 mm wide full frame and the millimetres are the finer
/// statement; (2) FocalLengthIn35mmFilm, an integer, as the mean of the two conventions in use
/// (equal width 36 mm, equal diagonal 43.27 mm); (3) PhotoMetadata::focal_px as it is.
///
/// sigma (of ln f) is the rounding of the number as written (uniform: one digit / √12), half the
/// difference of the two conventions, and 1 % for what a lens does otherwise: nominal values and
/// breathing with focus; 2 % when only the 35 mm equivalent is there, since makers derive it from
/// the nominal crop factor ([CIPA DCG-001] rounds it further).
/// Nothing when EXIF tells no focal length. The picture must be uncropped; nothing in EXIF tells.
[[nodiscard]] std::optional<FocalPrior> focalFromExif(const PhotoMetadata& metadata,
                                                      int width,
                                                      int height);

}  // namespace insitu
