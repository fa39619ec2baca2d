#include "core/io/tiff_directory.h"

#include <algorithm>
#include <array>

namespace insitu {

namespace {

constexpr std::size_t kLargestValue = 4096;

/// Bytes of one value by type, and of the words whose order depends on the file; 0 = unknown type.
struct TypeSize {
    std::size_t value;
    std::size_t word;
};

TypeSize sizeOf(std::uint16_t type)
{
    // BYTE, ASCII, SHORT, LONG, RATIONAL, SBYTE, UNDEFINED, SSHORT, SLONG, SRATIONAL, FLOAT, DOUBLE
    constexpr std::array<TypeSize, 13> kSizes = {{{0, 0},
                                                  {1, 1},
                                                  {1, 1},
                                                  {2, 2},
                                                  {4, 4},
                                                  {8, 4},
                                                  {1, 1},
                                                  {1, 1},
                                                  {2, 2},
                                                  {4, 4},
                                                  {8, 4},
                                                  {4, 4},
                                                  {8, 8}}};
    return type < kSizes.size() ? kSizes[type] : kSizes[0];
}

}  // namespace

std::uint32_t integerValue(const TiffField& field)
{
    const std::size_t size = sizeOf(field.type).value;
    const bool integer = field.type == TiffField::kShort || field.type == TiffField::kLong;
    if (!integer || field.value.size() < size) return 0;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < size; ++i)
        value = value << 8 | field.value[i];
    return value;
}

std::size_t directorySize(const std::vector<TiffField>& fields)
{
    std::size_t size = 2 + 12 * fields.size() + 4;
    for (const TiffField& field : fields)
        if (field.value.size() > 4) size += (field.value.size() + 1) / 2 * 2;
    return size;
}

void appendDirectory(Bytes& tiff, const std::vector<TiffField>& fields)
{
    const std::size_t values_at = tiff.size() + 2 + 12 * fields.size() + 4;
    append16(tiff, static_cast<std::uint32_t>(fields.size()));
    Bytes values;
    for (const TiffField& field : fields) {
        append16(tiff, field.tag);
        append16(tiff, field.type);
        append32(tiff, field.count);
        Bytes value = field.value;
        if (value.size() <= 4) {
            value.resize(4, 0);
            append(tiff, value);
            continue;
        }
        if (value.size() % 2 == 1) value.push_back(0);
        append32(tiff, static_cast<std::uint32_t>(values_at + values.size()));
        append(values, value);
    }
    append32(tiff, 0);
    append(tiff, values);
}

std::vector<TiffField> readDirectory(const ByteView& tiff, std::size_t offset)
{
    std::vector<TiffField> fields;
    const std::size_t entries = tiff.u16(offset);
    for (std::size_t i = 0; i < entries; ++i) {
        const std::size_t entry = offset + 2 + 12 * i;
        TiffField field{tiff.u16(entry), tiff.u16(entry + 2), tiff.u32(entry + 4), {}};
        const TypeSize size = sizeOf(field.type);
        if (size.value == 0 || field.count > kLargestValue / size.value) continue;
        const std::size_t bytes = field.count * size.value;
        const std::size_t at = bytes <= 4 ? entry + 8 : tiff.u32(entry + 8);
        append(field.value, tiff.slice(at, bytes));
        if (tiff.order() == ByteOrder::Little)
            for (auto word = field.value.begin(); word != field.value.end();
                 word += static_cast<std::ptrdiff_t>(size.word))
                std::reverse(word, word + static_cast<std::ptrdiff_t>(size.word));
        fields.push_back(std::move(field));
    }
    return fields;
}

}  // namespace insitu
