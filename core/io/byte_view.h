#pragma once

#include "core/check.h"

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace insitu {

enum class ByteOrder { Big, Little };

/// Bounds-checked access to the bytes of one file: reading past the end is an InputError that
/// names the file and the byte, never undefined behaviour.
class ByteView {
public:
    ByteView(std::span<const std::uint8_t> bytes, std::string path, ByteOrder order)
        : bytes_(bytes), path_(std::move(path)), order_(order)
    {
    }

    [[nodiscard]] std::size_t size() const { return bytes_.size(); }
    [[nodiscard]] ByteOrder order() const { return order_; }
    [[nodiscard]] const std::string& path() const { return path_; }
    [[nodiscard]] bool contains(std::size_t offset, std::size_t count) const
    {
        return offset <= bytes_.size() && count <= bytes_.size() - offset;
    }

    [[nodiscard]] std::span<const std::uint8_t> slice(std::size_t offset, std::size_t count) const
    {
        if (!contains(offset, count)) {
            const std::string position = fmt::format("byte {}", bytes_.size());
            throw InputError(path_, position, "the file ends early; it is damaged or incomplete");
        }
        return bytes_.subspan(offset, count);
    }
    [[nodiscard]] std::uint8_t u8(std::size_t offset) const { return slice(offset, 1)[0]; }
    [[nodiscard]] std::uint16_t u16(std::size_t offset) const
    {
        const auto b = slice(offset, 2);
        const int value = order_ == ByteOrder::Big ? (b[0] << 8) | b[1] : (b[1] << 8) | b[0];
        return static_cast<std::uint16_t>(value);
    }
    [[nodiscard]] std::uint32_t u32(std::size_t offset) const
    {
        const std::uint32_t first = u16(offset);
        const std::uint32_t second = u16(offset + 2);
        return order_ == ByteOrder::Big ? (first << 16) | second : (second << 16) | first;
    }
    /// Whether the bytes at `offset` spell `text`; false past the end.
    [[nodiscard]] bool startsWith(std::string_view text, std::size_t offset = 0) const
    {
        if (!contains(offset, text.size())) return false;
        for (std::size_t i = 0; i < text.size(); ++i)
            if (bytes_[offset + i] != static_cast<std::uint8_t>(text[i])) return false;
        return true;
    }

private:
    std::span<const std::uint8_t> bytes_;
    std::string path_;
    ByteOrder order_;
};

}  // namespace insitu
