#include "core/io/byte_writer.h"
#include "core/io/exif.h"
#include "core/io/file.h"
#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>

namespace insitu {
namespace {

using testing::HasSubstr;

EncodedImage randomImage(int width, int height, int max_code, std::uint64_t seed)
{
    EncodedImage image{Image<glm::u16vec3>(width, height), max_code};
    RandomStream random(seed, 0, 0);
    for (glm::u16vec3& code : image.codes.pixels())
        for (int c = 0; c < 3; ++c)
            code[c] =
                static_cast<std::uint16_t>(random.below(static_cast<std::uint32_t>(max_code) + 1));
    return image;
}

/// The independent second reader: OpenCV's own imread, as RGB codes.
Image<glm::u16vec3> readWithOpenCv(const std::filesystem::path& path, int flags)
{
    cv::Mat mat = cv::imread(path.string(), flags);
    mat.convertTo(mat, CV_16U);
    Image<glm::u16vec3> image(mat.cols, mat.rows);
    for (int y = 0; y < mat.rows; ++y)
        for (int x = 0; x < mat.cols; ++x) {
            const auto bgr = mat.at<cv::Vec3w>(y, x);
            image(x, y) = {bgr[2], bgr[1], bgr[0]};
        }
    return image;
}

bool containsBytes(const Bytes& bytes, std::string_view text)
{
    return std::search(bytes.begin(), bytes.end(), text.begin(), text.end(), [](auto a, auto b) {
               return a == static_cast<std::uint8_t>(b);
           }) != bytes.end();
}

TEST(Photo, PngRoundTripKeepsEveryCode)
{
    const TemporaryFolder folder;
    for (const int max_code : {255, 65535}) {
        const EncodedImage image = randomImage(37, 23, max_code, 7);
        const auto path = folder / "a.png";
        writeEncoded(path, image);
        const Photo photo = readPhoto(path);
        EXPECT_EQ(photo.image.max_code, max_code);
        EXPECT_EQ(photo.image.codes, image.codes);
        EXPECT_EQ(readWithOpenCv(path, cv::IMREAD_UNCHANGED), image.codes);
        EXPECT_TRUE(containsBytes(readFile(path), "sRGB"));
        EXPECT_TRUE(photo.metadata.icc.empty());
        EXPECT_FALSE(photo.metadata.exposure.seconds);
    }
    EXPECT_EQ(folder.size(), 1u);
}

TEST(Photo, JpegAgreesWithAnotherReader)
{
    const TemporaryFolder folder;
    EncodedImage image{Image<glm::u16vec3>(61, 47), 255};
    for (int y = 0; y < 47; ++y)
        for (int x = 0; x < 61; ++x)
            image.codes(x, y) = {4 * x, 5 * y, 2 * (x + y)};
    const auto path = folder / "a.jpg";
    writeEncoded(path, image, {}, 100);
    const Image<glm::u16vec3> codes = readPhoto(path).image.codes;
    EXPECT_EQ(codes, readWithOpenCv(path, cv::IMREAD_COLOR));
    for (int y = 0; y < 47; ++y)
        for (int x = 0; x < 61; ++x)
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(codes(x, y)[c], image.codes(x, y)[c], 5);  // 8-bit DCT, 4:2:0 chroma
}

/// A big-endian TIFF directory with nothing but an orientation.
Bytes orientationExif(std::uint8_t orientation)
{
    return {'E', 'x',  'i', 'f', 0, 0, 'M', 'M', 0, 42,          0, 0, 0, 8, 0, 1,
            1,   0x12, 0,   3,   0, 0, 0,   1,   0, orientation, 0, 0, 0, 0, 0, 0};
}

/// A JPEG of 48x32 pixels with that orientation, four flat quarters of different grey.
Bytes orientedJpeg(std::uint8_t orientation)
{
    cv::Mat mat(32, 48, CV_8UC3);
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 48; ++x)
            mat.at<cv::Vec3b>(y, x) =
                cv::Vec3b::all(static_cast<unsigned char>(40 + (x / 24) * 60 + (y / 16) * 120));
    Bytes jpeg;
    cv::imencode(".jpg", mat, jpeg);
    const Bytes exif = orientationExif(orientation);
    Bytes result = {0xFF, 0xD8, 0xFF, 0xE1};
    append16(result, static_cast<std::uint32_t>(exif.size() + 2));
    append(result, exif);
    append(result, std::span(jpeg).subspan(2));
    return result;
}

TEST(Photo, JpegComesUprightForAllEightOrientations)
{
    const TemporaryFolder folder;
    for (std::uint8_t orientation = 1; orientation <= 8; ++orientation) {
        const auto path = folder.add("a.jpg", orientedJpeg(orientation));
        const Photo photo = readPhoto(path);
        EXPECT_EQ(photo.metadata.orientation, orientation);
        // OpenCV turns JPEGs by EXIF itself when asked to.
        EXPECT_EQ(photo.image.codes, readWithOpenCv(path, cv::IMREAD_COLOR)) << int(orientation);
    }
}

TEST(Photo, ClockwiseOrientationPutsTheFirstRowToTheRight)
{
    const TemporaryFolder folder;
    const Photo photo = readPhoto(folder.add("a.jpg", orientedJpeg(6)));
    ASSERT_EQ(photo.image.codes.width(), 32);
    ASSERT_EQ(photo.image.codes.height(), 48);
    EXPECT_NEAR(photo.image.codes(31, 0).r, 40, 2);    // stored top-left; JPEG rounding
    EXPECT_NEAR(photo.image.codes(31, 47).r, 100, 2);  // stored top-right
    EXPECT_NEAR(photo.image.codes(0, 0).r, 160, 2);    // stored bottom-left
}

TEST(Photo, WritingAnUprightCopyResetsTheOrientation)
{
    const TemporaryFolder folder;
    const Photo turned = readPhoto(folder.add("a.jpg", orientedJpeg(6)));
    for (const char* name : {"b.jpg", "b.png"}) {
        writeEncoded(folder / name, turned.image, turned.metadata.exif);
        const Photo copy = readPhoto(folder / name);
        EXPECT_EQ(copy.metadata.orientation, 1) << name;
        EXPECT_EQ(copy.image.codes.width(), turned.image.codes.width()) << name;
        EXPECT_EQ(copy.metadata.exif.size(), turned.metadata.exif.size()) << name;
    }
}

TEST(Photo, ExposureTravelsThroughJpegAndPng)
{
    const TemporaryFolder folder;
    PhotoMetadata metadata;
    metadata.exposure = {1.0 / 128.0, 5.6, 400.0};
    metadata.make = "Acme";
    metadata.model = "Box 1";
    for (const char* name : {"b.jpg", "b.png"}) {
        writeEncoded(folder / name, randomImage(16, 16, 255, 1), makeExif(metadata));
        const PhotoMetadata read = readPhoto(folder / name).metadata;
        EXPECT_EQ(read.exposure.seconds, 1.0 / 128.0) << name;
        EXPECT_EQ(read.exposure.f_number, 5.6) << name;
        EXPECT_EQ(read.exposure.iso, 400.0) << name;
        EXPECT_EQ(read.make, "Acme") << name;
        EXPECT_EQ(read.model, "Box 1") << name;
    }
}

TEST(Photo, GreyIsExpandedAndAlphaDropped)
{
    const TemporaryFolder folder;
    cv::Mat grey(4, 5, CV_16UC1, cv::Scalar(12345));
    cv::imwrite((folder / "grey.png").string(), grey);
    const Photo photo = readPhoto(folder / "grey.png");
    EXPECT_EQ(photo.image.max_code, 65535);
    EXPECT_EQ(photo.image.codes, Image<glm::u16vec3>(5, 4, glm::u16vec3(12345)));

    cv::Mat transparent(4, 5, CV_8UC4, cv::Scalar(30, 20, 10, 0));
    cv::imwrite((folder / "alpha.png").string(), transparent);
    EXPECT_EQ(readPhoto(folder / "alpha.png").image.codes,
              Image<glm::u16vec3>(5, 4, glm::u16vec3(10, 20, 30)));
}

TEST(Photo, TiffKeepsSixteenBits)
{
    const TemporaryFolder folder;
    cv::Mat mat(3, 4, CV_16UC3);
    for (int i = 0; i < 12; ++i)
        mat.at<cv::Vec3w>(i / 4, i % 4) =
            cv::Vec3w(static_cast<unsigned short>(5000 * i), 2, 65535);
    cv::imwrite((folder / "a.tif").string(), mat);
    const Photo photo = readPhoto(folder / "a.tif");
    EXPECT_EQ(photo.image.max_code, 65535);
    EXPECT_EQ(photo.image.codes(3, 2), glm::u16vec3(65535, 2, 55000));
}

/// A little-endian, uncompressed 8-bit RGB TIFF of 3x2 pixels with red = 10·(pixel + 1).
Bytes tiffWithOrientation(std::uint8_t orientation)
{
    Bytes tiff = {'I', 'I', 42, 0, 8, 0, 0, 0, 10, 0};
    const auto entry = [&](int tag, int type, int count, int value) {
        for (const int part : {tag & 255, tag >> 8, type, 0, count, 0, 0, 0, value, 0, 0, 0})
            tiff.push_back(static_cast<std::uint8_t>(part));
    };
    constexpr int kPixelsAt = 8 + 2 + 10 * 12 + 4;
    entry(256, 3, 1, 3);
    entry(257, 3, 1, 2);
    entry(258, 3, 1, 8);  // one count stands for all three: accepted by libtiff
    entry(259, 3, 1, 1);
    entry(262, 3, 1, 2);
    entry(273, 3, 1, kPixelsAt);
    entry(274, 3, 1, orientation);
    entry(277, 3, 1, 3);
    entry(278, 3, 1, 2);
    entry(279, 3, 1, 18);
    tiff.insert(tiff.end(), {0, 0, 0, 0});
    for (int i = 1; i <= 6; ++i)
        tiff.insert(tiff.end(), {static_cast<std::uint8_t>(10 * i), 7, 9});
    return tiff;
}

TEST(Photo, TiffComesUprightForAllEightOrientations)
{
    // Stored 1 2 3 / 4 5 6, and how each orientation of TIFF 6.0 shows it.
    const std::vector<std::vector<int>> expected = {{1, 2, 3, 4, 5, 6},
                                                    {3, 2, 1, 6, 5, 4},
                                                    {6, 5, 4, 3, 2, 1},
                                                    {4, 5, 6, 1, 2, 3},
                                                    {1, 4, 2, 5, 3, 6},
                                                    {4, 1, 5, 2, 6, 3},
                                                    {6, 3, 5, 2, 4, 1},
                                                    {3, 6, 2, 5, 1, 4}};
    const TemporaryFolder folder;
    for (std::uint8_t orientation = 1; orientation <= 8; ++orientation) {
        const Photo photo = readPhoto(folder.add("a.tif", tiffWithOrientation(orientation)));
        EXPECT_EQ(photo.image.codes.width(), orientation <= 4 ? 3 : 2);
        std::vector<int> shown;
        for (const glm::u16vec3& code : photo.image.codes.pixels())
            shown.push_back(code.r / 10);
        EXPECT_EQ(shown, expected[orientation - 1u]) << int(orientation);
        EXPECT_EQ(photo.image.codes(0, 0).b, 9);
    }
}

// Where libtiff puts them: directories behind the pixels, far beyond what a JPEG segment holds.
TEST(Photo, TiffTellsItsExposureFromTheFarEnd)
{
    constexpr int kSide = 200;
    constexpr std::uint32_t kPixelBytes = kSide * kSide * 3;
    Bytes tiff = {'M', 'M', 0, 42};
    append32(tiff, 8 + kPixelBytes);
    tiff.resize(8 + kPixelBytes, 77);
    constexpr std::uint32_t kExifAt = 8 + kPixelBytes + 2 + 11 * 12 + 4;
    const auto entry = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t value) {
        append16(tiff, tag);
        append16(tiff, type);
        append32(tiff, 1);
        append32(tiff, type == 3 ? value << 16 : value);
    };
    append16(tiff, 11);
    entry(256, 3, kSide);
    entry(257, 3, kSide);
    entry(258, 3, 8);
    entry(259, 3, 1);
    entry(262, 3, 2);
    entry(273, 4, 8);
    entry(274, 3, 3);
    entry(277, 3, 3);
    entry(278, 3, kSide);
    entry(279, 4, kPixelBytes);
    entry(0x8769, 4, kExifAt);
    append32(tiff, 0);
    append16(tiff, 2);
    entry(0x829A, 5, kExifAt + 2 + 2 * 12 + 4);
    entry(0x8827, 3, 320);
    append32(tiff, 0);
    append32(tiff, 1);
    append32(tiff, 60);
    const TemporaryFolder folder;
    const Photo photo = readPhoto(folder.add("a.tif", tiff));
    EXPECT_EQ(photo.image.codes, Image<glm::u16vec3>(kSide, kSide, glm::u16vec3(77)));
    EXPECT_EQ(photo.metadata.exposure.seconds, 1.0 / 60.0);
    EXPECT_EQ(photo.metadata.exposure.iso, 320.0);
    EXPECT_EQ(photo.metadata.orientation, 3);
    writeEncoded(folder / "a.jpg", photo.image, photo.metadata.exif);
    EXPECT_EQ(readPhoto(folder / "a.jpg").metadata.exposure.seconds, 1.0 / 60.0);
}

TEST(Photo, RefusesWithTheCause)
{
    const TemporaryFolder folder;
    const auto message = [&](const std::filesystem::path& path) {
        return inputErrorOf([&] { (void)readPhoto(path); });
    };
    EXPECT_THAT(message(folder / "no.jpg"), HasSubstr("no such file"));
    EXPECT_THAT(message(folder.add("a.txt", "hello")), HasSubstr("not a JPEG, PNG or TIFF"));
    EXPECT_THAT(message(folder.add("empty.png", "")), HasSubstr("not a JPEG, PNG or TIFF"));

    Bytes jpeg = orientedJpeg(1);
    jpeg.resize(jpeg.size() - 2);
    EXPECT_THAT(message(folder.add("cut.jpg", jpeg)), HasSubstr("no end marker"));

    writeEncoded(folder / "a.png", randomImage(40, 40, 255, 3));
    Bytes png = readFile(folder / "a.png");
    png.resize(png.size() / 2);
    EXPECT_THAT(message(folder.add("cut.png", png)), HasSubstr("cannot be decoded as PNG"));
}

TEST(Photo, ChecksTheDeclaredSizeBeforeDecoding)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "a.png", randomImage(40, 50, 255, 3));
    EXPECT_NO_THROW((void)readPhoto(folder / "a.png", 2000));
    EXPECT_THAT(inputErrorOf([&] { (void)readPhoto(folder / "a.png", 1999); }),
                HasSubstr("declares 40x50 pixels; at most 1999"));

    // A lie that stays below the limit, but above what the bytes could hold.
    Bytes png = readFile(folder / "a.png");
    png[18] = 0x3F;  // width 16168
    png[22] = 0x3F;
    EXPECT_THAT(inputErrorOf([&] { (void)readPhoto(folder.add("lie.png", png)); }),
                HasSubstr("cannot be stored in"));
}

TEST(Photo, RefusesToWriteWhatItCannotHold)
{
    const TemporaryFolder folder;
    const EncodedImage deep = randomImage(8, 8, 65535, 1);
    EXPECT_THAT(inputErrorOf([&] { writeEncoded(folder / "a.jpg", deep); }), HasSubstr("8 bits"));
    EXPECT_THAT(inputErrorOf([&] { writeEncoded(folder / "a.bmp", deep); }), HasSubstr(".png"));
    EXPECT_THAT(inputErrorOf([&] { writeEncoded(folder / "no" / "a.png", deep); }),
                HasSubstr("cannot be written"));
    EncodedImage wrong = deep;
    wrong.max_code = 255;
    EXPECT_THROW(writeEncoded(folder / "a.png", wrong), LogicError);
    EXPECT_EQ(folder.size(), 0u);
}

TEST(Photo, ReadsARealCapture)
{
    INSITU_NEEDS_DATA();
    const auto path = dataFolder() / "brackets" / "ball_olapietka_livingroom" / "raw2.jpg";
    const Photo photo = readPhoto(path);
    EXPECT_EQ(photo.image.codes.width(), 1500);
    EXPECT_EQ(photo.image.codes.height(), 1000);
    EXPECT_EQ(photo.metadata.exposure.seconds, 1.0 / 40.0);
    EXPECT_EQ(photo.metadata.exposure.f_number, 5.6);
    EXPECT_EQ(photo.metadata.exposure.iso, 1600.0);
    EXPECT_EQ(photo.metadata.model, "ILCE-6400");
    EXPECT_EQ(photo.image.codes, readWithOpenCv(path, cv::IMREAD_COLOR));
}

}  // namespace
}  // namespace insitu
