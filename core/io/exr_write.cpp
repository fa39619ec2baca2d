#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/io/radiance_formats.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// The largest finite half.
constexpr float kLargestHalf = 65504.0f;

Imf::Header makeHeader(int width, int height)
{
    Imf::Header header(width, height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::addChromaticities(header, Imf::Chromaticities());  // Rec. 709, D65
    return header;
}

/// OpenEXR takes a non-const pointer for files that it only reads from.
char* sliceBase(const float* first)
{
    return const_cast<char*>(reinterpret_cast<const char*>(first));
}

void writeFile(const std::filesystem::path& path,
               const Imf::Header& header,
               const Imf::FrameBuffer& buffer,
               int rows)
{
    writeAtomically(path, [&](const std::filesystem::path& temporary) {
        try {
            Imf::OutputFile file(temporary.string().c_str(), header);
            file.setFrameBuffer(buffer);
            file.writePixels(rows);
        } catch (const std::exception& error) {
            // The user knows nothing of the temporary name.
            std::string cause = error.what();
            const auto at = cause.find(temporary.string());
            if (at != std::string::npos)
                cause.replace(at, temporary.string().size(), path.string());
            throw InputError(path.string(), "cannot be written: " + cause);
        }
    });
}

/// Half pixels of the image, clamped to what a half can hold.
std::vector<half> halvesOf(const Image<Rgb>& image)
{
    std::vector<half> values;
    values.reserve(image.pixelCount() * 3);
    for (const Rgb& pixel : image.pixels())
        for (int c = 0; c < 3; ++c)
            values.emplace_back(std::clamp(pixel[c], -kLargestHalf, kLargestHalf));
    return values;
}

}  // namespace

void writeExr(const std::filesystem::path& path, const Image<Rgb>& image, bool as_half)
{
    Imf::Header header = makeHeader(image.width(), image.height());
    const Imf::PixelType type = as_half ? Imf::HALF : Imf::FLOAT;
    const std::vector<half> halves = as_half ? halvesOf(image) : std::vector<half>();
    const std::size_t value_bytes = as_half ? sizeof(half) : sizeof(float);
    const char* first = as_half ? reinterpret_cast<const char*>(halves.data())
                                : reinterpret_cast<const char*>(image.pixels().data());
    Imf::FrameBuffer buffer;
    const char* const names[] = {"R", "G", "B"};
    for (std::size_t c = 0; c < 3; ++c) {
        header.channels().insert(names[c], Imf::Channel(type));
        buffer.insert(names[c],
                      Imf::Slice(type,
                                 const_cast<char*>(first) + c * value_bytes,
                                 3 * value_bytes,
                                 3 * value_bytes * static_cast<std::size_t>(image.width())));
    }
    writeFile(path, header, buffer, image.height());
}

void addColorLayer(std::vector<ExrChannel>& channels,
                   const std::string& layer,
                   const Image<Rgb>& image)
{
    const std::string prefix = layer.empty() ? "" : layer + ".";
    for (int c = 0; c < 3; ++c) {
        ExrChannel channel{prefix + "RGB"[c], Image<float>(image.width(), image.height())};
        std::ranges::transform(image.pixels(),
                               channel.values.pixels().begin(),
                               [c](const Rgb& pixel) { return pixel[c]; });
        channels.push_back(std::move(channel));
    }
}

void writeLayeredExr(const std::filesystem::path& path, const std::vector<ExrChannel>& channels)
{
    INSITU_CHECK(!channels.empty() && !channels.front().values.empty(), "nothing to write");
    const Image<float>& first = channels.front().values;
    Imf::Header header = makeHeader(first.width(), first.height());
    Imf::FrameBuffer buffer;
    for (const ExrChannel& channel : channels) {
        INSITU_CHECK(channel.values.sameSize(first), "channel {} has another size", channel.name);
        for (const float value : channel.values.pixels())
            INSITU_CHECK(std::isfinite(value), "channel {} holds {}", channel.name, value);
        INSITU_CHECK(header.channels().findChannel(channel.name) == nullptr,
                     "two channels are named {}",
                     channel.name);
        header.channels().insert(channel.name, Imf::Channel(Imf::FLOAT));
        buffer.insert(channel.name,
                      Imf::Slice(Imf::FLOAT,
                                 sliceBase(channel.values.pixels().data()),
                                 sizeof(float),
                                 sizeof(float) * static_cast<std::size_t>(first.width())));
    }
    writeAtomically(
        path, [&](const auto& temporary) { writeFile(temporary, header, buffer, first.height()); });
}

}  // namespace insitu
