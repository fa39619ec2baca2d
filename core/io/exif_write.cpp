#include "core/io/byte_writer.h"
#include "core/io/exif.h"
#include "core/io/exif_tags.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

namespace insitu {

namespace {

enum FieldType : std::uint16_t { kAscii = 2, kShort = 3, kLong = 4, kRational = 5, kUndefined = 7 };

/// One entry of a TIFF directory with its value in big-endian bytes.
struct Field {
    std::uint16_t tag;
    FieldType type;
    std::uint32_t count;
    Bytes value;
};

Field shortField(std::uint16_t tag, double value)
{
    Field field{tag, kShort, 1, {}};
    append16(field.value, static_cast<std::uint32_t>(std::clamp(std::round(value), 0.0, 65535.0)));
    return field;
}

Field longField(std::uint16_t tag, std::uint32_t value)
{
    Field field{tag, kLong, 1, {}};
    append32(field.value, value);
    return field;
}

Field textField(std::uint16_t tag, std::string_view text)
{
    Field field{tag, kAscii, static_cast<std::uint32_t>(text.size() + 1), {}};
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

Field rationalField(std::uint16_t tag, double value)
{
    const auto [numerator, denominator] = fractionOf(value);
    Field field{tag, kRational, 1, {}};
    append32(field.value, numerator);
    append32(field.value, denominator);
    return field;
}

std::size_t directorySize(const std::vector<Field>& fields)
{
    std::size_t size = 2 + 12 * fields.size() + 4;
    for (const Field& field : fields)
        if (field.value.size() > 4) size += (field.value.size() + 1) / 2 * 2;
    return size;
}

/// Appends a directory (TIFF 6.0, section 2); offsets count from `tiff`'s beginning.
void putDirectory(Bytes& tiff, const std::vector<Field>& fields)
{
    std::size_t value_at = tiff.size() + 2 + 12 * fields.size() + 4;
    append16(tiff, static_cast<std::uint32_t>(fields.size()));
    Bytes values;
    for (const Field& field : fields) {
        append16(tiff, field.tag);
        append16(tiff, field.type);
        append32(tiff, field.count);
        Bytes value = field.value;
        if (value.size() <= 4) {
            value.resize(4, 0);
            append(tiff, value);
            continue;
        }
        if (value.size() % 2 == 1) value.push_back(0);
        append32(tiff, static_cast<std::uint32_t>(value_at + values.size()));
        append(values, value);
    }
    append32(tiff, 0);  // no further directory
    append(tiff, values);
}

std::vector<Field> cameraFields(const PhotoMetadata& metadata)
{
    std::vector<Field> fields;
    if (!metadata.make.empty()) fields.push_back(textField(exif::kMake, metadata.make));
    if (!metadata.model.empty()) fields.push_back(textField(exif::kModel, metadata.model));
    fields.push_back(shortField(exif::kOrientation, 1));
    return fields;
}

std::vector<Field> exposureFields(const PhotoMetadata& metadata)
{
    const Exposure& exposure = metadata.exposure;
    std::vector<Field> fields;
    if (exposure.seconds) fields.push_back(rationalField(exif::kExposureTime, *exposure.seconds));
    if (exposure.f_number) fields.push_back(rationalField(exif::kFNumber, *exposure.f_number));
    if (exposure.iso) fields.push_back(shortField(exif::kSensitivity, *exposure.iso));
    fields.push_back({exif::kExifVersion, kUndefined, 4, {'0', '2', '3', '2'}});
    if (metadata.focal_mm) fields.push_back(rationalField(exif::kFocalLength, *metadata.focal_mm));
    if (metadata.focal_mm && metadata.focal_px) {
        constexpr double kMillimetresPerCentimetre = 10.0;
        const double per_cm = *metadata.focal_px / *metadata.focal_mm * kMillimetresPerCentimetre;
        fields.push_back(rationalField(exif::kFocalPlaneXResolution, per_cm));
        fields.push_back(shortField(exif::kFocalPlaneUnit, 3));
    }
    if (metadata.focal_35mm)
        fields.push_back(shortField(exif::kFocalLength35mm, *metadata.focal_35mm));
    return fields;
}

}  // namespace

Bytes makeExif(const PhotoMetadata& metadata)
{
    Bytes tiff = {'M', 'M', 0, 42, 0, 0, 0, 8};
    std::vector<Field> camera = cameraFields(metadata);
    camera.push_back(longField(exif::kExifDirectory, 0));
    const std::size_t exif_at = tiff.size() + directorySize(camera);
    camera.back() = longField(exif::kExifDirectory, static_cast<std::uint32_t>(exif_at));
    putDirectory(tiff, camera);
    putDirectory(tiff, exposureFields(metadata));
    Bytes block = {'E', 'x', 'i', 'f', 0, 0};
    append(block, tiff);
    return block;
}

}  // namespace insitu
