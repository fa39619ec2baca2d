#pragma once

#include "core/io/exif_tags.h"
#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/io/tiff_directory.h"

#include <glm/glm.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>

namespace insitu {

/// An EXIF block as an iPhone writes it: orientation, acceleration, lens.
///
/// acceleration   in g towards the telephone's left (seen from the front), its bottom, into it
inline Bytes appleExif(glm::dvec3 acceleration,
                       int orientation = 1,
                       std::string_view lens = "iPhone 11 back dual wide camera 4.25mm f/1.8")
{
    constexpr int kDenominator = 1'000'000;
    constexpr std::uint32_t kSignedRational = 10;
    Bytes note;
    append(note, std::string_view("Apple iOS\0\0\1MM", 14));
    append16(note, 1);
    append16(note, 8);
    append16(note, kSignedRational);
    append32(note, 3);
    append32(note, 14 + 2 + 12 + 4);
    append32(note, 0);
    for (int i = 0; i < 3; ++i) {
        const auto value = static_cast<std::int32_t>(std::lround(acceleration[i] * kDenominator));
        append32(note, static_cast<std::uint32_t>(value));
        append32(note, kDenominator);
    }
    const auto word = [](std::uint32_t value) {
        Bytes bytes;
        append32(bytes, value);
        return bytes;
    };
    Bytes lens_text(lens.begin(), lens.end());
    lens_text.push_back(0);
    const Bytes turned{0, static_cast<std::uint8_t>(orientation)};
    std::vector<TiffField> camera{{exif::kOrientation, TiffField::kShort, 1, turned},
                                  {exif::kExifDirectory, TiffField::kLong, 1, word(0)}};
    const auto count = [](const Bytes& bytes) { return static_cast<std::uint32_t>(bytes.size()); };
    const std::vector<TiffField> own{
        {exif::kMakerNote, TiffField::kUndefined, count(note), note},
        {exif::kLensModel, TiffField::kAscii, count(lens_text), lens_text}};
    Bytes tiff = {'M', 'M', 0, 42, 0, 0, 0, 8};
    camera.back().value = word(static_cast<std::uint32_t>(tiff.size() + directorySize(camera)));
    appendDirectory(tiff, camera);
    appendDirectory(tiff, own);
    Bytes block = {'E', 'x', 'i', 'f', 0, 0};
    append(block, tiff);
    return block;
}

/// Writes pixels as a camera held in some other way stores them: a JPEG whose orientation tag, the
/// first of its EXIF block, is kept as it is.
inline void writeStored(const std::filesystem::path& path,
                        const EncodedImage& stored,
                        const Bytes& exif,
                        int orientation)
{
    writeEncoded(path, stored, exif);
    Bytes bytes = readFile(path, 1 << 26);
    const Bytes tag{0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, 1};
    const auto at = std::search(bytes.begin(), bytes.end(), tag.begin(), tag.end());
    *(at + 9) = static_cast<std::uint8_t>(orientation);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
}

/// An upright picture as a camera that was turned by a quarter stores it (orientation 6: it is to
/// be turned clockwise for viewing).
inline EncodedImage storedSideways(const EncodedImage& upright)
{
    EncodedImage stored;
    stored.max_code = upright.max_code;
    const int w = upright.codes.width();
    const int h = upright.codes.height();
    stored.codes = Image<glm::u16vec3>(h, w);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
            stored.codes(y, w - 1 - x) = upright.codes(x, y);
    return stored;
}

}  // namespace insitu
