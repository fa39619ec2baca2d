#pragma once

#include "core/photo.h"

#include <cstdint>
#include <filesystem>
#include <span>

namespace insitu {

/// Whether these bytes are a camera's RAW file: by content where the format has a signature of its
/// own (DNG, CR2, CR3, RAF, ORF, RW2), by the name's extension where it is a TIFF like any other
/// (NEF, ARW, PEF, SRW and others).
[[nodiscard]] bool isRawFile(std::span<const std::uint8_t> bytes,
                             const std::filesystem::path& path);

/// The sensor's own light, demosaiced: codes are linear, black subtracted, every channel saturates
/// at 65535, stored orientation (not upright yet).
///
/// White balance and the camera's primaries are in metadata.color: its matrix gives linear Rec. 709
/// in which the camera's white is white, and 1 is where the least amplified channel saturates.
/// Demosaicing (adaptive homogeneity-directed [HirPar05]) sees balanced channels. The saturation
/// level is the one that the file or LibRaw states for the camera, never the picture's own maximum:
/// exposures of a bracket stay comparable. InputError: damaged, unknown camera, four colours,
/// larger than `max_pixels` or than its bytes can hold.
[[nodiscard]] Photo readRaw(std::span<const std::uint8_t> bytes,
                            const std::filesystem::path& path,
                            std::int64_t max_pixels);

}  // namespace insitu
