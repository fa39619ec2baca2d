#pragma once

#include "core/io/byte_view.h"

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace insitu {

/// The two halves of a PLY file: what the header declares, and the numbers that follow.

enum class PlyType { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float, Double };

struct PlyProperty {
    std::string name;
    PlyType type = PlyType::Float;
    bool is_list = false;
    PlyType count_type = PlyType::Uint8;
};

struct PlyElement {
    std::string name;
    std::uint64_t count = 0;
    std::vector<PlyProperty> properties;
};

struct PlyHeader {
    bool text = true;
    ByteOrder order = ByteOrder::Little;
    std::vector<PlyElement> elements;
    std::size_t body = 0;  ///< first byte after the header
};

/// InputError names `path`, the line and the cause.
[[nodiscard]] PlyHeader parsePlyHeader(std::string_view bytes, const std::string& path);

/// The numbers after the header, one after the other; InputError when they run out.
class PlyValues {
public:
    PlyValues(std::span<const std::uint8_t> bytes,
              const PlyHeader& header,
              const std::string& path);

    [[nodiscard]] double next(PlyType type) { return text_ ? nextWord() : nextBinary(type); }

private:
    [[nodiscard]] double nextWord();
    [[nodiscard]] double nextBinary(PlyType type);

    ByteView view_;
    ByteOrder order_;
    bool text_;
    std::size_t at_;
    std::string_view rest_;
};

}  // namespace insitu
