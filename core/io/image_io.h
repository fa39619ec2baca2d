#pragma once

#include "core/photo.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace insitu {

/// Reading and writing of images.
///
/// Common rules: readers throw InputError naming the file and the cause; declared sizes are
/// checked against `max_pixels`, and against what so many bytes could unpack to, before anything
/// is allocated. Formats are recognised by content, not by extension. Writers write to a temporary
/// name in the target's folder and rename, so that a broken run leaves no half file; they overwrite
/// (the command line is what refuses without --force). There the extension decides the format.

/// 400 megapixels: 4.8 GB of float RGB.
inline constexpr std::int64_t kMaxPixels = 400'000'000;
/// 1 GiB: what the decoders of JPEG, PNG and TIFF accept.
inline constexpr std::int64_t kMaxEncodedBytes = 1LL << 30;

/// JPEG, PNG (8/16 bit), TIFF (8/16 bit): upright pixels (EXIF orientation applied), alpha dropped,
/// grey expanded to RGB, with what EXIF tells. Codes stay as they are; metadata.color says what
/// the embedded ICC profile makes of them. RAW files of cameras (what LibRaw reads): linear 16-bit
/// codes of the sensor's channels, see core/io/raw_read.h.
[[nodiscard]] Photo readPhoto(const std::filesystem::path& path,
                              std::int64_t max_pixels = kMaxPixels);
/// The photograph of a room: `readPhoto`, developed, or, of a radiance file, `readRadiance` with
/// codes (photoFromRadiance).
[[nodiscard]] Photo readPhotograph(const std::filesystem::path& path,
                                   std::int64_t max_pixels = kMaxPixels);
/// EXR, Radiance .hdr/.pic, PFM: scene-linear. A negative value becomes 0; NaN or infinity is an
/// InputError with its pixel.
///
/// EXR: first part, flat, R G B or Y of half/float, plain or of its only layer; the image is the
/// display window, black outside the data window; primaries other than Rec. 709 are converted
/// (Bradford). Radiance: EXPOSURE and COLORCORR divided out, XYZE converted, all eight pixel
/// orders. PFM: multiplied by the magnitude of its scale.
[[nodiscard]] RadianceImage readRadiance(const std::filesystem::path& path,
                                         std::int64_t max_pixels = kMaxPixels);
/// By extension: true for .exr .hdr .pic .pfm.
[[nodiscard]] bool isRadianceFile(const std::filesystem::path& path);

/// PNG 8/16 (by max_code) or JPEG (8 bit, 4:2:0, `jpeg_quality`). `exif` is copied into the file
/// when given, its orientation set to 1 since pixels in memory are upright; a block that does not
/// fit into a JPEG segment (65 533 bytes) is left out. `icc` is embedded when given; else a PNG
/// says that it is sRGB.
void writeEncoded(const std::filesystem::path& path,
                  const EncodedImage& image,
                  const std::vector<std::uint8_t>& exif = {},
                  int jpeg_quality = 97,
                  const std::vector<std::uint8_t>& icc = {});
/// EXR (half when `half`, then at most 65504; ZIP, chromaticities written), .hdr (RLE RGBE) or PFM.
/// A NaN, an infinity or, in .hdr, a negative value is a LogicError: it must not leave.
void writeRadiance(const std::filesystem::path& path, const Image<Rgb>& image, bool half = false);

/// One named channel of a layered EXR ("object.R", "depth.Z").
struct ExrChannel {
    std::string name;
    Image<float> values;
};
/// Appends a colour image as "<layer>.R", "<layer>.G", "<layer>.B", or "R", "G", "B" when `layer`
/// is empty: what readers without layers show.
void addColorLayer(std::vector<ExrChannel>& channels,
                   const std::string& layer,
                   const Image<Rgb>& image);
/// Float channels of equal size, stored in order of name (as EXR demands); at least one.
void writeLayeredExr(const std::filesystem::path& path, const std::vector<ExrChannel>& channels);
/// All channels of the first part as float, in order of name, over the data window. Values are
/// handed out as they are, NaN included. `max_pixels` counts pixels times channels / 3.
[[nodiscard]] std::vector<ExrChannel> readLayeredExr(const std::filesystem::path& path,
                                                     std::int64_t max_pixels = kMaxPixels);

}  // namespace insitu
