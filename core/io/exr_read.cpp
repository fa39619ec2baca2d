#include "core/io/encoded_header.h"
#include "core/io/image_io.h"
#include "core/io/radiance_formats.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfChromaticitiesAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfVersion.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

namespace insitu {

namespace {

using Imath::Box2i;

/// Wider and higher images are refused, and so are larger tiles, since OpenEXR allocates buffers of
/// whole tiles and of up to 256 rows as soon as it has read the header.
constexpr std::int64_t kLargestSide = 1 << 16;
constexpr std::int64_t kLargestTileSide = 1 << 13;
constexpr std::int64_t kLargestBuffer = 2LL << 30;
constexpr std::int64_t kRowsPerBuffer = 256;
/// Pixels outside the data window are made, not read: at most this many per pixel read.
constexpr std::int64_t kLargestPadding = 64;

std::int64_t bytesPerPixel(const Imf::ChannelList& channels)
{
    std::int64_t bytes = 0;
    for (auto it = channels.begin(); it != channels.end(); ++it)
        bytes += it.channel().type == Imf::HALF ? 2 : 4;
    return bytes;
}

std::int64_t widthOf(const Box2i& box)
{
    return static_cast<std::int64_t>(box.max.x) - box.min.x + 1;
}

std::int64_t heightOf(const Box2i& box)
{
    return static_cast<std::int64_t>(box.max.y) - box.min.y + 1;
}

/// Reads the first part's header alone and refuses what would make OpenEXR allocate too much.
void checkHeader(const std::string& name, std::int64_t max_pixels)
{
    Imf::StdIFStream stream(name.c_str());
    std::array<char, 8> start{};
    stream.read(start.data(), static_cast<int>(start.size()));
    int version = 0;
    for (int i = 3; i >= 0; --i)
        version = version << 8 | static_cast<unsigned char>(start[static_cast<std::size_t>(4 + i)]);
    Imf::Header header;
    header.readFrom(stream, version);
    if (Imf::isNonImage(version) || (header.hasType() && Imf::isDeepData(header.type())))
        throw InputError(name, "is a deep EXR; flatten it first");
    const Box2i& window = header.dataWindow();
    checkImageSize(name, widthOf(window), heightOf(window), max_pixels);
    const std::int64_t width = widthOf(window);
    const std::int64_t pixel_bytes = bytesPerPixel(header.channels());
    const bool too_wide = width > kLargestSide || heightOf(window) > kLargestSide;
    if (too_wide || pixel_bytes * width * kRowsPerBuffer > kLargestBuffer)
        throw InputError(name,
                         fmt::format("is {}x{} pixels of {} bytes; sides up to {} are read",
                                     width,
                                     heightOf(window),
                                     pixel_bytes,
                                     kLargestSide));
    if (!header.hasTileDescription()) return;
    const Imf::TileDescription& tile = header.tileDescription();
    const bool too_large = tile.xSize > kLargestTileSide || tile.ySize > kLargestTileSide;
    if (too_large ||
        static_cast<std::int64_t>(tile.xSize) * tile.ySize * pixel_bytes > kLargestBuffer)
        throw InputError(name, fmt::format("has tiles of {}x{} pixels", tile.xSize, tile.ySize));
}

void limitLibrary()
{
    static const bool done = [] {
        Imf::Header::setMaxImageSize(kLargestSide, kLargestSide);
        Imf::Header::setMaxTileSize(kLargestTileSide, kLargestTileSide);
        return true;
    }();
    (void)done;
}

/// Runs `read` with the header checked; what OpenEXR throws becomes an InputError.
template <class Read>
auto withFile(const std::filesystem::path& path, std::int64_t max_pixels, const Read& read)
{
    const std::string name = path.string();
    try {
        limitLibrary();
        checkHeader(name, max_pixels);
        return read();
    } catch (const InputError&) {
        throw;
    } catch (const std::exception& error) {
        throw InputError(name, fmt::format("cannot be read as OpenEXR: {}", error.what()));
    }
}

std::string channelNames(const Imf::ChannelList& channels)
{
    std::string names;
    for (auto it = channels.begin(); it != channels.end() && names.size() < 400; ++it)
        names += fmt::format("{}{}", names.empty() ? "" : ", ", it.name());
    return names;
}

/// Names of the channels that become red, green and blue: plain R G B, else Y, else those of the
/// only layer that has the three.
std::array<std::string, 3> chooseChannels(const Imf::ChannelList& channels, const std::string& name)
{
    const auto has = [&](const std::string& channel) {
        return channels.findChannel(channel) != nullptr;
    };
    if (has("R") && has("G") && has("B")) return {"R", "G", "B"};
    if (has("RY") || has("BY"))
        throw InputError(name, "holds luminance and chroma; save it with R, G and B");
    if (has("Y")) return {"Y", "Y", "Y"};
    std::vector<std::string> layers;
    for (auto it = channels.begin(); it != channels.end(); ++it) {
        const std::string channel = it.name();
        if (!channel.ends_with(".R")) continue;
        const std::string layer = channel.substr(0, channel.size() - 1);
        if (has(layer + "G") && has(layer + "B")) layers.push_back(layer);
    }
    if (layers.size() == 1) return {layers[0] + "R", layers[0] + "G", layers[0] + "B"};
    throw InputError(name,
                     fmt::format("has no R, G, B or Y and {} coloured layers; its channels are {}",
                                 layers.empty() ? "no" : "several",
                                 channelNames(channels)));
}

void checkSampling(const Imf::ChannelList& channels,
                   const std::string& channel,
                   const std::string& name)
{
    const Imf::Channel* found = channels.findChannel(channel);
    if (found != nullptr && (found->xSampling != 1 || found->ySampling != 1))
        throw InputError(name, fmt::format("channel {} is subsampled", channel));
}

/// Gives OpenEXR one float of every pixel to fill; `first` is the one of the window's corner.
void insertSlice(Imf::FrameBuffer& buffer,
                 const std::string& channel,
                 float* first,
                 std::size_t pixel_bytes,
                 const Box2i& window)
{
    buffer.insert(channel,
                  Imf::Slice::Make(Imf::FLOAT,
                                   first,
                                   window,
                                   pixel_bytes,
                                   pixel_bytes * static_cast<std::size_t>(widthOf(window))));
}

// --- Colour -----------------------------------------------------------------------------------

bool near(const Imath::V2f& a, const Imath::V2f& b)
{
    constexpr float kChromaticityStep = 1e-3f;  // standards state three or four digits
    return std::abs(a.x - b.x) < kChromaticityStep && std::abs(a.y - b.y) < kChromaticityStep;
}

glm::dmat3 xyzFromRgb(const Imf::Chromaticities& primaries)
{
    const Imath::M44f m = Imf::RGBtoXYZ(primaries, 1.0f);
    glm::dmat3 result;
    for (int i = 0; i < 3; ++i)  // OpenEXR multiplies row vectors: its rows are our columns
        for (int j = 0; j < 3; ++j)
            result[i][j] = m[i][j];
    return result;
}

/// Linear Rec. 709 from the file's primaries, white to white by the Bradford cone responses
/// (ICC.1:2010, annex E).
glm::dmat3 rec709From(const Imf::Chromaticities& primaries)
{
    const glm::dmat3 bradford(
        0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296);
    const glm::dmat3 from = xyzFromRgb(primaries);
    const glm::dmat3 to = xyzFromRgb(Imf::Chromaticities());
    const glm::dvec3 white_ratio =
        (bradford * (to * glm::dvec3(1.0))) / (bradford * (from * glm::dvec3(1.0)));
    glm::dmat3 scale(1.0);
    for (int i = 0; i < 3; ++i)
        scale[i][i] = white_ratio[i];
    return glm::inverse(to) * glm::inverse(bradford) * scale * bradford * from;
}

/// To linear Rec. 709 from the header's primaries; nothing when they are these.
std::optional<glm::mat3> conversionOf(const Imf::Header& header, const std::string& name)
{
    if (!Imf::hasChromaticities(header)) return std::nullopt;
    const Imf::Chromaticities& c = Imf::chromaticities(header);
    const Imf::Chromaticities rec709;
    if (near(c.red, rec709.red) && near(c.green, rec709.green) && near(c.blue, rec709.blue) &&
        near(c.white, rec709.white))
        return std::nullopt;
    const glm::dmat3 m = rec709From(c);
    for (int i = 0; i < 3; ++i)
        if (!std::isfinite(m[i].x + m[i].y + m[i].z))
            throw InputError(name, "its chromaticities are not those of a colour space");
    return glm::mat3(m);
}

/// The display window, cut out of or padded around the data window.
class ExrRows : public RadianceRows {
public:
    ExrRows(const std::string& name, std::int64_t max_pixels) : name_(name), file_(name.c_str())
    {
        const Imf::Header& header = file_.header();
        channels_ = chooseChannels(header.channels(), name_);
        for (const std::string& channel : channels_)
            checkSampling(header.channels(), channel, name_);
        conversion_ = conversionOf(header, name_);
        window_ = header.dataWindow();
        display_ = header.displayWindow();
        if (window_ != display_)
            checkImageSize(
                name_,
                widthOf(display_),
                heightOf(display_),
                std::min(max_pixels, widthOf(window_) * heightOf(window_) * kLargestPadding));
    }
    [[nodiscard]] int width() const override { return static_cast<int>(widthOf(display_)); }
    [[nodiscard]] int height() const override { return static_cast<int>(heightOf(display_)); }
    void read(int first, Image<Rgb>& rows) override
    {
        try {
            readStrip(first, rows);
        } catch (const std::exception& error) {
            throw InputError(name_, fmt::format("cannot be read as OpenEXR: {}", error.what()));
        }
    }

private:
    void readStrip(int first, Image<Rgb>& rows)
    {
        const int top = display_.min.y + first;
        const int y0 = std::max(window_.min.y, top);
        const int y1 = std::min(window_.max.y, top + rows.height() - 1);
        const bool same_columns =
            window_.min.x == display_.min.x && window_.max.x == display_.max.x;
        if (same_columns && y0 == top && y1 == top + rows.height() - 1)
            return readColors(y0, y1, rows);
        std::ranges::fill(rows.pixels(), Rgb(0.0f));
        if (y0 > y1) return;
        Image<Rgb> data(static_cast<int>(widthOf(window_)), y1 - y0 + 1);
        readColors(y0, y1, data);
        const int x0 = std::max(window_.min.x, display_.min.x);
        const int x1 = std::min(window_.max.x, display_.max.x);
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x)
                rows(x - display_.min.x, y - top) = data(x - window_.min.x, y - y0);
    }

    /// All columns of the data window, rows y0 to y1 of the file.
    void readColors(int y0, int y1, Image<Rgb>& data)
    {
        const Box2i strip({window_.min.x, y0}, {window_.max.x, y1});
        const bool grey = channels_[0] == channels_[1];
        Imf::FrameBuffer buffer;
        for (int c = 0; c < (grey ? 1 : 3); ++c)
            insertSlice(buffer,
                        channels_[static_cast<std::size_t>(c)],
                        &data.pixels()[0][c],
                        sizeof(Rgb),
                        strip);
        file_.setFrameBuffer(buffer);
        file_.readPixels(y0, y1);
        if (grey)
            for (Rgb& pixel : data.pixels())
                pixel = Rgb(pixel.r);
        if (conversion_)
            for (Rgb& pixel : data.pixels())
                pixel = *conversion_ * pixel;
    }

    std::string name_;
    Imf::InputFile file_;
    std::array<std::string, 3> channels_;
    std::optional<glm::mat3> conversion_;
    Box2i window_, display_;
};

}  // namespace

bool isExr(std::span<const std::uint8_t> bytes)
{
    constexpr std::array<std::uint8_t, 4> kMagic = {0x76, 0x2F, 0x31, 0x01};
    return bytes.size() > kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), bytes.begin());
}

std::unique_ptr<RadianceRows> openExr(const std::filesystem::path& path, std::int64_t max_pixels)
{
    return withFile(path, max_pixels, [&]() -> std::unique_ptr<RadianceRows> {
        return std::make_unique<ExrRows>(path.string(), max_pixels);
    });
}

std::vector<ExrChannel> readLayeredExr(const std::filesystem::path& path, std::int64_t max_pixels)
{
    const std::string name = path.string();
    return withFile(path, max_pixels, [&] {
        Imf::InputFile file(name.c_str());
        const Imf::ChannelList& channels = file.header().channels();
        const Box2i window = file.header().dataWindow();
        std::vector<ExrChannel> result;
        for (auto it = channels.begin(); it != channels.end(); ++it) {
            checkSampling(channels, it.name(), name);
            result.push_back({it.name(), {}});
        }
        const auto count = static_cast<std::int64_t>(result.size());
        checkImageSize(name, widthOf(window), heightOf(window) * count, 3 * max_pixels);
        Imf::FrameBuffer buffer;
        for (ExrChannel& channel : result) {
            channel.values =
                Image<float>(static_cast<int>(widthOf(window)), static_cast<int>(heightOf(window)));
            insertSlice(
                buffer, channel.name, channel.values.pixels().data(), sizeof(float), window);
        }
        file.setFrameBuffer(buffer);
        file.readPixels(window.min.y, window.max.y);
        return result;
    });
}

}  // namespace insitu
