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
/// checked against kMaxPixels before anything is allocated. Writers write to a temporary name in
/// the target's folder and rename, so that a broken run leaves no half file; they overwrite (the
/// command line is what refuses without --force). The extension decides the format.

/// 400 megapixels: 4.8 GB of float RGB.
inline constexpr std::int64_t kMaxPixels = 400'000'000;

/// JPEG, PNG (8/16 bit), TIFF (8/16 bit): upright pixels (EXIF orientation applied), alpha dropped,
/// grey expanded to RGB, with what EXIF tells.
[[nodiscard]] Photo readPhoto(const std::filesystem::path& path);
/// EXR (half/float; first part, R G B or Y), Radiance .hdr/.pic, PFM: scene-linear. A negative
/// value becomes 0; NaN or infinity is an InputError with its pixel.
[[nodiscard]] RadianceImage readRadiance(const std::filesystem::path& path);
/// By extension: true for .exr .hdr .pic .pfm.
[[nodiscard]] bool isRadianceFile(const std::filesystem::path& path);

/// PNG 8/16 (by max_code) or JPEG (8 bit, `jpeg_quality`); `exif` is copied into a JPEG when given.
void writeEncoded(const std::filesystem::path& path,
                  const EncodedImage& image,
                  const std::vector<std::uint8_t>& exif = {},
                  int jpeg_quality = 97);
/// EXR (half when `half`, ZIP, chromaticities written), .hdr (RLE RGBE) or PFM.
void writeRadiance(const std::filesystem::path& path, const Image<Rgb>& image, bool half = false);

/// One named channel of a layered EXR ("object.R", "depth.Z").
struct ExrChannel {
    std::string name;
    Image<float> values;
};
void writeLayeredExr(const std::filesystem::path& path, const std::vector<ExrChannel>& channels);
[[nodiscard]] std::vector<ExrChannel> readLayeredExr(const std::filesystem::path& path);

}  // namespace insitu
