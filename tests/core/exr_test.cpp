#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfRgbaFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfTiledRgbaFile.h>
#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace insitu {
namespace {

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

/// Half pixels (x + 10·y, 0.25, 2, alpha 0.5): exact in half.
std::vector<Imf::Rgba> halfPixels(int width, int height)
{
    std::vector<Imf::Rgba> pixels;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            pixels.emplace_back(static_cast<float>(x + 10 * y), 0.25f, 2.0f, 0.5f);
    return pixels;
}

/// An EXR of float channels, all of them holding `values`.
void writeChannels(const std::filesystem::path& path,
                   Imf::Header header,
                   const std::vector<std::string>& names,
                   std::vector<float> values)
{
    Imf::FrameBuffer buffer;
    for (const std::string& name : names) {
        header.channels().insert(name, Imf::Channel(Imf::FLOAT));
        buffer.insert(name,
                      Imf::Slice::Make(Imf::FLOAT,
                                       values.data(),
                                       header.dataWindow(),
                                       sizeof(float),
                                       sizeof(float) * (header.dataWindow().size().x + 1)));
    }
    Imf::OutputFile file(path.string().c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(header.dataWindow().size().y + 1);
}

TEST(Exr, FloatRoundTripIsExactAndStatesItsPrimaries)
{
    const TemporaryFolder folder;
    const Image<Rgb> image = randomRadiance(33, 21);
    writeRadiance(folder / "a.exr", image);
    EXPECT_EQ(readRadiance(folder / "a.exr").pixels, image);
    const Imf::InputFile file((folder / "a.exr").string().c_str());
    EXPECT_TRUE(Imf::hasChromaticities(file.header()));
    EXPECT_EQ(folder.size(), 1u);
}

TEST(Exr, HalfIsTheNearestHalfAndClamped)
{
    const TemporaryFolder folder;
    Image<Rgb> image = randomRadiance(33, 21);
    image(3, 4) = Rgb(1e6f, 0.0f, 65504.0f);
    writeRadiance(folder / "a.exr", image, /*half=*/true);
    const Image<Rgb> read = readRadiance(folder / "a.exr").pixels;
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
            for (int c = 0; c < 3; ++c) {
                const float expected = std::min(image(x, y)[c], 65504.0f);
                EXPECT_EQ(read(x, y)[c], static_cast<float>(half(expected)));
            }
}

TEST(Exr, ReadsWhatOpenExrWrites)
{
    const TemporaryFolder folder;
    const auto path = folder / "a.exr";
    const std::vector<Imf::Rgba> pixels = halfPixels(19, 7);
    const auto check = [&](const char* what) {
        const Image<Rgb> image = readRadiance(path).pixels;
        ASSERT_EQ(image.width(), 19) << what;
        ASSERT_EQ(image.height(), 7) << what;
        for (int y = 0; y < 7; ++y)
            for (int x = 0; x < 19; ++x)
                EXPECT_EQ(image(x, y), Rgb(static_cast<float>(x + 10 * y), 0.25f, 2.0f)) << what;
    };
    for (const auto compression :
         {Imf::NO_COMPRESSION, Imf::PIZ_COMPRESSION, Imf::RLE_COMPRESSION}) {
        Imf::RgbaOutputFile file(path.string().c_str(),
                                 19,
                                 7,
                                 Imf::WRITE_RGBA,
                                 1,
                                 Imath::V2f(0),
                                 1,
                                 Imf::DECREASING_Y,
                                 compression);
        file.setFrameBuffer(pixels.data(), 1, 19);
        file.writePixels(7);
    }
    check("scan lines");
    {
        Imf::TiledRgbaOutputFile file(path.string().c_str(),
                                      19,
                                      7,
                                      8,
                                      8,
                                      Imf::MIPMAP_LEVELS,
                                      Imf::ROUND_DOWN,
                                      Imf::WRITE_RGB);
        for (int level = 0; level < file.numLevels(); ++level) {
            const std::vector<Imf::Rgba> other(19 * 7, Imf::Rgba(99, 99, 99));
            file.setFrameBuffer(level == 0 ? pixels.data() : other.data(), 1, 19);
            file.writeTiles(0, file.numXTiles(level) - 1, 0, file.numYTiles(level) - 1, level);
        }
    }
    check("tiles with levels");
}

TEST(Exr, LuminanceAloneIsGrey)
{
    const TemporaryFolder folder;
    writeChannels(folder / "a.exr", Imf::Header(2, 1), {"Y"}, {0.5f, 3.0f});
    const Image<Rgb> image = readRadiance(folder / "a.exr").pixels;
    EXPECT_EQ(image(0, 0), Rgb(0.5f));
    EXPECT_EQ(image(1, 0), Rgb(3.0f));
}

TEST(Exr, TheOnlyColouredLayerIsTaken)
{
    const TemporaryFolder folder;
    const std::vector<std::string> one = {"View.B", "View.G", "View.R", "Depth.Z"};
    writeChannels(folder / "a.exr", Imf::Header(2, 1), one, {0.5f, 3.0f});
    EXPECT_EQ(readRadiance(folder / "a.exr").pixels(1, 0), Rgb(3.0f));

    std::vector<std::string> two = one;
    two.insert(two.end(), {"Other.R", "Other.G", "Other.B"});
    writeChannels(folder / "b.exr", Imf::Header(2, 1), two, {0.5f, 3.0f});
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(folder / "b.exr"); }),
                HasSubstr("Other.B, Other.G, Other.R, View.B"));
}

TEST(Exr, NotANumberIsRefusedWithItsPixel)
{
    const TemporaryFolder folder;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    writeChannels(folder / "a.exr", Imf::Header(3, 2), {"R", "G", "B"}, {1, 1, 1, 1, nan, 1});
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(folder / "a.exr"); }),
                HasSubstr("pixel (1, 1)"));
    writeChannels(folder / "b.exr", Imf::Header(3, 2), {"R", "G", "B"}, {1, 1, infinity, 1, 1, 1});
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(folder / "b.exr"); }),
                HasSubstr("pixel (2, 0)"));
    Image<Rgb> image(2, 2, Rgb(1.0f));
    image(0, 1).g = nan;
    for (const char* name : {"c.exr", "c.hdr", "c.pfm"})
        EXPECT_THROW(writeRadiance(folder / name, image), LogicError) << name;
    EXPECT_EQ(folder.size(), 2u);
}

TEST(Exr, NegativeBecomesZero)
{
    const TemporaryFolder folder;
    writeChannels(folder / "a.exr", Imf::Header(2, 1), {"R", "G", "B"}, {-0.5f, 3.0f});
    const Image<Rgb> image = readRadiance(folder / "a.exr").pixels;
    EXPECT_EQ(image(0, 0), Rgb(0.0f));
    EXPECT_EQ(image(1, 0), Rgb(3.0f));
}

TEST(Exr, ShowsTheDisplayWindow)
{
    const TemporaryFolder folder;
    // 4x3 shown; stored are the 2x2 pixels from (3, 1): one column of them lies outside.
    const Imath::Box2i display(Imath::V2i(0, 0), Imath::V2i(3, 2));
    const Imath::Box2i data(Imath::V2i(3, 1), Imath::V2i(4, 2));
    writeChannels(folder / "a.exr", Imf::Header(display, data), {"R", "G", "B"}, {1, 2, 3, 4});
    const Image<Rgb> image = readRadiance(folder / "a.exr").pixels;
    Image<Rgb> expected(4, 3);
    expected(3, 1) = Rgb(1.0f);
    expected(3, 2) = Rgb(3.0f);
    EXPECT_EQ(image, expected);
}

// White stays white whatever the primaries (both are D65-adapted), and a Rec. 2020 colour gets the
// coordinates of ITU-R BT.2087-0, table 2 (inverse): printed there to four digits.
TEST(Exr, OtherPrimariesAreConverted)
{
    const TemporaryFolder folder;
    Imf::Header header(3, 1);
    const Imath::V2f d65(0.3127f, 0.3290f);
    Imf::addChromaticities(
        header, Imf::Chromaticities({0.708f, 0.292f}, {0.170f, 0.797f}, {0.131f, 0.046f}, d65));
    for (const char* name : {"R", "G", "B"})
        header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    // White; (1, 0.5, 0.5); grey.
    std::vector<glm::vec3> pixels = {glm::vec3(1.0f), {1.0f, 0.5f, 0.5f}, glm::vec3(0.2f)};
    Imf::FrameBuffer buffer;
    const char* names[] = {"R", "G", "B"};
    for (int c = 0; c < 3; ++c)
        buffer.insert(names[c],
                      Imf::Slice(Imf::FLOAT,
                                 reinterpret_cast<char*>(&pixels[0][c]),
                                 sizeof(glm::vec3),
                                 3 * sizeof(glm::vec3)));
    {
        Imf::OutputFile file((folder / "a.exr").string().c_str(), header);
        file.setFrameBuffer(buffer);
        file.writePixels(1);
    }
    const Image<Rgb> image = readRadiance(folder / "a.exr").pixels;
    constexpr double kPrinted = 2e-4;  // four digits of the matrix in BT.2087
    // First column of the 2020-to-709 matrix: 1.6605, -0.1246, -0.0182.
    const glm::dvec3 expected(0.5 + 0.5 * 1.6605, 0.5 - 0.5 * 0.1246, 0.5 - 0.5 * 0.0182);
    for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(image(0, 0)[c], 1.0, tolerance::kFloat);
        EXPECT_NEAR(image(1, 0)[c], expected[c], kPrinted);
        EXPECT_NEAR(image(2, 0)[c], 0.2, tolerance::kFloat);
    }
}

TEST(Exr, WhiteOfAnotherIlluminantStaysWhite)
{
    const TemporaryFolder folder;
    Imf::Header header(1, 1);
    // ACES AP0: white near D60.
    Imf::addChromaticities(
        header,
        Imf::Chromaticities(
            {0.7347f, 0.2653f}, {0.0f, 1.0f}, {0.0001f, -0.077f}, {0.32168f, 0.33767f}));
    writeChannels(folder / "a.exr", header, {"R", "G", "B"}, {0.7f});
    const Rgb white = readRadiance(folder / "a.exr").pixels(0, 0);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(white[c], 0.7, 0.7 * tolerance::kFloat);
}

TEST(Exr, LayersComeBackByName)
{
    const TemporaryFolder folder;
    std::vector<ExrChannel> channels;
    for (const char* name : {"object.R", "alpha", "depth.Z"})
        channels.push_back({name, Image<float>(5, 4, static_cast<float>(channels.size()) - 1.5f)});
    channels[0].values(3, 2) = 1e6f;
    writeLayeredExr(folder / "a.exr", channels);
    const std::vector<ExrChannel> read = readLayeredExr(folder / "a.exr");
    ASSERT_EQ(read.size(), 3u);
    EXPECT_EQ(read[0].name, "alpha");
    EXPECT_EQ(read[0].values, channels[1].values);
    EXPECT_EQ(read[1].name, "depth.Z");
    EXPECT_EQ(read[1].values, channels[2].values);
    EXPECT_EQ(read[2].name, "object.R");
    EXPECT_EQ(read[2].values, channels[0].values);
    EXPECT_EQ(folder.size(), 1u);

    channels[1].values = Image<float>(4, 4);
    EXPECT_THROW(writeLayeredExr(folder / "b.exr", channels), LogicError);
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(folder / "a.exr"); }),
                HasSubstr("has no R, G, B or Y"));
}

TEST(Exr, AColourLayerStandsBesideThePlainImage)
{
    const TemporaryFolder folder;
    std::vector<ExrChannel> channels;
    addColorLayer(channels, "variance", Image<Rgb>(3, 2, Rgb(4.0f, 5.0f, 6.0f)));
    addColorLayer(channels, "", Image<Rgb>(3, 2, Rgb(1.0f, 2.0f, 3.0f)));
    writeLayeredExr(folder / "a.exr", channels);
    EXPECT_EQ(readRadiance(folder / "a.exr").pixels(2, 1), Rgb(1.0f, 2.0f, 3.0f));
    const std::vector<ExrChannel> read = readLayeredExr(folder / "a.exr");
    ASSERT_EQ(read.size(), 6u);
    EXPECT_EQ(read[3].name, "variance.B");
    EXPECT_EQ(read[3].values(0, 0), 6.0f);
    EXPECT_EQ(read[5].name, "variance.R");
    EXPECT_EQ(read[5].values(2, 1), 4.0f);
}

TEST(Exr, ChecksTheDeclaredSizeBeforeAllocating)
{
    const TemporaryFolder folder;
    writeRadiance(folder / "a.exr", randomRadiance(40, 50));
    EXPECT_NO_THROW((void)readRadiance(folder / "a.exr", 2000));
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(folder / "a.exr", 1999); }),
                HasSubstr("declares 40x50 pixels; at most 1999"));
    EXPECT_THAT(inputErrorOf([&] { (void)readLayeredExr(folder / "a.exr", 1999); }),
                HasSubstr("at most 1999"));
    // A display window far larger than what is stored would be made of nothing.
    const Imath::Box2i display(Imath::V2i(0, 0), Imath::V2i(9999, 9999));
    const Imath::Box2i data(Imath::V2i(0, 0), Imath::V2i(0, 0));
    writeChannels(folder / "b.exr", Imf::Header(display, data), {"R", "G", "B"}, {1.0f});
    EXPECT_THAT(inputErrorOf([&] { (void)readRadiance(folder / "b.exr"); }),
                HasSubstr("declares 10000x10000"));
}

TEST(Exr, FailsToWriteIntoAMissingFolder)
{
    const TemporaryFolder folder;
    const std::string message =
        inputErrorOf([&] { writeRadiance(folder / "no" / "a.exr", randomRadiance(4, 4)); });
    EXPECT_THAT(message, HasSubstr("cannot be written"));
    EXPECT_THAT(message, HasSubstr("/no/a.exr"));
    EXPECT_THAT(inputErrorOf([&] { writeRadiance(folder / "a.png", randomRadiance(4, 4)); }),
                HasSubstr(".exr, .hdr or .pfm"));
}

TEST(Exr, ReadsRealOnes)
{
    INSITU_NEEDS_DATA();
    const Image<Rgb> mipmapped =
        readRadiance(dataFolder() / "hdri" / "openexr_StageEnvLatLong.exr").pixels;
    EXPECT_EQ(mipmapped.width(), 1000);
    EXPECT_EQ(mipmapped.height(), 500);
    const Image<Rgb> panorama =
        readRadiance(dataFolder() / "truth-room-a" / "pano_linear.exr").pixels;
    EXPECT_EQ(panorama.width(), 2 * panorama.height());
}

}  // namespace
}  // namespace insitu
