#include "core/io/radiance_rows.h"

#include "core/random.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/file_bytes.h"
#include "tests/support/temporary_folder.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Image<Rgb> randomRadiance(int width, int height)
{
    Image<Rgb> image(width, height);
    RandomStream random(5, 0, 0);
    for (Rgb& pixel : image.pixels())
        for (int c = 0; c < 3; ++c)
            pixel[c] = std::exp2(random.uniform() * 24.0f - 12.0f);
    return image;
}

/// Every strip that starts at a multiple of `step`, and then some backwards, are parts of the
/// whole.
void expectStripsOfTheWhole(const fs::path& path)
{
    const Image<Rgb> whole = readRadiance(path).pixels;
    const auto rows = openRadianceRows(path);
    ASSERT_EQ(rows->width(), whole.width());
    ASSERT_EQ(rows->height(), whole.height());
    const auto expectStrip = [&](int first, int count) {
        Image<Rgb> strip(whole.width(), count);
        rows->read(first, strip);
        for (int y = 0; y < count; ++y)
            for (int x = 0; x < whole.width(); ++x)
                ASSERT_EQ(strip(x, y), whole(x, first + y)) << path << ' ' << x << ' ' << first + y;
    };
    constexpr int kStep = 7;
    for (int first = 0; first < whole.height(); first += kStep)
        expectStrip(first, std::min(kStep, whole.height() - first));
    for (int first = whole.height() - 3; first >= 0; first -= 5)
        expectStrip(first, 3);
    expectStrip(0, whole.height());
}

/// An EXR of these pixels whose header `change` alters, by scan lines or by tiles of 16x16.
void writeSpecialExr(const fs::path& path,
                     Image<Rgb>& image,
                     bool tiled,
                     const std::function<void(Imf::Header&)>& change)
{
    Imf::Header header(image.width(), image.height());
    header.compression() = Imf::PIZ_COMPRESSION;
    change(header);
    Imf::FrameBuffer buffer;
    const char* const names[] = {"R", "G", "B"};
    for (int c = 0; c < 3; ++c) {
        header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
        buffer.insert(names[c],
                      Imf::Slice::Make(Imf::FLOAT,
                                       &image(0, 0)[c],
                                       header.dataWindow(),
                                       sizeof(Rgb),
                                       sizeof(Rgb) * static_cast<std::size_t>(image.width())));
    }
    if (!tiled) {
        Imf::OutputFile file(path.c_str(), header);
        file.setFrameBuffer(buffer);
        file.writePixels(image.height());
        return;
    }
    header.setTileDescription(Imf::TileDescription(16, 16));
    Imf::TiledOutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
}

TEST(RadianceRows, StripsOfOpenExrAreThoseOfTheWhole)
{
    const TemporaryFolder folder;
    Image<Rgb> image = randomRadiance(37, 61);
    writeSpecialExr(folder / "lines.exr", image, false, [](Imf::Header&) {});
    expectStripsOfTheWhole(folder / "lines.exr");
    writeSpecialExr(folder / "tiles.exr", image, true, [](Imf::Header&) {});
    expectStripsOfTheWhole(folder / "tiles.exr");
    // Windows that overlap in part: rows and columns outside the data are black.
    const auto shifted = [](Imf::Header& header) {
        header.displayWindow() = Imath::Box2i({-3, 10}, {29, 80});
    };
    writeSpecialExr(folder / "shifted.exr", image, false, shifted);
    expectStripsOfTheWhole(folder / "shifted.exr");
    writeSpecialExr(folder / "shifted-tiles.exr", image, true, shifted);
    expectStripsOfTheWhole(folder / "shifted-tiles.exr");
}

TEST(RadianceRows, StripsOfRadianceAndPfmAreThoseOfTheWhole)
{
    const TemporaryFolder folder;
    const Image<Rgb> image = randomRadiance(37, 61);
    for (const char* name : {"plain.hdr", "plain.pfm"}) {
        writeRadiance(folder / name, image);
        expectStripsOfTheWhole(folder / name);
    }
    // The other seven orders of pixels, flat: "-Y 2 +X 3" and so on.
    for (const char* size :
         {"-Y 12 -X 5", "+Y 12 +X 5", "+Y 12 -X 5", "+X 12 -Y 5", "-X 12 +Y 5"}) {
        std::string bytes = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n";
        bytes += size;
        bytes += '\n';
        for (int i = 0; i < 60; ++i)
            bytes +=
                {static_cast<char>(10 + i), static_cast<char>(100 - i), 7, static_cast<char>(128)};
        expectStripsOfTheWhole(folder.add("order.hdr", bytes));
    }
}

TEST(RadianceRows, AFlawIsFoundInItsStripWithItsPlace)
{
    const TemporaryFolder folder;
    Image<Rgb> image = randomRadiance(20, 40);
    image(3, 33).g = std::numeric_limits<float>::quiet_NaN();
    writeSpecialExr(folder / "nan.exr", image, false, [](Imf::Header&) {});
    const auto rows = openRadianceRows(folder / "nan.exr");
    Image<Rgb> strip(20, 20);
    rows->read(0, strip);
    EXPECT_THAT(inputErrorOf([&] { rows->read(20, strip); }), HasSubstr("pixel (3, 33)"));

    writeRadiance(folder / "whole.hdr", randomRadiance(20, 40));
    std::string cut = fileBytes(folder / "whole.hdr");
    cut.resize(cut.size() * 3 / 4);
    const auto damaged = openRadianceRows(folder.add("cut.hdr", cut));
    damaged->read(0, strip);
    EXPECT_THAT(inputErrorOf([&] { damaged->read(20, strip); }), HasSubstr("end early"));
    EXPECT_THAT(inputErrorOf([&] { (void)openRadianceRows(folder.add("empty.exr", "")); }),
                HasSubstr("is not an OpenEXR"));
    EXPECT_THAT(inputErrorOf([&] { (void)openRadianceRows(folder / "none.exr"); }),
                HasSubstr("no such file"));
}

TEST(ImageRows, AreTheImages)
{
    const Image<Rgb> image = randomRadiance(5, 9);
    ImageRows rows(image);
    Image<Rgb> strip(5, 4);
    rows.read(3, strip);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 5; ++x)
            EXPECT_EQ(strip(x, y), image(x, y + 3));
}

}  // namespace
}  // namespace insitu
