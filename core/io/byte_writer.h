#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace insitu {

using Bytes = std::vector<std::uint8_t>;

void append(Bytes& to, std::span<const std::uint8_t> bytes);
void append(Bytes& to, std::string_view text);

/// Big-endian, as PNG, JPEG and our EXIF blocks want it.
void append16(Bytes& to, std::uint32_t value);
void append32(Bytes& to, std::uint32_t value);

}  // namespace insitu
