#pragma once

#include "core/photo.h"

#include <cstdint>
#include <span>
#include <vector>

namespace insitu {

/// Reads what we need from a raw EXIF block ("Exif\0\0…" or a bare TIFF header); `width` and
/// `height` are those of the stored pixels. Damaged or absent tags are left unknown; rationals with
/// a zero denominator count as absent. Never throws.
///
/// Exposure time and f-number fall back to the APEX values (t = 2^-Tv, N = 2^(Av/2), EXIF 2.32
/// annex C). focal_px = focal_mm · focal-plane resolution per mm, scaled by the image's long side
/// over the one in EXIF (a reduced picture keeps the camera's figures), when the sensor's long side
/// that follows is between 2 and 100 mm; else focal_35mm / 36 mm · the image's long side. The
/// latter is right for 3:2 sensors; makers who equate diagonals are off by up to 4 % for 4:3.
[[nodiscard]] PhotoMetadata parseExif(std::span<const std::uint8_t> block, int width, int height);

/// A raw EXIF block ("Exif\0\0", big-endian, orientation 1) with exposure, focal length, make and
/// model: for simulated photographs. With focal_mm and focal_px both given it holds the focal-plane
/// resolution that reproduces focal_px. Unknown values are left out.
[[nodiscard]] std::vector<std::uint8_t> makeExif(const PhotoMetadata& metadata);

/// The block with its orientation tag, if any, set to 1: for pixels that were turned upright.
[[nodiscard]] std::vector<std::uint8_t> uprightExif(std::vector<std::uint8_t> block);

}  // namespace insitu
