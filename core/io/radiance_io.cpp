#include "core/io/image_io.h"
#include "core/io/image_path.h"
#include "core/io/radiance_formats.h"

#include <algorithm>
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

std::unique_ptr<RadianceRows> openStored(const std::filesystem::path& path, std::int64_t max_pixels)
{
    const std::string name = path.string();
    if (std::filesystem::is_regular_file(path) && isExr(readBeginning(path)))
        return openExr(path, max_pixels);
    auto file = std::make_unique<MappedFile>(path);
    if (isPfm(file->bytes())) return openPfm(std::move(file), name, max_pixels);
    if (isRgbe(file->bytes())) return openRgbe(std::move(file), name, max_pixels);
    throw InputError(name, "is not an OpenEXR, Radiance or PFM image");
}

bool isFinite(const Rgb& c)
{
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}

/// Values of a file, checked and clipped.
class CheckedRows : public RadianceRows {
public:
    CheckedRows(std::unique_ptr<RadianceRows> stored, std::string name)
        : stored_(std::move(stored)), name_(std::move(name))
    {
    }
    [[nodiscard]] int width() const override { return stored_->width(); }
    [[nodiscard]] int height() const override { return stored_->height(); }
    void read(int first, Image<Rgb>& rows) override
    {
        INSITU_CHECK(rows.width() == width() && first >= 0 && first + rows.height() <= height(),
                     "rows {} to {} of {}",
                     first,
                     first + rows.height(),
                     height());
        stored_->read(first, rows);
        for (int y = 0; y < rows.height(); ++y)
            for (int x = 0; x < rows.width(); ++x) {
                Rgb& pixel = rows(x, y);
                if (!isFinite(pixel))
                    throw InputError(name_,
                                     fmt::format("pixel ({}, {})", x, first + y),
                                     fmt::format("its value ({}, {}, {}) is not finite; repair "
                                                 "the image first",
                                                 pixel.r,
                                                 pixel.g,
                                                 pixel.b));
                pixel = glm::max(pixel, Rgb(0.0f));
            }
    }

private:
    std::unique_ptr<RadianceRows> stored_;
    std::string name_;
};

}  // namespace

void ImageRows::read(int first, Image<Rgb>& rows)
{
    INSITU_CHECK(rows.width() == width() && first >= 0 && first + rows.height() <= height(),
                 "rows {} to {} of {}",
                 first,
                 first + rows.height(),
                 height());
    const auto from = image_.pixels().subspan(
        static_cast<std::size_t>(first) * static_cast<std::size_t>(width()), rows.pixelCount());
    std::ranges::copy(from, rows.pixels().begin());
}

std::unique_ptr<RadianceRows> openRadianceRows(const std::filesystem::path& path,
                                               std::int64_t max_pixels)
{
    return std::make_unique<CheckedRows>(openStored(path, max_pixels), path.string());
}

bool isRadianceFile(const std::filesystem::path& path)
{
    const std::string extension = lowerCaseExtension(path);
    return extension == ".exr" || extension == ".hdr" || extension == ".pic" || extension == ".pfm";
}

RadianceImage readRadiance(const std::filesystem::path& path, std::int64_t max_pixels)
{
    const auto rows = openRadianceRows(path, max_pixels);
    RadianceImage image;
    image.pixels = Image<Rgb>(rows->width(), rows->height());
    rows->read(0, image.pixels);
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
