#pragma once

#include "core/image.h"
#include "core/io/mapped_file.h"
#include "core/io/radiance_rows.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// The three formats of scene-linear images behind openRadianceRows and writeRadiance, which check
/// the values; here they come and go as stored. `name` is the file's, for messages.

[[nodiscard]] bool isExr(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::unique_ptr<RadianceRows> openExr(const std::filesystem::path& path,
                                                    std::int64_t max_pixels);
void writeExr(const std::filesystem::path& path, const Image<Rgb>& image, bool half);

/// Radiance RGBE: a value is mantissa · 2^(exponent − 136), the convention of most readers (the
/// original library adds half a step, at most 0.4 % more). [Ward91], and the Radiance file formats.
[[nodiscard]] bool isRgbe(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::unique_ptr<RadianceRows> openRgbe(std::unique_ptr<MappedFile> file,
                                                     const std::string& name,
                                                     std::int64_t max_pixels);
[[nodiscard]] std::vector<std::uint8_t> encodeRgbe(const Image<Rgb>& image);

/// Portable float map: "PF" (RGB) or "Pf" (grey), rows from the bottom.
[[nodiscard]] bool isPfm(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::unique_ptr<RadianceRows> openPfm(std::unique_ptr<MappedFile> file,
                                                    const std::string& name,
                                                    std::int64_t max_pixels);
[[nodiscard]] std::vector<std::uint8_t> encodePfm(const Image<Rgb>& image);

}  // namespace insitu
