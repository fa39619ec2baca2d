#include "core/io/exif.h"

#include "core/io/byte_view.h"
#include "core/io/exif_tags.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

namespace insitu {

namespace {

using namespace std::string_view_literals;

constexpr auto kPrefix = "Exif\0\0"sv;

struct ExifDataDeleter {
    void operator()(ExifData* data) const { exif_data_unref(data); }
};
using ExifDataPointer = std::unique_ptr<ExifData, ExifDataDeleter>;

bool hasPrefix(std::span<const std::uint8_t> block)
{
    return ByteView(block, "", ByteOrder::Big).startsWith(kPrefix);
}

ExifDataPointer load(std::span<const std::uint8_t> block)
{
    constexpr std::size_t kLargestBlock = 64 << 20;
    std::vector<std::uint8_t> prefixed;
    if (!hasPrefix(block)) {
        prefixed.assign(kPrefix.begin(), kPrefix.end());
        prefixed.insert(prefixed.end(), block.begin(), block.end());
        block = prefixed;
    }
    ExifDataPointer data(exif_data_new());
    if (!data || block.size() > kLargestBlock) return data;
    // Otherwise libexif invents mandatory tags that the camera did not write.
    exif_data_unset_option(data.get(), EXIF_DATA_OPTION_FOLLOW_SPECIFICATION);
    // Some converters put the exposure into the first directory, where it does not belong.
    exif_data_unset_option(data.get(), EXIF_DATA_OPTION_IGNORE_UNKNOWN_TAGS);
    exif_data_load_data(data.get(), block.data(), static_cast<unsigned>(block.size()));
    return data;
}

/// First value of a numeric tag as a number; nothing when absent, damaged or x/0.
std::optional<double> number(ExifData* data, std::uint16_t tag)
{
    const ExifEntry* entry = exif_data_get_entry(data, static_cast<ExifTag>(tag));
    if (entry == nullptr || entry->data == nullptr || entry->components < 1) return std::nullopt;
    if (entry->size < exif_format_get_size(entry->format)) return std::nullopt;
    const ExifByteOrder order = exif_data_get_byte_order(data);
    switch (entry->format) {
        case EXIF_FORMAT_SHORT:
            return exif_get_short(entry->data, order);
        case EXIF_FORMAT_LONG:
            return exif_get_long(entry->data, order);
        case EXIF_FORMAT_RATIONAL: {
            const ExifRational value = exif_get_rational(entry->data, order);
            if (value.denominator == 0) return std::nullopt;
            return static_cast<double>(value.numerator) / value.denominator;
        }
        case EXIF_FORMAT_SRATIONAL: {
            const ExifSRational value = exif_get_srational(entry->data, order);
            if (value.denominator == 0) return std::nullopt;
            return static_cast<double>(value.numerator) / value.denominator;
        }
        default:
            return std::nullopt;
    }
}

std::optional<double> positive(ExifData* data, std::uint16_t tag)
{
    const auto value = number(data, tag);
    return value && *value > 0.0 ? value : std::nullopt;
}

/// A text tag without padding; bytes that are not printable ASCII become '?'.
std::string text(ExifData* data, std::uint16_t tag)
{
    const ExifEntry* entry = exif_data_get_entry(data, static_cast<ExifTag>(tag));
    if (entry == nullptr || entry->data == nullptr || entry->format != EXIF_FORMAT_ASCII) return {};
    std::string result;
    for (unsigned i = 0; i < entry->size && entry->data[i] != 0; ++i) {
        const unsigned char c = entry->data[i];
        result += c >= 0x20 && c < 0x7F ? static_cast<char>(c) : '?';
    }
    result.erase(result.find_last_not_of(' ') + 1);
    return result;
}

Exposure readExposure(ExifData* data)
{
    constexpr double kLargestApex = 30.0;
    const auto apex = [&](ExifTag tag) -> std::optional<double> {
        const auto value = number(data, static_cast<std::uint16_t>(tag));
        return value && std::abs(*value) <= kLargestApex ? value : std::nullopt;
    };
    Exposure exposure;
    exposure.seconds = positive(data, exif::kExposureTime);
    exposure.f_number = positive(data, exif::kFNumber);
    exposure.iso = positive(data, exif::kSensitivity);
    if (!exposure.seconds)
        if (const auto tv = apex(EXIF_TAG_SHUTTER_SPEED_VALUE)) exposure.seconds = std::exp2(-*tv);
    if (!exposure.f_number)
        if (const auto av = apex(EXIF_TAG_APERTURE_VALUE)) exposure.f_number = std::exp2(*av / 2.0);
    return exposure;
}

std::optional<double> pixelsPerMillimetre(ExifData* data)
{
    const auto resolution = positive(data, exif::kFocalPlaneXResolution);
    if (!resolution) return std::nullopt;
    switch (static_cast<int>(number(data, exif::kFocalPlaneUnit).value_or(2.0))) {
        case 2:  // inch
            return *resolution / 25.4;
        case 3:  // centimetre
            return *resolution / 10.0;
        case 4:  // millimetre (not in the standard, but written)
            return *resolution;
        case 5:  // micrometre (the same)
            return *resolution * 1000.0;
        default:
            return std::nullopt;
    }
}

/// Whether a sensor with this long side can be: not a printer's resolution, and in agreement with
/// the film equivalent if that is known.
bool plausibleSensor(double sensor_mm, double focal_mm, std::optional<double> focal_35mm)
{
    constexpr double kMinSensorMm = 4.0;  // smaller ones sit in telephones, which state focal_35mm
    constexpr double kMaxSensorMm = 100.0;
    constexpr double kLargestDisagreement = 1.15;  // rounding, and the two ways to equate formats
    if (sensor_mm < kMinSensorMm || sensor_mm > kMaxSensorMm) return false;
    if (!focal_35mm) return true;
    const double ratio = focal_mm * exif::kFilmWidthMm / sensor_mm / *focal_35mm;
    return ratio < kLargestDisagreement && ratio > 1.0 / kLargestDisagreement;
}

std::optional<double> focalFromFocalPlane(ExifData* data,
                                          const PhotoMetadata& metadata,
                                          double long_side)
{
    const auto per_mm = pixelsPerMillimetre(data);
    if (!per_mm || !metadata.focal_mm) return std::nullopt;
    const double stored_x = positive(data, exif::kPixelXDimension).value_or(0.0);
    const double stored_y = positive(data, exif::kPixelYDimension).value_or(0.0);
    const double camera_long = std::max(stored_x, stored_y);
    if (camera_long <= 0.0) return std::nullopt;
    if (!plausibleSensor(camera_long / *per_mm, *metadata.focal_mm, metadata.focal_35mm))
        return std::nullopt;
    return *metadata.focal_mm * *per_mm * long_side / camera_long;
}

}  // namespace

PhotoMetadata parseExif(std::span<const std::uint8_t> block, int width, int height)
{
    PhotoMetadata metadata;
    if (block.empty()) return metadata;
    const ExifDataPointer owner = load(block);
    ExifData* data = owner.get();
    if (data == nullptr) return metadata;

    metadata.exposure = readExposure(data);
    metadata.focal_mm = positive(data, exif::kFocalLength);
    metadata.focal_35mm = positive(data, exif::kFocalLength35mm);
    metadata.make = text(data, exif::kMake);
    metadata.model = text(data, exif::kModel);
    const int orientation = static_cast<int>(number(data, exif::kOrientation).value_or(1.0));
    metadata.orientation = orientation >= 1 && orientation <= 8 ? orientation : 1;
    const double long_side = std::max(width, height);
    metadata.focal_px = focalFromFocalPlane(data, metadata, long_side);
    if (!metadata.focal_px && metadata.focal_35mm)
        metadata.focal_px = *metadata.focal_35mm / exif::kFilmWidthMm * long_side;
    metadata.exif.assign(block.begin(), block.end());
    if (!hasPrefix(block))
        metadata.exif.insert(metadata.exif.begin(), kPrefix.begin(), kPrefix.end());
    return metadata;
}

std::vector<std::uint8_t> uprightExif(std::vector<std::uint8_t> block)
{
    const std::size_t start = hasPrefix(block) ? kPrefix.size() : 0;
    const std::span<const std::uint8_t> tiff = std::span<const std::uint8_t>(block).subspan(start);
    if (tiff.size() < 8) return block;
    const bool little = tiff[0] == 'I';
    const ByteView view(tiff, "EXIF", little ? ByteOrder::Little : ByteOrder::Big);
    const std::size_t directory = view.u32(4);
    if (!view.contains(directory, 2)) return block;
    const std::size_t entries = view.u16(directory);
    for (std::size_t i = 0; i < entries; ++i) {
        const std::size_t entry = directory + 2 + 12 * i;
        if (!view.contains(entry, 12)) break;
        if (view.u16(entry) != exif::kOrientation) continue;
        block[start + entry + 8] = little ? 1 : 0;
        block[start + entry + 9] = little ? 0 : 1;
    }
    return block;
}

}  // namespace insitu
