#pragma once

#include "core/photo.h"

#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// Reads what we need from a raw EXIF block ("Exif\0\0…" or a bare TIFF header). Damaged or absent
/// tags are left unknown; rationals with a zero denominator count as absent.
[[nodiscard]] PhotoMetadata parseExif(std::span<const std::uint8_t> block, int width, int height);

/// A raw EXIF block with exposure, focal length, make and model: for simulated photographs.
[[nodiscard]] std::vector<std::uint8_t> makeExif(const PhotoMetadata& metadata);

}  // namespace insitu
