#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// What a JPEG, PNG or TIFF says about itself, read without decoding its pixels.
struct EncodedHeader {
    enum class Format { Jpeg, Png, Tiff };
    Format format = Format::Jpeg;
    int width = 0;   ///< as stored, before the orientation is applied
    int height = 0;  ///< as stored
    int bits = 8;    ///< per channel
    int channels = 3;
    bool has_icc_profile = false;
    std::vector<std::uint8_t> icc;  ///< the embedded profile; empty although there is one: damaged
    /// "Exif\0\0" and a TIFF header; empty when there is none and for a TIFF (which is one itself).
    std::vector<std::uint8_t> exif;
    /// TIFF: where the value of its orientation tag stands; 0 when it has none.
    std::size_t orientation_offset = 0;
};

/// Parses the header and checks that it can be true: size within `max_pixels` and not beyond what
/// the file's own compression could ever unpack from that many bytes, so that a few hundred bytes
/// cannot make the decoder allocate gigabytes. A JPEG without its end marker or with more than 500
/// scans is refused. InputError names `path` and the cause.
[[nodiscard]] EncodedHeader parseEncodedHeader(std::span<const std::uint8_t> bytes,
                                               const std::string& path,
                                               std::int64_t max_pixels);

[[nodiscard]] const char* formatName(EncodedHeader::Format format);

/// InputError when a declared size is empty or has more than `max_pixels` pixels.
void checkImageSize(const std::string& path,
                    std::int64_t width,
                    std::int64_t height,
                    std::int64_t max_pixels);

}  // namespace insitu
