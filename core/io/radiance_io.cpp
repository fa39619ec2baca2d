#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/io/image_path.h"
#include "core/io/radiance_formats.h"

#include <array>
#include <cmath>
#include <fstream>

namespace insitu {

namespace {

/// The first bytes of a file: enough to recognise its format by.
std::vector<std::uint8_t> readBeginning(const std::filesystem::path& path)
{
    std::ifstream stream(path, std::ios::binary);
    std::vector<std::uint8_t> bytes(512);
    stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(stream.gcount(), 0)));
    return bytes;
}

Image<Rgb> readPixels(const std::filesystem::path& path, std::int64_t max_pixels)
{
    const std::string name = path.string();
    if (std::filesystem::is_regular_file(path) && isExr(readBeginning(path)))
        return readExr(path, max_pixels);
    const std::vector<std::uint8_t> bytes = readFile(path);
    if (isPfm(bytes)) return decodePfm(bytes, name, max_pixels);
    if (isRgbe(bytes)) return decodeRgbe(bytes, name, max_pixels);
    throw InputError(name, "is not an OpenEXR, Radiance or PFM image");
}

bool isFinite(const Rgb& c)
{
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}

void checkAndClip(Image<Rgb>& image, const std::string& name)
{
    for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) {
            Rgb& pixel = image(x, y);
            if (!isFinite(pixel))
                throw InputError(name,
                                 fmt::format("pixel ({}, {})", x, y),
                                 fmt::format("its value ({}, {}, {}) is not finite; repair the "
                                             "image first",
                                             pixel.r,
                                             pixel.g,
                                             pixel.b));
            pixel = glm::max(pixel, Rgb(0.0f));
        }
    }
}

}  // namespace

bool isRadianceFile(const std::filesystem::path& path)
{
    const std::string extension = lowerCaseExtension(path);
    return extension == ".exr" || extension == ".hdr" || extension == ".pic" || extension == ".pfm";
}

RadianceImage readRadiance(const std::filesystem::path& path, std::int64_t max_pixels)
{
    RadianceImage image;
    image.pixels = readPixels(path, max_pixels);
    checkAndClip(image.pixels, path.string());
    return image;
}

void writeRadiance(const std::filesystem::path& path, const Image<Rgb>& image, bool half)
{
    INSITU_CHECK(!image.empty(), "an empty image cannot be written");
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
            INSITU_CHECK(isFinite(image(x, y)), "pixel ({}, {}) is not finite", x, y);
    const std::string extension = lowerCaseExtension(path);
    if (extension == ".exr")
        writeExr(path, image, half);
    else if (extension == ".hdr" || extension == ".pic")
        writeBytes(path, encodeRgbe(image));
    else if (extension == ".pfm")
        writeBytes(path, encodePfm(image));
    else
        throw InputError(path.string(), "linear images are written as .exr, .hdr or .pfm");
}

}  // namespace insitu
