#include "core/io/exif_acceleration.h"

#include "core/io/byte_view.h"
#include "core/io/exif_tags.h"
#include "core/io/tiff_directory.h"

#include <algorithm>
#include <string>
#include <string_view>

namespace insitu {

namespace {

using namespace std::string_view_literals;

constexpr auto kPrefix = "Exif\0\0"sv;
constexpr auto kApple = "Apple iOS\0"sv;
/// In Apple's note: where the byte order is named and where its directory begins. Offsets count
/// from the note's own beginning.
constexpr std::size_t kAppleOrder = 12;
constexpr std::size_t kAppleDirectory = 14;
constexpr std::uint16_t kAppleAcceleration = 8;
constexpr std::uint16_t kSignedRational = 10;

/// The bytes that a directory's entry points to; empty when there is no such tag.
std::span<const std::uint8_t> valueOf(const ByteView& tiff,
                                      std::size_t directory,
                                      std::uint16_t tag,
                                      std::size_t bytes_each)
{
    const std::size_t entries = tiff.u16(directory);
    for (std::size_t i = 0; i < entries; ++i) {
        const std::size_t entry = directory + 2 + 12 * i;
        if (tiff.u16(entry) != tag) continue;
        const std::size_t size = tiff.u32(entry + 4) * bytes_each;
        return tiff.slice(size <= 4 ? entry + 8 : tiff.u32(entry + 8), size);
    }
    return {};
}

/// Signed 32-bit numerator and denominator at `offset` of big-endian bytes.
std::optional<double> fractionAt(const ByteView& bytes, std::size_t offset)
{
    const auto numerator = static_cast<std::int32_t>(bytes.u32(offset));
    const auto denominator = static_cast<std::int32_t>(bytes.u32(offset + 4));
    if (denominator == 0) return std::nullopt;
    return static_cast<double>(numerator) / denominator;
}

std::optional<glm::dvec3> fromAppleNote(std::span<const std::uint8_t> bytes)
{
    if (!ByteView(bytes, "EXIF", ByteOrder::Big).startsWith(kApple)) return std::nullopt;
    const bool little = ByteView(bytes, "EXIF", ByteOrder::Big).startsWith("II"sv, kAppleOrder);
    const ByteView note(bytes, "EXIF", little ? ByteOrder::Little : ByteOrder::Big);
    for (const TiffField& field : readDirectory(note, kAppleDirectory)) {
        if (field.tag != kAppleAcceleration || field.type != kSignedRational || field.count != 3)
            continue;
        const ByteView values(field.value, "EXIF", ByteOrder::Big);
        const auto left = fractionAt(values, 0);
        const auto bottom = fractionAt(values, 8);
        const auto inward = fractionAt(values, 16);
        if (!left || !bottom || !inward) return std::nullopt;
        // With the top to the left, the telephone's bottom is the picture's right and its left side
        // the picture's bottom; into its face is where the camera looks.
        return glm::dvec3(*bottom, *left, *inward);
    }
    return std::nullopt;
}

}  // namespace

std::optional<glm::dvec3> accelerationFromExif(std::span<const std::uint8_t> block)
{
    try {
        if (ByteView(block, "EXIF", ByteOrder::Big).startsWith(kPrefix))
            block = block.subspan(kPrefix.size());
        const bool little = !block.empty() && block[0] == 'I';
        const ByteView tiff(block, "EXIF", little ? ByteOrder::Little : ByteOrder::Big);
        const auto pointer = valueOf(tiff, tiff.u32(4), exif::kExifDirectory, 4);
        if (pointer.size() != 4) return std::nullopt;
        const std::size_t directory = ByteView(pointer, "EXIF", tiff.order()).u32(0);
        const auto lens = valueOf(tiff, directory, exif::kLensModel, 1);
        if (std::string(lens.begin(), lens.end()).find("front") != std::string::npos)
            return std::nullopt;
        return fromAppleNote(valueOf(tiff, directory, exif::kMakerNote, 1));
    } catch (const InputError&) {
        return std::nullopt;  // a damaged block is as good as none
    }
}

}  // namespace insitu
