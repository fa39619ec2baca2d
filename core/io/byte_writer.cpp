#include "core/io/byte_writer.h"

#include <algorithm>

namespace insitu {

void append(Bytes& to, std::span<const std::uint8_t> bytes)
{
    const std::size_t old_size = to.size();
    to.resize(old_size + bytes.size());
    std::copy(bytes.begin(), bytes.end(), to.begin() + static_cast<std::ptrdiff_t>(old_size));
}

void append(Bytes& to, std::string_view text)
{
    append(to, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

void append16(Bytes& to, std::uint32_t value)
{
    to.push_back(static_cast<std::uint8_t>((value >> 8) & 0xFF));
    to.push_back(static_cast<std::uint8_t>(value & 0xFF));
}

void append32(Bytes& to, std::uint32_t value)
{
    append16(to, value >> 16);
    append16(to, value & 0xFFFF);
}

}  // namespace insitu
