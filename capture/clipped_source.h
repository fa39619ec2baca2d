#pragma once

#include "capture/hdr_merge.h"
#include "core/image.h"

namespace insitu {

/// The part of a merged picture that is only a lower bound: the radiance of the channels that are
/// clipped in every exposure, 0 elsewhere. A pixel counts as clipped when one of its channels is;
/// the others may well have been measured, and then their variance is not the square of their
/// radiance. Empty when nothing is clipped. In the unit of the picture, >= 0.
[[nodiscard]] Image<Rgb> clippedPart(const MergeResult& merged);

}  // namespace insitu
