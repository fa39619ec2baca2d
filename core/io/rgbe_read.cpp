#include "core/io/encoded_header.h"
#include "core/io/radiance_formats.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace insitu {

namespace {

using Rgbe = std::array<std::uint8_t, 4>;

/// How far into a file its "#?RADIANCE" line may stand, after lines that do not belong there.
constexpr std::size_t kSignatureWithin = 400;
constexpr std::size_t kLongestLine = 4096;
constexpr int kMinRleWidth = 8;
constexpr int kMaxRleWidth = 0x7FFF;

struct Header {
    Rgb divisor{1.0f};  ///< product of EXPOSURE and COLORCORR lines
    bool xyz = false;
    /// The resolution line, e.g. "-Y 512 +X 768": which axis its first (slow) number runs along.
    bool slow_is_y = true;
    bool slow_reversed = false;  ///< true: slow axis runs against image order
    bool fast_reversed = false;
    int slow = 0;
    int fast = 0;
};

/// Reads lines and pixels in file order; every complaint names the byte.
class Reader {
public:
    Reader(std::span<const std::uint8_t> bytes, const std::string& name)
        : bytes_(bytes), name_(name)
    {
    }

    [[noreturn]] void fail(const std::string& cause) const
    {
        throw InputError(name_, fmt::format("byte {}", at_), cause);
    }
    [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
    [[nodiscard]] std::size_t at() const { return at_; }
    void goTo(std::size_t at) { at_ = at; }
    [[nodiscard]] std::uint8_t next()
    {
        if (at_ >= bytes_.size()) fail("the pixels end early; the file is damaged or incomplete");
        return bytes_[at_++];
    }
    [[nodiscard]] Rgbe nextPixel()
    {
        Rgbe pixel;
        for (std::uint8_t& byte : pixel)
            byte = next();
        return pixel;
    }
    /// The next line without its end.
    [[nodiscard]] std::string_view line()
    {
        const std::size_t begin = at_;
        while (at_ < bytes_.size() && bytes_[at_] != '\n') {
            if (at_ - begin > kLongestLine) fail("a header line is too long");
            ++at_;
        }
        if (at_ == bytes_.size()) fail("the header has no end");
        ++at_;
        return {reinterpret_cast<const char*>(bytes_.data()) + begin, at_ - 1 - begin};
    }

private:
    std::span<const std::uint8_t> bytes_;
    const std::string& name_;
    std::size_t at_ = 0;
};

std::string_view trimmed(std::string_view text)
{
    const auto begin = text.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

std::string_view nextWord(std::string_view& text)
{
    text = trimmed(text);
    const std::string_view word = text.substr(0, text.find_first_of(" \t"));
    text.remove_prefix(word.size());
    return word;
}

template <class Number>
std::optional<Number> parseNumber(std::string_view word)
{
    Number value{};
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty() || result.ec != std::errc() || result.ptr != word.data() + word.size())
        return std::nullopt;
    return value;
}

float positiveFactor(Reader& reader, std::string_view& words)
{
    const auto value = parseNumber<float>(nextWord(words));
    if (!value || !std::isfinite(*value) || *value <= 0.0f)
        reader.fail("EXPOSURE or COLORCORR is not a positive number");
    return *value;
}

void readVariable(Reader& reader, std::string_view line, Header& header)
{
    const auto equals = line.find('=');
    if (equals == std::string_view::npos || line.front() == '#') return;
    const std::string_view key = trimmed(line.substr(0, equals));
    std::string_view value = trimmed(line.substr(equals + 1));
    if (key == "EXPOSURE") {
        header.divisor *= positiveFactor(reader, value);
    } else if (key == "COLORCORR") {
        for (int c = 0; c < 3; ++c)
            header.divisor[c] *= positiveFactor(reader, value);
    } else if (key == "FORMAT") {
        if (value != "32-bit_rle_rgbe" && value != "32-bit_rle_xyze")
            reader.fail(fmt::format("FORMAT is \"{}\", not 32-bit_rle_rgbe or _xyze", value));
        header.xyz = value == "32-bit_rle_xyze";
    }
}

/// "-Y h +X w" is the usual order; the axis named first is the slow one, and +Y runs upwards.
void readResolution(Reader& reader, std::string_view line, Header& header)
{
    const std::string_view slow_axis = nextWord(line);
    const auto slow = parseNumber<int>(nextWord(line));
    const std::string_view fast_axis = nextWord(line);
    const auto fast = parseNumber<int>(nextWord(line));
    header.slow_is_y = slow_axis == "-Y" || slow_axis == "+Y";
    const bool slow_is_x = slow_axis == "-X" || slow_axis == "+X";
    const bool fast_fits = header.slow_is_y ? fast_axis == "+X" || fast_axis == "-X"
                                            : fast_axis == "+Y" || fast_axis == "-Y";
    if (!(header.slow_is_y || slow_is_x) || !fast_fits || !slow || !fast)
        reader.fail("the line with the size is not like \"-Y 480 +X 640\"");
    header.slow = *slow;
    header.fast = *fast;
    header.slow_reversed = slow_axis == "+Y" || slow_axis == "-X";
    header.fast_reversed = fast_axis == "-X" || fast_axis == "+Y";
}

Header readHeader(Reader& reader)
{
    Header header;
    while (true) {
        const std::string_view line = reader.line();
        if (trimmed(line).empty()) break;
        readVariable(reader, line, header);
    }
    readResolution(reader, reader.line(), header);
    return header;
}

/// The scheme of 1989: a pixel (1, 1, 1, n) repeats the one before n times, further ones in a row
/// count in units of 256, 65536, …
void readOldScanline(Reader& reader, std::span<Rgbe> scanline, Rgbe first)
{
    std::size_t x = 0;
    int shift = 0;
    Rgbe pixel = first;
    while (true) {
        if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
            const std::size_t count = static_cast<std::size_t>(pixel[3]) << shift;
            if (x == 0 || count > scanline.size() - x) reader.fail("a run is longer than its row");
            std::fill_n(scanline.begin() + static_cast<std::ptrdiff_t>(x), count, scanline[x - 1]);
            x += count;
            shift = std::min(shift + 8, 24);
        } else {
            scanline[x++] = pixel;
            shift = 0;
        }
        if (x == scanline.size()) return;
        pixel = reader.nextPixel();
    }
}

/// The scheme since 1991: the four components one after the other, each in runs (byte > 128) and
/// literal stretches.
void readNewScanline(Reader& reader, std::span<Rgbe> scanline)
{
    for (std::size_t component = 0; component < 4; ++component) {
        std::size_t x = 0;
        while (x < scanline.size()) {
            const std::size_t code = reader.next();
            const bool run = code > 128;
            const std::size_t count = run ? code - 128 : code;
            if (count == 0 || count > scanline.size() - x)
                reader.fail(
                    "a run is empty or longer than its row; the file is damaged (for "
                    "example by a transfer in text mode)");
            const std::uint8_t value = run ? reader.next() : std::uint8_t{0};
            for (std::size_t i = 0; i < count; ++i)
                scanline[x++][component] = run ? value : reader.next();
        }
    }
}

void readScanline(Reader& reader, std::span<Rgbe> scanline)
{
    const Rgbe first = reader.nextPixel();
    const int width = static_cast<int>(scanline.size());
    const bool may_be_new = width >= kMinRleWidth && width <= kMaxRleWidth;
    if (may_be_new && first[0] == 2 && first[1] == 2 && first[2] < 128) {
        if ((first[2] << 8 | first[3]) != width) reader.fail("a row states another width");
        readNewScanline(reader, scanline);
    } else {
        readOldScanline(reader, scanline, first);
    }
}

Rgb colorOf(const Rgbe& pixel)
{
    if (pixel[3] == 0) return Rgb(0.0f);
    const float scale = std::ldexp(1.0f, static_cast<int>(pixel[3]) - 136);
    return Rgb(pixel[0], pixel[1], pixel[2]) * scale;
}

/// CIE XYZ to linear Rec. 709 (ITU-R BT.709-6 primaries, D65), inverse of IEC 61966-2-1's matrix.
Rgb rgbFromXyz(const Rgb& xyz)
{
    return {3.2406255f * xyz.x - 1.5372080f * xyz.y - 0.4986286f * xyz.z,
            -0.9689307f * xyz.x + 1.8757561f * xyz.y + 0.0415175f * xyz.z,
            0.0557101f * xyz.x - 0.2040211f * xyz.y + 1.0569959f * xyz.z};
}

void checkStorable(Reader& reader, const Header& header)
{
    const std::size_t longest = static_cast<std::size_t>(header.fast);
    // A row of the new scheme needs two bytes for 127 of each component, one of the old scheme two
    // pixels and a run for every 256-fold.
    const bool may_be_old = header.fast < kMinRleWidth || header.fast > kMaxRleWidth;
    const std::size_t row_bytes = may_be_old ? 4 : std::min<std::size_t>(8, longest * 4);
    if (reader.left() / row_bytes < static_cast<std::size_t>(header.slow))
        reader.fail(fmt::format("declares {} rows of {} pixels, which {} bytes cannot hold",
                                header.slow,
                                header.fast,
                                reader.left()));
}

/// Rows of variable length: where each begins is known once those before it have been read.
class RgbeRows : public RadianceRows {
public:
    RgbeRows(std::unique_ptr<MappedFile> file, const std::string& name, std::int64_t max_pixels)
        : file_(std::move(file)), name_(name), reader_(file_->bytes(), name_)
    {
        header_ = readHeader(reader_);
        checkImageSize(name_, header_.fast, header_.slow, max_pixels);
        checkStorable(reader_, header_);
        scanline_.resize(static_cast<std::size_t>(header_.fast));
        begins_.push_back(reader_.at());
    }
    [[nodiscard]] bool storedByRows() const { return header_.slow_is_y; }
    [[nodiscard]] int width() const override { return header_.fast; }
    [[nodiscard]] int height() const override { return header_.slow; }

    void read(int first, Image<Rgb>& rows) override
    {
        const int count = rows.height();
        for (int k = 0; k < count; ++k) {
            // In the file's own order, so that no row is looked for twice.
            const int i = header_.slow_reversed ? count - 1 - k : k;
            readStored(header_.slow_reversed ? header_.slow - 1 - first - i : first + i);
            for (int x = 0; x < header_.fast; ++x)
                rows(x, i) = colorAt(x);
        }
    }

    /// The whole picture of a file that stores it column by column.
    [[nodiscard]] Image<Rgb> readColumns()
    {
        Image<Rgb> image(header_.slow, header_.fast);
        for (int i = 0; i < header_.slow; ++i) {
            readStored(i);
            const int x = header_.slow_reversed ? header_.slow - 1 - i : i;
            for (int y = 0; y < header_.fast; ++y)
                image(x, y) = colorAt(y);
        }
        return image;
    }

private:
    /// Reads the i-th row of the file into scanline_.
    void readStored(int i)
    {
        auto known = static_cast<int>(begins_.size()) - 1;
        reader_.goTo(begins_[static_cast<std::size_t>(std::min(i, known))]);
        for (int row = std::min(i, known); row <= i; ++row) {
            readScanline(reader_, scanline_);
            if (row == known) {
                begins_.push_back(reader_.at());
                ++known;
            }
        }
    }
    /// Of the scanline read last, at a place of the picture.
    [[nodiscard]] Rgb colorAt(int place) const
    {
        const int j = header_.fast_reversed ? header_.fast - 1 - place : place;
        const Rgb stored = colorOf(scanline_[static_cast<std::size_t>(j)]) / header_.divisor;
        return header_.xyz ? rgbFromXyz(stored) : stored;
    }

    std::unique_ptr<MappedFile> file_;
    std::string name_;
    Reader reader_;
    Header header_;
    std::vector<Rgbe> scanline_;
    std::vector<std::size_t> begins_;  ///< byte of each row that has been reached
};

}  // namespace

bool isRgbe(std::span<const std::uint8_t> bytes)
{
    const std::string_view beginning(reinterpret_cast<const char*>(bytes.data()),
                                     std::min(bytes.size(), kSignatureWithin));
    const auto atLineStart = [&](std::string_view signature) {
        const auto at = beginning.find(signature);
        return at != std::string_view::npos && (at == 0 || beginning[at - 1] == '\n');
    };
    return atLineStart("#?RADIANCE") || atLineStart("#?RGBE");
}

std::unique_ptr<RadianceRows> openRgbe(std::unique_ptr<MappedFile> file,
                                       const std::string& name,
                                       std::int64_t max_pixels)
{
    auto rows = std::make_unique<RgbeRows>(std::move(file), name, max_pixels);
    if (rows->storedByRows()) return rows;
    return std::make_unique<ImageRows>(rows->readColumns());
}

}  // namespace insitu
