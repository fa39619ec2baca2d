#pragma once

#include "core/color_profile.h"
#include "core/exposure.h"
#include "core/finding.h"
#include "core/image.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace insitu {

/// Display- or camera-encoded RGB codes, 8 or 16 bit. Never used in lighting arithmetic: the
/// type is different from RadianceImage so that the two cannot be mixed.
struct EncodedImage {
    Image<glm::u16vec3> codes;
    int max_code = 255;  ///< 255 (8 bit) or 65535 (16 bit)
};

/// What the camera wrote beside the pixels. Unknown = absent or empty.
struct PhotoMetadata {
    Exposure exposure;
    std::optional<double> focal_mm;
    std::optional<double> focal_35mm;  ///< FocalLengthIn35mmFilm
    /// Focal length in pixels of the image's long side when EXIF tells enough
    /// (focal-plane resolution, or the 35 mm equivalent against the film's 36 mm / diagonal).
    std::optional<double> focal_px;
    std::string make;
    std::string model;
    int orientation = 1;  ///< as stored; pixels handed out are already upright
    /// How the codes stand for colour: the embedded profile, a RAW file's own, else sRGB.
    ColorProfile color;
    std::string
        icc_problem;  ///< why an embedded profile is not used; empty: it is, or there is none
    std::vector<std::uint8_t> icc;   ///< the embedded RGB profile, to be copied into outputs
    std::vector<std::uint8_t> exif;  ///< the raw block ("Exif\0\0…"), to be copied into outputs
};

/// An encoded photograph as read from file, upright.
struct Photo {
    EncodedImage image;
    PhotoMetadata metadata;
    /// The values of an HDR photograph, finite and >= 0; empty when the file holds codes. `image`
    /// is then a copy of them, see photoFromRadiance().
    Image<Rgb> radiance{};
};

/// An HDR photograph, with codes for all that works on pictures: 16 bit, by one curve for all
/// channels (`metadata.color`, "linear"), which is linear up to a hundredth of the median and
/// logarithmic above it, and which leaves no value clipped. A code decodes to its value within
/// 3e-4 of it, or of a hundredth of the median where it is smaller.
[[nodiscard]] Photo photoFromRadiance(Image<Rgb> radiance);

/// What has to be told of a photograph as read: "photo-profile" (Info) when its colours are those
/// of a profile other than sRGB, "photo-profile-unusable" (Warning) when the embedded one cannot be
/// used and the codes count as sRGB. `name` is for the message.
[[nodiscard]] Findings photoFindings(const PhotoMetadata& metadata, const std::string& name);

/// A RAW photograph as a picture: 16-bit sRGB codes, white balanced, cut off where the least
/// amplified channel saturates. Its profile then says that sRGB is the response. Others come back
/// as they are.
[[nodiscard]] Photo developed(Photo photo);

/// Scene-linear image, Rec. 709 primaries, finite and >= 0.
///
/// Unit: camera-relative radiance, i.e. linearised exposure / Exposure::relative(), unless a
/// comment at the function that made it says otherwise.
struct RadianceImage {
    Image<Rgb> pixels;
    Exposure exposure;  ///< of the photograph it came from; empty for merged or rendered ones
};

}  // namespace insitu
