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
/// annex C). focal_px = focal_mm · focal-plane resolution per mm · the image's long side / the long
/// side in EXIF (the resolution is that of the picture the camera took, which may have been reduced
/// since); only when EXIF states that side, the sensor's long side that follows is between 4 and
/// 100 mm, and it agrees with focal_35mm within 15 % if there is one. Else focal_35mm / 36 mm · the
/// image's long side: right for 3:2 sensors; makers who equate diagonals differ by 4 % for 4:3.
[[nodiscard]] PhotoMetadata parseExif(std::span<const std::uint8_t> block, int width, int height);

/// A raw EXIF block ("Exif\0\0", big-endian, orientation 1) with exposure, focal length, make and
/// model: for simulated photographs. With focal_mm, focal_px and the size of the image in pixels it
/// also holds the focal-plane resolution that reproduces focal_px. Unknown values are left out.
[[nodiscard]] std::vector<std::uint8_t> makeExif(const PhotoMetadata& metadata,
                                                 int width = 0,
                                                 int height = 0);

/// The EXIF facts of a TIFF file, which are strewn over it, as one block of the same form: make,
/// model, orientation and the EXIF directory without the maker's note. Empty when damaged.
[[nodiscard]] std::vector<std::uint8_t> exifOfTiff(std::span<const std::uint8_t> file);

/// The block with its orientation tag, if any, set to 1: for pixels that were turned upright.
[[nodiscard]] std::vector<std::uint8_t> uprightExif(std::vector<std::uint8_t> block);

}  // namespace insitu
