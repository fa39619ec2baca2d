#include "core/io/encoded_header.h"
#include "core/io/radiance_formats.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string_view>

namespace insitu {

namespace {

bool isSpace(std::uint8_t c)
{
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/// Next word of the header, at most 64 bytes; moves `at` past it.
std::string_view nextWord(std::span<const std::uint8_t> bytes, std::size_t& at)
{
    while (at < bytes.size() && isSpace(bytes[at]))
        ++at;
    const std::size_t begin = at;
    while (at < bytes.size() && !isSpace(bytes[at]) && at - begin < 64)
        ++at;
    return {reinterpret_cast<const char*>(bytes.data()) + begin, at - begin};
}

template <class Number>
Number parseNumber(std::string_view word, const std::string& name, const char* what)
{
    Number value{};
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty() || result.ec != std::errc() || result.ptr != word.data() + word.size())
        throw InputError(name, fmt::format("the PFM header has no valid {}", what));
    return value;
}

float floatAt(std::span<const std::uint8_t> bytes, std::size_t at, bool little)
{
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 4; ++i)
        word |= static_cast<std::uint32_t>(bytes[at + i]) << (8 * (little ? i : 3 - i));
    return std::bit_cast<float>(word);
}

struct PfmHeader {
    int width = 0;
    int height = 0;
    std::size_t channels = 3;
    std::size_t pixels_at = 0;  ///< byte
    bool little = true;
    float factor = 1.0f;

    [[nodiscard]] std::size_t rowBytes() const
    {
        return static_cast<std::size_t>(width) * channels * 4;
    }
};

class PfmRows : public RadianceRows {
public:
    PfmRows(std::unique_ptr<MappedFile> file, const PfmHeader& header)
        : file_(std::move(file)), header_(header)
    {
    }
    [[nodiscard]] int width() const override { return header_.width; }
    [[nodiscard]] int height() const override { return header_.height; }
    void read(int first, Image<Rgb>& rows) override
    {
        for (int i = 0; i < rows.height(); ++i) {
            const auto from_bottom = static_cast<std::size_t>(header_.height - 1 - first - i);
            std::size_t at = header_.pixels_at + from_bottom * header_.rowBytes();
            for (Rgb& pixel : rows.row(i))
                for (int c = 0; c < 3; ++c) {
                    pixel[c] = header_.factor * floatAt(file_->bytes(), at, header_.little);
                    if (header_.channels == 3 || c == 2) at += 4;
                }
        }
    }

private:
    std::unique_ptr<MappedFile> file_;
    PfmHeader header_;
};

}  // namespace

bool isPfm(std::span<const std::uint8_t> bytes)
{
    return bytes.size() >= 3 && bytes[0] == 'P' && (bytes[1] == 'F' || bytes[1] == 'f') &&
           isSpace(bytes[2]);
}

std::unique_ptr<RadianceRows> openPfm(std::unique_ptr<MappedFile> file,
                                      const std::string& name,
                                      std::int64_t max_pixels)
{
    const std::span<const std::uint8_t> bytes = file->bytes();
    PfmHeader header;
    header.channels = bytes[1] == 'F' ? 3 : 1;
    std::size_t at = 2;
    header.width = parseNumber<int>(nextWord(bytes, at), name, "width");
    header.height = parseNumber<int>(nextWord(bytes, at), name, "height");
    const double scale = parseNumber<double>(nextWord(bytes, at), name, "scale");
    if (!std::isfinite(scale) || scale == 0.0)
        throw InputError(name, "the PFM header has no valid scale");
    checkImageSize(name, header.width, header.height, max_pixels);
    header.pixels_at = at + 1;  // after the one white space
    const std::size_t needed = header.rowBytes() * static_cast<std::size_t>(header.height);
    if (header.pixels_at > bytes.size() || bytes.size() - header.pixels_at < needed)
        throw InputError(name,
                         fmt::format("declares {}x{} pixels, which need {} bytes; the file ends "
                                     "early",
                                     header.width,
                                     header.height,
                                     needed));
    header.little = scale < 0.0;
    header.factor = static_cast<float>(std::abs(scale));
    return std::make_unique<PfmRows>(std::move(file), header);
}

std::vector<std::uint8_t> encodePfm(const Image<Rgb>& image)
{
    const std::string header = fmt::format("PF\n{} {}\n-1.0\n", image.width(), image.height());
    std::vector<std::uint8_t> bytes(header.begin(), header.end());
    bytes.reserve(bytes.size() + image.pixelCount() * sizeof(Rgb));
    for (int y = image.height() - 1; y >= 0; --y)
        for (const Rgb& pixel : image.row(y))
            for (int c = 0; c < 3; ++c) {
                const auto word = std::bit_cast<std::uint32_t>(pixel[c]);
                for (int shift = 0; shift < 32; shift += 8)
                    bytes.push_back(static_cast<std::uint8_t>((word >> shift) & 0xFF));
            }
    return bytes;
}

}  // namespace insitu
