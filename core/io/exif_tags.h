#pragma once

#include <cstdint>

namespace insitu::exif {

/// Tags of EXIF 2.32 that we read and write, and where the values mean something to us.
inline constexpr std::uint16_t kMake = 0x010F;
inline constexpr std::uint16_t kModel = 0x0110;
inline constexpr std::uint16_t kOrientation = 0x0112;
inline constexpr std::uint16_t kExifDirectory = 0x8769;
inline constexpr std::uint16_t kExposureTime = 0x829A;
inline constexpr std::uint16_t kFNumber = 0x829D;
inline constexpr std::uint16_t kSensitivity = 0x8827;
inline constexpr std::uint16_t kExifVersion = 0x9000;
inline constexpr std::uint16_t kFocalLength = 0x920A;
inline constexpr std::uint16_t kMakerNote = 0x927C;
inline constexpr std::uint16_t kPixelXDimension = 0xA002;
inline constexpr std::uint16_t kPixelYDimension = 0xA003;
inline constexpr std::uint16_t kFocalPlaneXResolution = 0xA20E;
inline constexpr std::uint16_t kFocalPlaneUnit = 0xA210;
inline constexpr std::uint16_t kFocalLength35mm = 0xA405;
inline constexpr std::uint16_t kLensModel = 0xA434;

/// Width of the 35 mm film frame, which we set against the image's long side.
inline constexpr double kFilmWidthMm = 36.0;

}  // namespace insitu::exif
