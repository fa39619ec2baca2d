#pragma once

#include "core/image.h"
#include "core/io/byte_writer.h"
#include "core/io/tiff_directory.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

namespace insitu {

/// A camera's RAW file to be written: what its sensor saw and what it says about itself.
struct DngPicture {
    /// Sensor values of the three channels, black level included; a Bayer file keeps one of them a
    /// pixel (red, green / green, blue).
    Image<glm::u16vec3> sensor;
    bool bayer = true;
    int black = 0;
    int white = 65535;
    /// Camera channels of linear Rec. 709 [DNG's ColorMatrix after XYZ], column by column.
    glm::dmat3 camera_from_rec709{1.0};
    glm::dvec3 neutral{1.0};  ///< camera channels of what counts as white, largest 1
    double seconds = 0.01;
    double f_number = 4.0;
    int iso = 100;
    int orientation = 1;
};

namespace dng {

inline TiffField numbers(std::uint16_t tag, std::vector<std::uint32_t> values, bool is_long = false)
{
    TiffField field{tag,
                    is_long ? TiffField::kLong : TiffField::kShort,
                    static_cast<std::uint32_t>(values.size()),
                    {}};
    for (const std::uint32_t value : values)
        is_long ? append32(field.value, value) : append16(field.value, value);
    return field;
}

inline TiffField bytes(std::uint16_t tag, Bytes values)
{
    constexpr std::uint16_t kByte = 1;
    return {tag, kByte, static_cast<std::uint32_t>(values.size()), std::move(values)};
}

inline TiffField text(std::uint16_t tag, const std::string& value)
{
    TiffField field{tag, TiffField::kAscii, static_cast<std::uint32_t>(value.size() + 1), {}};
    append(field.value, value);
    field.value.push_back(0);
    return field;
}

inline TiffField fractions(std::uint16_t tag, const std::vector<double>& values, bool is_signed)
{
    constexpr std::uint16_t kSigned = 10;
    constexpr int kDenominator = 1'000'000;
    TiffField field{tag,
                    is_signed ? kSigned : static_cast<std::uint16_t>(TiffField::kRational),
                    static_cast<std::uint32_t>(values.size()),
                    {}};
    for (const double value : values) {
        append32(field.value, static_cast<std::uint32_t>(std::lround(value * kDenominator)));
        append32(field.value, kDenominator);
    }
    return field;
}

/// XYZ (white of D65) of linear Rec. 709: IEC 61966-2-1, section 5.2, column by column.
inline const glm::dmat3 kXyzFromRec709(
    0.412453, 0.212671, 0.019334, 0.357580, 0.715160, 0.119193, 0.180423, 0.072169, 0.950227);

inline std::vector<double> colorMatrix(const DngPicture& picture)
{
    const glm::dmat3 camera_from_xyz = picture.camera_from_rec709 * glm::inverse(kXyzFromRec709);
    std::vector<double> rows;
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column)
            rows.push_back(camera_from_xyz[column][row]);
    return rows;
}

inline Bytes pixels(const DngPicture& picture)
{
    Bytes data;
    for (int y = 0; y < picture.sensor.height(); ++y)
        for (int x = 0; x < picture.sensor.width(); ++x) {
            const glm::u16vec3 value = picture.sensor(x, y);
            if (picture.bayer) {
                append16(data, value[x % 2 + y % 2]);
                continue;
            }
            for (int c = 0; c < 3; ++c)
                append16(data, value[c]);
        }
    return data;
}

}  // namespace dng

/// The bytes of an uncompressed big-endian DNG 1.4 of one strip.
inline Bytes makeDng(const DngPicture& picture)
{
    using namespace dng;
    const auto width = static_cast<std::uint32_t>(picture.sensor.width());
    const auto height = static_cast<std::uint32_t>(picture.sensor.height());
    const Bytes data = pixels(picture);
    const std::uint32_t samples = picture.bayer ? 1 : 3;
    const auto directory = [&](std::uint32_t exif_at, std::uint32_t data_at) {
        std::vector<TiffField> fields = {
            numbers(254, {0}, true),
            numbers(256, {width}, true),
            numbers(257, {height}, true),
            numbers(258, std::vector<std::uint32_t>(samples, 16)),
            numbers(259, {1}),
            numbers(262, {picture.bayer ? 32803u : 34892u}),
            text(271, "Insitu"),
            text(272, "Simulated RAW"),
            numbers(273, {data_at}, true),
            numbers(274, {static_cast<std::uint32_t>(picture.orientation)}),
            numbers(277, {samples}),
            numbers(278, {height}, true),
            numbers(279, {static_cast<std::uint32_t>(data.size())}, true),
            numbers(284, {1}),
        };
        if (picture.bayer) {
            fields.push_back(numbers(33421, {2, 2}));
            fields.push_back(bytes(33422, {0, 1, 1, 2}));
        }
        fields.push_back(numbers(34665, {exif_at}, true));
        fields.push_back(bytes(50706, {1, 4, 0, 0}));
        fields.push_back(bytes(50707, {1, 1, 0, 0}));
        fields.push_back(text(50708, "Insitu Simulated RAW"));
        fields.push_back(numbers(50714, {static_cast<std::uint32_t>(picture.black)}));
        fields.push_back(numbers(50717, {static_cast<std::uint32_t>(picture.white)}, true));
        fields.push_back(fractions(50721, colorMatrix(picture), true));
        const glm::dvec3 n = picture.neutral;
        fields.push_back(fractions(50728, {n.r, n.g, n.b}, false));
        fields.push_back(numbers(50778, {21}));  // D65
        return fields;
    };
    const std::vector<TiffField> exposure = {
        fractions(33434, {picture.seconds}, false),
        fractions(33437, {picture.f_number}, false),
        numbers(34855, {static_cast<std::uint32_t>(picture.iso)})};
    Bytes file = {'M', 'M', 0, 42, 0, 0, 0, 8};
    const std::size_t exif_at = file.size() + directorySize(directory(0, 0));
    const std::size_t data_at = exif_at + directorySize(exposure);
    appendDirectory(
        file, directory(static_cast<std::uint32_t>(exif_at), static_cast<std::uint32_t>(data_at)));
    appendDirectory(file, exposure);
    append(file, data);
    return file;
}

}  // namespace insitu
