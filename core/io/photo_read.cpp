#include "core/color.h"
#include "core/io/byte_writer.h"
#include "core/io/encoded_header.h"
#include "core/io/exif.h"
#include "core/io/file.h"
#include "core/io/icc_profile.h"
#include "core/io/image_io.h"
#include "core/io/raw_read.h"
#include "core/parallel.h"

#include <opencv2/imgcodecs.hpp>

#include <cmath>

namespace insitu {

namespace {

cv::Mat decode(std::vector<std::uint8_t>& bytes, const std::string& path, const char* format)
{
    constexpr int kFlags = cv::IMREAD_ANYDEPTH | cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION;
    cv::Mat mat;
    try {
        mat = cv::imdecode(bytes, kFlags);
    } catch (const std::exception& error) {
        throw InputError(path, fmt::format("cannot be decoded as {}: {}", format, error.what()));
    }
    if (mat.empty())
        throw InputError(path, fmt::format("cannot be decoded as {}; it is damaged", format));
    if (mat.type() != CV_8UC3 && mat.type() != CV_16UC3)
        throw InputError(path, "has pixels that are neither 8 nor 16 bit unsigned");
    return mat;
}

template <class Code>
Image<glm::u16vec3> rgbFromBgr(const cv::Mat& mat)
{
    Image<glm::u16vec3> codes(mat.cols, mat.rows);
    parallelFor(0, mat.rows, [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        const auto* from = mat.ptr<cv::Vec<Code, 3>>(y);
        for (glm::u16vec3& to : codes.row(y)) {
            to = {(*from)[2], (*from)[1], (*from)[0]};
            ++from;
        }
    });
    return codes;
}

/// Turns stored pixels upright. Orientations as in EXIF 2.32, tag 0x0112: where the stored row 0
/// and column 0 belong.
Image<glm::u16vec3> upright(Image<glm::u16vec3> stored, int orientation)
{
    if (orientation <= 1 || orientation > 8) return stored;
    const int w = stored.width();
    const int h = stored.height();
    const bool swapped = orientation >= 5;
    Image<glm::u16vec3> result(swapped ? h : w, swapped ? w : h);
    const auto storedPixel = [&](int x, int y) -> const glm::u16vec3& {
        switch (orientation) {
            case 2:  // mirrored left to right
                return stored(w - 1 - x, y);
            case 3:  // upside down
                return stored(w - 1 - x, h - 1 - y);
            case 4:  // mirrored top to bottom
                return stored(x, h - 1 - y);
            case 5:  // transposed
                return stored(y, x);
            case 6:  // to be turned clockwise
                return stored(y, h - 1 - x);
            case 7:  // transposed along the other diagonal
                return stored(w - 1 - y, h - 1 - x);
            default:  // 8: to be turned counter-clockwise
                return stored(w - 1 - y, x);
        }
    };
    parallelFor(0, result.height(), [&](std::int64_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < result.width(); ++x)
            result(x, y) = storedPixel(x, y);
    });
    return result;
}

PhotoMetadata readMetadata(const EncodedHeader& header, std::span<const std::uint8_t> bytes)
{
    const bool tiff = header.format == EncodedHeader::Format::Tiff;
    const Bytes block = tiff ? exifOfTiff(bytes) : header.exif;
    PhotoMetadata metadata = parseExif(block, header.width, header.height);
    if (!header.has_icc_profile) return metadata;
    IccReading reading = readIccProfile(header.icc);
    if (reading.profile) metadata.color = *std::move(reading.profile);
    if (reading.rgb) metadata.icc = header.icc;
    metadata.icc_problem = std::move(reading.problem);
    return metadata;
}

}  // namespace

Findings photoFindings(const PhotoMetadata& metadata, const std::string& name)
{
    if (!metadata.icc_problem.empty())
        return {{Severity::Warning,
                 "photo-profile-unusable",
                 fmt::format("{}: the embedded colour profile {}: colours count as sRGB's. Convert "
                             "the picture to sRGB first",
                             name,
                             metadata.icc_problem)}};
    if (metadata.color.hasRec709Primaries() || metadata.color.transfer_is_response) return {};
    return {
        {Severity::Info,
         "photo-profile",
         fmt::format("{}: its colours are those of the profile '{}' and are brought to Rec. 709",
                     name,
                     metadata.color.name)}};
}

Photo developed(Photo photo)
{
    ColorProfile& color = photo.metadata.color;
    if (!color.transfer_is_response) return photo;
    const int max_code = photo.image.max_code;
    const glm::dmat3 matrix = color.rec709_from_linear;
    const glm::dvec3 white = glm::min(glm::inverse(matrix) * glm::dvec3(1.0), glm::dvec3(1.0));
    Image<glm::u16vec3>& codes = photo.image.codes;
    parallelFor(0, codes.height(), [&](std::int64_t row) {
        for (glm::u16vec3& code : codes.row(static_cast<int>(row))) {
            const glm::dvec3 linear = glm::dvec3(code) / static_cast<double>(max_code);
            const glm::dvec3 seen =
                glm::clamp(matrix * glm::min(linear, white), glm::dvec3(0.0), glm::dvec3(1.0));
            for (int c = 0; c < 3; ++c)
                code[c] =
                    static_cast<std::uint16_t>(std::lround(max_code * srgbFromLinear(seen[c])));
        }
    });
    color = {};
    color.transfer_is_response = true;
    return photo;
}

Photo readPhoto(const std::filesystem::path& path, std::int64_t max_pixels)
{
    const std::string name = path.string();
    std::vector<std::uint8_t> bytes = readFile(path, kMaxEncodedBytes);
    if (isRawFile(bytes, path)) {
        Photo raw = readRaw(bytes, path, max_pixels);
        raw.image.codes = upright(std::move(raw.image.codes), raw.metadata.orientation);
        return raw;
    }
    const EncodedHeader header = parseEncodedHeader(bytes, name, max_pixels);
    Photo photo;
    photo.metadata = readMetadata(header, bytes);
    if (header.orientation_offset != 0) {
        // OpenCV turns some kinds of TIFF by itself and others not: tell it that all are upright.
        const bool little = bytes[0] == 'I';
        bytes[header.orientation_offset] = little ? 1 : 0;
        bytes[header.orientation_offset + 1] = little ? 0 : 1;
    }
    const cv::Mat mat = decode(bytes, name, formatName(header.format));
    if (mat.cols != header.width || mat.rows != header.height)
        throw InputError(name,
                         fmt::format("declares {}x{} pixels but holds {}x{}",
                                     header.width,
                                     header.height,
                                     mat.cols,
                                     mat.rows));
    const bool eight_bit = mat.depth() == CV_8U;
    photo.image.max_code = eight_bit ? 255 : 65535;
    photo.image.codes =
        upright(eight_bit ? rgbFromBgr<std::uint8_t>(mat) : rgbFromBgr<std::uint16_t>(mat),
                photo.metadata.orientation);
    return photo;
}

Photo readPhotograph(const std::filesystem::path& path, std::int64_t max_pixels)
{
    if (isRadianceFile(path)) return photoFromRadiance(readRadiance(path, max_pixels).pixels);
    return developed(readPhoto(path, max_pixels));
}

}  // namespace insitu
