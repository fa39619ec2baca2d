#include "core/io/byte_writer.h"
#include "core/io/exif.h"
#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/io/image_path.h"
#include "core/io/zlib_bytes.h"
#include "core/parallel.h"

#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <array>
#include <fstream>
#include <span>
#include <string_view>

namespace insitu {

namespace {

using namespace std::string_view_literals;

template <class Code>
cv::Mat bgrFromRgb(const Image<glm::u16vec3>& codes)
{
    cv::Mat mat(codes.height(), codes.width(), CV_MAKETYPE(cv::DataType<Code>::depth, 3));
    parallelFor(0, codes.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        auto* to = mat.ptr<cv::Vec<Code, 3>>(y);
        for (const glm::u16vec3& from : codes.row(y)) {
            *to = cv::Vec<Code, 3>(
                static_cast<Code>(from.b), static_cast<Code>(from.g), static_cast<Code>(from.r));
            ++to;
        }
    });
    return mat;
}

Bytes encode(const std::string& path,
             const char* extension,
             const cv::Mat& mat,
             const std::vector<int>& parameters)
{
    Bytes bytes;
    bool done = false;
    try {
        done = cv::imencode(extension, mat, bytes, parameters);
    } catch (const std::exception& error) {
        throw InputError(path, fmt::format("cannot be encoded: {}", error.what()));
    }
    if (!done) throw InputError(path, "cannot be encoded");
    return bytes;
}

/// CRC-32 of ISO 3309, as PNG wants it (ISO/IEC 15948, annex D).
std::uint32_t crc32(std::span<const std::uint8_t> bytes)
{
    std::uint32_t crc = 0xFFFFFFFFU;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit)
            crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
    }
    return ~crc;
}

Bytes pngChunk(std::string_view type, std::span<const std::uint8_t> data)
{
    Bytes typed;
    append(typed, type);
    append(typed, data);
    Bytes chunk;
    append32(chunk, static_cast<std::uint32_t>(data.size()));
    append(chunk, typed);
    append32(chunk, crc32(typed));
    return chunk;
}

/// `bytes` with `inserted` at `at`.
Bytes withInserted(const Bytes& bytes, std::size_t at, const Bytes& inserted)
{
    Bytes result;
    append(result, std::span(bytes).first(at));
    append(result, inserted);
    append(result, std::span(bytes).subspan(at));
    return result;
}

/// The TIFF structure inside "Exif\0\0…".
std::span<const std::uint8_t> withoutPrefix(const Bytes& exif)
{
    constexpr std::size_t kPrefixSize = 6;
    const bool prefixed = exif.size() > kPrefixSize && exif[0] == 'E' && exif[1] == 'x';
    return std::span(exif).subspan(prefixed ? kPrefixSize : 0);
}

/// Either the profile or the claim to be sRGB: both would contradict each other.
Bytes pngColorChunk(const Bytes& icc)
{
    constexpr std::array<std::uint8_t, 1> kPerceptual = {0};
    if (icc.empty()) return pngChunk("sRGB", kPerceptual);
    Bytes data;
    append(data, "ICC profile\0\0"sv);  // name, then the only method there is
    append(data, deflated(icc));
    return pngChunk("iCCP", data);
}

Bytes withPngChunks(const Bytes& png, const Bytes& exif, const Bytes& icc)
{
    constexpr std::size_t kAfterHeader = 8 + 12 + 13;  // signature, then the IHDR chunk
    Bytes chunks = pngColorChunk(icc);
    if (!exif.empty()) append(chunks, pngChunk("eXIf", withoutPrefix(exif)));
    return withInserted(png, kAfterHeader, chunks);
}

constexpr std::size_t kLargestSegment = 65535 - 2;

/// The profile in as many segments as it needs [ICC10] annex B.4; nothing when it needs too many.
Bytes jpegProfile(const Bytes& icc)
{
    constexpr std::size_t kLargestPart = kLargestSegment - 14;  // name, number, count
    const std::size_t count = (icc.size() + kLargestPart - 1) / kLargestPart;
    Bytes segments;
    if (count > 255) return segments;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t from = i * kLargestPart;
        const auto part = std::span(icc).subspan(from, std::min(kLargestPart, icc.size() - from));
        append(segments, "\xFF\xE2"sv);
        append16(segments, static_cast<std::uint32_t>(part.size() + 16));
        append(segments, "ICC_PROFILE\0"sv);
        segments.push_back(static_cast<std::uint8_t>(i + 1));
        segments.push_back(static_cast<std::uint8_t>(count));
        append(segments, part);
    }
    return segments;
}

Bytes withJpegSegments(const Bytes& jpeg, const Bytes& exif, const Bytes& icc)
{
    Bytes segments;
    if (!exif.empty() && exif.size() <= kLargestSegment) {
        append(segments, "\xFF\xE1"sv);
        append16(segments, static_cast<std::uint32_t>(exif.size() + 2));
        append(segments, exif);
    }
    append(segments, jpegProfile(icc));
    return withInserted(jpeg, 2, segments);
}

Bytes encodePng(const std::string& path,
                const EncodedImage& image,
                const Bytes& exif,
                const Bytes& icc)
{
    const cv::Mat mat = image.max_code == 255 ? bgrFromRgb<std::uint8_t>(image.codes)
                                              : bgrFromRgb<std::uint16_t>(image.codes);
    return withPngChunks(encode(path, ".png", mat, {cv::IMWRITE_PNG_COMPRESSION, 6}), exif, icc);
}

Bytes encodeJpeg(const std::string& path,
                 const EncodedImage& image,
                 const Bytes& exif,
                 const Bytes& icc,
                 int quality)
{
    if (image.max_code != 255)
        throw InputError(path, "a JPEG holds 8 bits; write a 16-bit image as PNG");
    constexpr int kLargestJpegSide = 65535;
    if (image.codes.width() > kLargestJpegSide || image.codes.height() > kLargestJpegSide)
        throw InputError(path, "a JPEG's sides are at most 65535 pixels; write a PNG");
    const Bytes jpeg = encode(
        path, ".jpg", bgrFromRgb<std::uint8_t>(image.codes), {cv::IMWRITE_JPEG_QUALITY, quality});
    return withJpegSegments(jpeg, exif, icc);
}

void checkCodes(const EncodedImage& image)
{
    INSITU_CHECK(image.max_code == 255 || image.max_code == 65535, "{}", image.max_code);
    INSITU_CHECK(!image.codes.empty(), "an empty image cannot be written");
    if (image.max_code == 65535) return;
    for (const glm::u16vec3& code : image.codes.pixels())
        INSITU_CHECK(code.r <= 255 && code.g <= 255 && code.b <= 255,
                     "8-bit code ({}, {}, {})",
                     code.r,
                     code.g,
                     code.b);
}

}  // namespace

void writeEncoded(const std::filesystem::path& path,
                  const EncodedImage& image,
                  const std::vector<std::uint8_t>& exif,
                  int jpeg_quality,
                  const std::vector<std::uint8_t>& icc)
{
    INSITU_CHECK(jpeg_quality >= 1 && jpeg_quality <= 100, "{}", jpeg_quality);
    checkCodes(image);
    const std::string name = path.string();
    const std::string extension = lowerCaseExtension(path);
    const Bytes upright = uprightExif(exif);
    Bytes bytes;
    if (extension == ".png")
        bytes = encodePng(name, image, upright, icc);
    else if (extension == ".jpg" || extension == ".jpeg")
        bytes = encodeJpeg(name, image, upright, icc, jpeg_quality);
    else
        throw InputError(name, "pictures are written as .png, .jpg or .jpeg");
    writeBytes(path, bytes);
}

}  // namespace insitu
