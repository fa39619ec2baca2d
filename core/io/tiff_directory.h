#pragma once

#include "core/io/byte_view.h"
#include "core/io/byte_writer.h"

#include <cstdint>
#include <vector>

namespace insitu {

/// One entry of a TIFF directory (TIFF 6.0, section 2) with its value in big-endian bytes.
struct TiffField {
    enum Type : std::uint16_t { kAscii = 2, kShort = 3, kLong = 4, kRational = 5, kUndefined = 7 };

    std::uint16_t tag = 0;
    std::uint16_t type = kUndefined;
    std::uint32_t count = 0;
    Bytes value;
};

/// The first value of a SHORT or LONG field, 0 for any other.
[[nodiscard]] std::uint32_t integerValue(const TiffField& field);

/// Bytes that a directory takes with the values it points to.
[[nodiscard]] std::size_t directorySize(const std::vector<TiffField>& fields);
/// Appends a big-endian directory, no further one following; `tiff` begins with the TIFF header,
/// from which offsets count. Fields must be in order of tag.
void appendDirectory(Bytes& tiff, const std::vector<TiffField>& fields);
/// The fields of the directory at `offset`, without those of unknown type or with more than 4 KiB.
/// InputError when it reaches past the end.
[[nodiscard]] std::vector<TiffField> readDirectory(const ByteView& tiff, std::size_t offset);

}  // namespace insitu
