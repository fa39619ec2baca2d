#include "core/io/encoded_header.h"

#include "core/io/byte_view.h"
#include "core/io/icc_profile.h"
#include "core/io/zlib_bytes.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <string_view>

namespace insitu {

namespace {

using namespace std::string_view_literals;

constexpr int kMaxJpegScans = 500;
constexpr std::uint32_t kMaxTileSide = 16384;

/// Throws when `raw_bytes` of pixels cannot come out of `file_bytes`.
void checkPlausible(const std::string& path,
                    const EncodedHeader& header,
                    std::int64_t raw_bytes,
                    std::size_t file_bytes,
                    std::int64_t largest_ratio)
{
    if (raw_bytes / largest_ratio <= static_cast<std::int64_t>(file_bytes)) return;
    throw InputError(path,
                     fmt::format("declares {}x{} pixels, which cannot be stored in {} bytes; the "
                                 "file is damaged or made to exhaust memory",
                                 header.width,
                                 header.height,
                                 file_bytes));
}

// --- JPEG: ITU-T T.81 annex B -----------------------------------------------------------------

bool isStartOfFrame(int marker)
{
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

/// First position at or after `at` of a marker that ends entropy-coded data.
std::size_t skipEntropyCodedData(const ByteView& file, std::size_t at)
{
    while (file.contains(at, 2)) {
        const int next = file.u8(at + 1);
        const bool ends =
            file.u8(at) == 0xFF && next != 0x00 && next != 0xFF && !(next >= 0xD0 && next <= 0xD7);
        if (ends) return at;
        ++at;
    }
    throw InputError(
        file.path(),
        "the picture's data has no end marker; the file is incomplete (copy it again)");
}

/// Parts of an ICC profile by their number; each segment holds one [ICC10] annex B.4.
class JpegProfile {
public:
    /// `segment` is where the length stands.
    void add(const ByteView& file, std::size_t segment, std::size_t length)
    {
        constexpr std::size_t kHead = 2 + 12 + 2;  // length, name, number and count
        if (length < kHead) return;
        parts_[file.u8(segment + 14)] = file.slice(segment + kHead, length - kHead);
        count_ = file.u8(segment + 15);
    }

    /// Nothing when a part is missing.
    [[nodiscard]] std::vector<std::uint8_t> whole() const
    {
        std::vector<std::uint8_t> profile;
        if (parts_.size() != count_ || parts_.empty() || parts_.begin()->first != 1) return profile;
        for (const auto& [number, part] : parts_)
            profile.insert(profile.end(), part.begin(), part.end());
        return profile;
    }

private:
    std::map<int, std::span<const std::uint8_t>> parts_;
    std::size_t count_ = 0;
};

void readStartOfFrame(const ByteView& file, std::size_t segment, EncodedHeader& header)
{
    header.bits = file.u8(segment + 2);
    header.height = file.u16(segment + 3);
    header.width = file.u16(segment + 5);
    header.channels = file.u8(segment + 7);
}

EncodedHeader parseJpeg(const ByteView& file)
{
    EncodedHeader header;
    header.format = EncodedHeader::Format::Jpeg;
    JpegProfile profile;
    int scans = 0;
    std::size_t at = 2;
    while (true) {
        // Any number of 0xFF may precede a marker; decoders skip stray bytes before them too.
        while (file.u8(at) != 0xFF || file.u8(at + 1) == 0xFF || file.u8(at + 1) == 0x00)
            ++at;
        const int marker = file.u8(at + 1);
        at += 2;
        if (marker == 0xD9) break;
        if (marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) continue;
        const std::size_t length = file.u16(at);
        if (length < 2) throw InputError(file.path(), fmt::format("byte {}", at), "bad segment");
        (void)file.slice(at, length);
        if (isStartOfFrame(marker)) readStartOfFrame(file, at, header);
        if (marker == 0xE1 && file.startsWith("Exif\0\0"sv, at + 2) && header.exif.empty()) {
            const auto block = file.slice(at + 2, length - 2);
            header.exif.assign(block.begin(), block.end());
        }
        if (marker == 0xE2 && file.startsWith("ICC_PROFILE\0"sv, at + 2)) {
            header.has_icc_profile = true;
            profile.add(file, at, length);
        }
        at += length;
        if (marker == 0xDA) {
            if (++scans > kMaxJpegScans)
                throw InputError(file.path(),
                                 fmt::format("has more than {} scans; a photograph has at most a "
                                             "dozen",
                                             kMaxJpegScans));
            at = skipEntropyCodedData(file, at);
        }
    }
    if (scans == 0) throw InputError(file.path(), "is a JPEG without a picture in it");
    header.icc = profile.whole();
    return header;
}

// --- PNG: ISO/IEC 15948 -----------------------------------------------------------------------

int pngChannels(int color_type)
{
    switch (color_type) {
        case 0:  // grey
        case 3:  // palette
            return 1;
        case 4:  // grey and alpha
            return 2;
        case 2:  // colour
            return 3;
        default:
            return 4;
    }
}

/// The profile of an iCCP chunk: a name, a zero, the method, a zlib stream.
std::vector<std::uint8_t> pngProfile(std::span<const std::uint8_t> chunk)
{
    const auto name_end = std::ranges::find(chunk, 0);
    const auto head = static_cast<std::size_t>(name_end - chunk.begin()) + 2;
    if (head > chunk.size()) return {};
    return inflated(chunk.subspan(head), kMaxIccBytes).value_or(std::vector<std::uint8_t>{});
}

EncodedHeader parsePng(const ByteView& file)
{
    EncodedHeader header;
    header.format = EncodedHeader::Format::Png;
    if (!file.startsWith("IHDR"sv, 12))
        throw InputError(file.path(), "is a PNG that does not begin with its header");
    const std::uint32_t width = file.u32(16);
    const std::uint32_t height = file.u32(20);
    constexpr std::uint32_t kLargest = std::numeric_limits<std::int32_t>::max();
    header.width = static_cast<int>(std::min(width, kLargest));
    header.height = static_cast<int>(std::min(height, kLargest));
    header.bits = file.u8(24);
    header.channels = pngChannels(file.u8(25));
    std::size_t at = 8;
    while (file.contains(at, 8)) {
        const std::size_t length = file.u32(at);
        if (file.startsWith("iCCP"sv, at + 4) && !header.has_icc_profile) {
            header.has_icc_profile = true;
            if (file.contains(at + 8, length)) header.icc = pngProfile(file.slice(at + 8, length));
        }
        if (file.startsWith("eXIf"sv, at + 4) && file.contains(at + 8, length)) {
            constexpr std::array<std::uint8_t, 6> kPrefix = {'E', 'x', 'i', 'f', 0, 0};
            const auto block = file.slice(at + 8, length);
            header.exif.assign(kPrefix.begin(), kPrefix.end());
            header.exif.insert(header.exif.end(), block.begin(), block.end());
        }
        at += 12 + length;
    }
    return header;
}

// --- TIFF 6.0, section 2 ----------------------------------------------------------------------

struct TiffTags {
    std::uint32_t tile_width = 0;
    std::uint32_t tile_height = 0;
    std::uint32_t sample_format = 1;
};

/// Value of a SHORT or LONG tag whose entry stands at `entry`; of several values, the first.
std::uint32_t tiffValue(const ByteView& file, std::size_t entry)
{
    const int type = file.u16(entry + 2);
    const std::uint32_t count = file.u32(entry + 4);
    const std::size_t size = type == 3 ? 2 : 4;
    const std::size_t at = count * size <= 4 ? entry + 8 : file.u32(entry + 8);
    return type == 3 ? file.u16(at) : file.u32(at);
}

void readTiffProfile(const ByteView& file, std::size_t entry, EncodedHeader& header)
{
    const std::size_t count = file.u32(entry + 4);
    const std::size_t at = file.u32(entry + 8);
    if (count > kMaxIccBytes || !file.contains(at, count)) return;
    const auto bytes = file.slice(at, count);
    header.icc.assign(bytes.begin(), bytes.end());
}

void readTiffEntry(const ByteView& file, std::size_t entry, EncodedHeader& header, TiffTags& tags)
{
    const auto clampedValue = [&] {
        return static_cast<int>(std::min<std::uint32_t>(tiffValue(file, entry), 1U << 30));
    };
    switch (file.u16(entry)) {
        case 256:
            header.width = clampedValue();
            break;
        case 257:
            header.height = clampedValue();
            break;
        case 258:
            header.bits = clampedValue();
            break;
        case 274:
            if (file.u16(entry + 2) == 3) header.orientation_offset = entry + 8;
            break;
        case 277:
            header.channels = clampedValue();
            break;
        case 322:
            tags.tile_width = tiffValue(file, entry);
            break;
        case 323:
            tags.tile_height = tiffValue(file, entry);
            break;
        case 339:
            tags.sample_format = tiffValue(file, entry);
            break;
        case 34675:
            header.has_icc_profile = true;
            readTiffProfile(file, entry, header);
            break;
        default:
            break;
    }
}

EncodedHeader parseTiff(const ByteView& file)
{
    EncodedHeader header;
    header.format = EncodedHeader::Format::Tiff;
    header.bits = 1;      // the defaults of TIFF 6.0
    header.channels = 1;  // the defaults of TIFF 6.0
    if (file.u16(2) != 42)
        throw InputError(file.path(), "is a BigTIFF; save it as an ordinary TIFF");
    TiffTags tags;
    const std::size_t directory = file.u32(4);
    const std::size_t entries = file.u16(directory);
    for (std::size_t i = 0; i < entries; ++i)
        readTiffEntry(file, directory + 2 + 12 * i, header, tags);
    if ((header.bits != 8 && header.bits != 16) || tags.sample_format != 1)
        throw InputError(file.path(),
                         fmt::format("is a TIFF with {} bits of sample format {}; 8 and 16 bit "
                                     "unsigned are read (save linear data as EXR)",
                                     header.bits,
                                     tags.sample_format));
    if (header.channels < 1 || header.channels > 4)
        throw InputError(file.path(), fmt::format("has {} channels", header.channels));
    if (tags.tile_width > kMaxTileSide || tags.tile_height > kMaxTileSide)
        throw InputError(
            file.path(),
            fmt::format("has tiles of {}x{} pixels", tags.tile_width, tags.tile_height));
    return header;
}

}  // namespace

const char* formatName(EncodedHeader::Format format)
{
    switch (format) {
        case EncodedHeader::Format::Jpeg:
            return "JPEG";
        case EncodedHeader::Format::Png:
            return "PNG";
        case EncodedHeader::Format::Tiff:
            return "TIFF";
    }
    return "image";
}

void checkImageSize(const std::string& path,
                    std::int64_t width,
                    std::int64_t height,
                    std::int64_t max_pixels)
{
    if (width <= 0 || height <= 0)
        throw InputError(path, fmt::format("declares an empty image ({}x{})", width, height));
    if (width > max_pixels / height)
        throw InputError(
            path,
            fmt::format("declares {}x{} pixels; at most {} are read", width, height, max_pixels));
}

EncodedHeader parseEncodedHeader(std::span<const std::uint8_t> bytes,
                                 const std::string& path,
                                 std::int64_t max_pixels)
{
    const ByteView big(bytes, path, ByteOrder::Big);
    EncodedHeader header;
    std::int64_t largest_ratio = 0;
    if (big.startsWith("\xFF\xD8\xFF"sv)) {
        header = parseJpeg(big);
        // An 8x8 block costs at least one bit (its DC code); arithmetic coding can do with less.
        largest_ratio = 16384;
    } else if (big.startsWith("\x89PNG\r\n\x1A\n"sv)) {
        header = parsePng(big);
        largest_ratio = 1032;  // deflate: 258 bytes in two bits
    } else if (big.startsWith("II"sv) || big.startsWith("MM"sv)) {
        const ByteOrder order = big.u8(0) == 'M' ? ByteOrder::Big : ByteOrder::Little;
        header = parseTiff(ByteView(bytes, path, order));
        largest_ratio = 4096;  // LZW: a string of at most 3838 bytes in 12 bits, and a margin
    } else {
        throw InputError(path, "is not a JPEG, PNG or TIFF image");
    }
    checkImageSize(path, header.width, header.height, max_pixels);
    const std::int64_t row_bits =
        static_cast<std::int64_t>(header.width) * header.bits * header.channels;
    checkPlausible(path, header, header.height * (row_bits / 8), bytes.size(), largest_ratio);
    return header;
}

}  // namespace insitu
