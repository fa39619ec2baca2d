#include "core/io/ply_parser.h"

#include "core/check.h"

#include <array>
#include <bit>
#include <charconv>

namespace insitu {

namespace {

using Words = std::vector<std::string_view>;

class HeaderParser {
public:
    HeaderParser(std::string_view bytes, const std::string& path) : bytes_(bytes), path_(path) {}

    PlyHeader parse()
    {
        if (takeLine() != Words{"ply"}) fail("no PLY: the first line is not 'ply'");
        for (;;) {
            const Words words = takeLine();
            if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
            if (words[0] == "end_header") break;
            if (words[0] == "format")
                parseFormat(words);
            else if (words[0] == "element")
                parseElement(words);
            else if (words[0] == "property")
                parseProperty(words);
            else
                fail(fmt::format("'{}' is no statement of a header", words[0]));
        }
        if (!has_format_) fail("no 'format' line");
        header_.body = at_;
        return std::move(header_);
    }

private:
    [[noreturn]] void fail(const std::string& cause) const
    {
        throw InputError(path_, fmt::format("line {}", line_), cause);
    }

    Words takeLine()
    {
        ++line_;
        const std::size_t end = bytes_.find('\n', at_);
        if (end == std::string_view::npos) fail("the header does not end");
        Words words;
        std::string_view rest = bytes_.substr(at_, end - at_);
        at_ = end + 1;
        constexpr std::string_view kBlanks = " \t\r";
        while (true) {
            const std::size_t first = rest.find_first_not_of(kBlanks);
            if (first == std::string_view::npos) return words;
            rest.remove_prefix(first);
            const std::size_t length = std::min(rest.find_first_of(kBlanks), rest.size());
            words.push_back(rest.substr(0, length));
            rest.remove_prefix(length);
        }
    }

    void parseFormat(const Words& words)
    {
        if (words.size() != 3 || words[2] != "1.0") fail("only PLY 1.0 is read");
        header_.text = words[1] == "ascii";
        header_.order = words[1] == "binary_big_endian" ? ByteOrder::Big : ByteOrder::Little;
        if (!header_.text && words[1] != "binary_big_endian" && words[1] != "binary_little_endian")
            fail(fmt::format("unknown format '{}'", words[1]));
        has_format_ = true;
    }

    void parseElement(const Words& words)
    {
        if (words.size() != 3) fail("an element needs a name and a count");
        PlyElement element;
        element.name = words[1];
        const char* end = words[2].data() + words[2].size();
        const auto parsed = std::from_chars(words[2].data(), end, element.count);
        if (parsed.ec != std::errc{} || parsed.ptr != end)
            fail(fmt::format("'{}' is no count", words[2]));
        header_.elements.push_back(std::move(element));
    }

    void parseProperty(const Words& words)
    {
        if (header_.elements.empty()) fail("a property before any element");
        const bool is_list = words.size() == 5 && words[1] == "list";
        if (!is_list && words.size() != 3) fail("a property needs a type and a name");
        PlyProperty property;
        property.is_list = is_list;
        property.name = words.back();
        property.type = typeOf(words[words.size() - 2]);
        if (is_list) property.count_type = typeOf(words[2]);
        header_.elements.back().properties.push_back(std::move(property));
    }

    PlyType typeOf(std::string_view name) const
    {
        struct Name {
            std::string_view name;
            PlyType type;
        };
        static constexpr std::array<Name, 16> kNames = {{{"char", PlyType::Int8},
                                                         {"int8", PlyType::Int8},
                                                         {"uchar", PlyType::Uint8},
                                                         {"uint8", PlyType::Uint8},
                                                         {"short", PlyType::Int16},
                                                         {"int16", PlyType::Int16},
                                                         {"ushort", PlyType::Uint16},
                                                         {"uint16", PlyType::Uint16},
                                                         {"int", PlyType::Int32},
                                                         {"int32", PlyType::Int32},
                                                         {"uint", PlyType::Uint32},
                                                         {"uint32", PlyType::Uint32},
                                                         {"float", PlyType::Float},
                                                         {"float32", PlyType::Float},
                                                         {"double", PlyType::Double},
                                                         {"float64", PlyType::Double}}};
        for (const Name& known : kNames)
            if (known.name == name) return known.type;
        fail(fmt::format("'{}' is no type", name));
    }

    std::string_view bytes_;
    const std::string& path_;
    PlyHeader header_;
    std::size_t at_ = 0;
    std::size_t line_ = 0;
    bool has_format_ = false;
};

}  // namespace

PlyHeader parsePlyHeader(std::string_view bytes, const std::string& path)
{
    return HeaderParser(bytes, path).parse();
}

PlyValues::PlyValues(std::span<const std::uint8_t> bytes,
                     const PlyHeader& header,
                     const std::string& path)
    : view_(bytes, path, header.order),
      order_(header.order),
      text_(header.text),
      at_(header.body),
      rest_(reinterpret_cast<const char*>(bytes.data()), bytes.size())
{
    rest_.remove_prefix(header.body);
}

double PlyValues::nextWord()
{
    const std::size_t first = rest_.find_first_not_of(" \t\r\n");
    if (first == std::string_view::npos)
        throw InputError(view_.path(), "the file ends early; it is damaged or incomplete");
    rest_.remove_prefix(first);
    const std::size_t length = std::min(rest_.find_first_of(" \t\r\n"), rest_.size());
    double value = 0.0;
    const auto parsed = std::from_chars(rest_.data(), rest_.data() + length, value);
    if (parsed.ec != std::errc{} || parsed.ptr != rest_.data() + length)
        throw InputError(
            view_.path(),
            fmt::format("'{}' is no number", rest_.substr(0, std::min<std::size_t>(length, 32))));
    rest_.remove_prefix(length);
    return value;
}

double PlyValues::nextBinary(PlyType type)
{
    const std::size_t at = at_;
    switch (type) {
        case PlyType::Int8:
            at_ += 1;
            return static_cast<std::int8_t>(view_.u8(at));
        case PlyType::Uint8:
            at_ += 1;
            return view_.u8(at);
        case PlyType::Int16:
            at_ += 2;
            return static_cast<std::int16_t>(view_.u16(at));
        case PlyType::Uint16:
            at_ += 2;
            return view_.u16(at);
        case PlyType::Int32:
            at_ += 4;
            return static_cast<std::int32_t>(view_.u32(at));
        case PlyType::Uint32:
            at_ += 4;
            return view_.u32(at);
        case PlyType::Float:
            at_ += 4;
            return std::bit_cast<float>(view_.u32(at));
        case PlyType::Double:
            break;
    }
    at_ += 8;
    const bool little = order_ == ByteOrder::Little;
    const std::uint64_t high = view_.u32(little ? at + 4 : at);
    const std::uint64_t low = view_.u32(little ? at : at + 4);
    return std::bit_cast<double>((high << 32) | low);
}

}  // namespace insitu
