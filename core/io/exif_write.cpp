#include "core/io/byte_view.h"
#include "core/io/exif.h"
#include "core/io/exif_tags.h"
#include "core/io/tiff_directory.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

namespace insitu {

namespace {

TiffField shortField(std::uint16_t tag, double value)
{
    TiffField field{tag, TiffField::kShort, 1, {}};
    append16(field.value, static_cast<std::uint32_t>(std::clamp(std::round(value), 0.0, 65535.0)));
    return field;
}

TiffField longField(std::uint16_t tag, std::uint32_t value)
{
    TiffField field{tag, TiffField::kLong, 1, {}};
    append32(field.value, value);
    return field;
}

TiffField textField(std::uint16_t tag, std::string_view text)
{
    TiffField field{tag, TiffField::kAscii, static_cast<std::uint32_t>(text.size() + 1), {}};
    append(field.value, text);
    field.value.push_back(0);
    return field;
}

/// The fraction of 32-bit integers nearest to `value` among its continued-fraction convergents, so
/// that 1/128 is stored as exactly that. value > 0.
std::pair<std::uint32_t, std::uint32_t> fractionOf(double value)
{
    constexpr double kLargest = std::numeric_limits<std::uint32_t>::max();
    double p0 = 0.0, q0 = 1.0, p1 = 1.0, q1 = 0.0;
    double rest = value;
    for (int i = 0; i < 40; ++i) {
        const double whole = std::floor(rest);
        const double p = whole * p1 + p0;
        const double q = whole * q1 + q0;
        if (p > kLargest || q > kLargest) break;
        p0 = std::exchange(p1, p);
        q0 = std::exchange(q1, q);
        if (std::abs(p1 / q1 - value) <= 1e-15 * value || rest == whole) break;
        rest = 1.0 / (rest - whole);
    }
    return {static_cast<std::uint32_t>(p1), static_cast<std::uint32_t>(q1)};
}

TiffField rationalField(std::uint16_t tag, double value)
{
    const auto [numerator, denominator] = fractionOf(value);
    TiffField field{tag, TiffField::kRational, 1, {}};
    append32(field.value, numerator);
    append32(field.value, denominator);
    return field;
}

std::vector<TiffField> cameraFields(const PhotoMetadata& metadata)
{
    std::vector<TiffField> fields;
    if (!metadata.make.empty()) fields.push_back(textField(exif::kMake, metadata.make));
    if (!metadata.model.empty()) fields.push_back(textField(exif::kModel, metadata.model));
    fields.push_back(shortField(exif::kOrientation, 1));
    return fields;
}

std::vector<TiffField> exposureFields(const PhotoMetadata& metadata, int width, int height)
{
    const Exposure& exposure = metadata.exposure;
    std::vector<TiffField> fields;
    if (exposure.seconds) fields.push_back(rationalField(exif::kExposureTime, *exposure.seconds));
    if (exposure.f_number) fields.push_back(rationalField(exif::kFNumber, *exposure.f_number));
    if (exposure.iso) fields.push_back(shortField(exif::kSensitivity, *exposure.iso));
    fields.push_back({exif::kExifVersion, TiffField::kUndefined, 4, {'0', '2', '3', '2'}});
    if (metadata.focal_mm) fields.push_back(rationalField(exif::kFocalLength, *metadata.focal_mm));
    const bool sized = width > 0 && height > 0;
    if (sized) {
        fields.push_back(longField(exif::kPixelXDimension, static_cast<std::uint32_t>(width)));
        fields.push_back(longField(exif::kPixelYDimension, static_cast<std::uint32_t>(height)));
    }
    if (sized && metadata.focal_mm && metadata.focal_px) {
        constexpr double kMillimetresPerCentimetre = 10.0;
        const double per_cm = *metadata.focal_px / *metadata.focal_mm * kMillimetresPerCentimetre;
        fields.push_back(rationalField(exif::kFocalPlaneXResolution, per_cm));
        fields.push_back(shortField(exif::kFocalPlaneUnit, 3));
    }
    if (metadata.focal_35mm)
        fields.push_back(shortField(exif::kFocalLength35mm, *metadata.focal_35mm));
    return fields;
}

/// The block of a camera directory and the EXIF directory that its last field points to.
Bytes blockOf(std::vector<TiffField> camera, const std::vector<TiffField>& exposure)
{
    Bytes tiff = {'M', 'M', 0, 42, 0, 0, 0, 8};
    camera.push_back(longField(exif::kExifDirectory, 0));
    const std::size_t exif_at = tiff.size() + directorySize(camera);
    camera.back() = longField(exif::kExifDirectory, static_cast<std::uint32_t>(exif_at));
    appendDirectory(tiff, camera);
    appendDirectory(tiff, exposure);
    Bytes block = {'E', 'x', 'i', 'f', 0, 0};
    append(block, tiff);
    return block;
}

}  // namespace

std::vector<std::uint8_t> makeExif(const PhotoMetadata& metadata, int width, int height)
{
    return blockOf(cameraFields(metadata), exposureFields(metadata, width, height));
}

std::vector<std::uint8_t> exifOfTiff(std::span<const std::uint8_t> file)
{
    const bool big = !file.empty() && file[0] == 'M';
    const ByteView tiff(file, "TIFF", big ? ByteOrder::Big : ByteOrder::Little);
    std::vector<TiffField> camera;
    std::vector<TiffField> exposure;
    try {
        for (TiffField& field : readDirectory(tiff, tiff.u32(4))) {
            const bool of_camera = field.tag == exif::kMake || field.tag == exif::kModel ||
                                   field.tag == exif::kOrientation;
            if (of_camera)
                camera.push_back(std::move(field));
            else if (field.tag == exif::kExifDirectory)
                exposure = readDirectory(tiff, integerValue(field));
        }
    } catch (const InputError&) {
        return {};  // a damaged block is as good as none; the picture may be whole
    }
    std::erase_if(exposure, [](const TiffField& field) { return field.tag == exif::kMakerNote; });
    return blockOf(std::move(camera), exposure);
}

}  // namespace insitu
