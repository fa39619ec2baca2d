#include "core/color.h"
#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/support/dng_writer.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using testing::HasSubstr;

/// A camera with channels that overlap and see unequally much, as real ones do.
const glm::dmat3 kCamera(0.55, 0.12, 0.03, 0.25, 0.75, 0.20, 0.05, 0.13, 0.42);

glm::u16vec3 sensorValue(const glm::dvec3& rec709, const DngPicture& picture)
{
    const glm::dvec3 camera = glm::min(picture.camera_from_rec709 * rec709, glm::dvec3(1.0));
    return glm::u16vec3(glm::round(static_cast<double>(picture.black) +
                                   camera * static_cast<double>(picture.white - picture.black)));
}

/// The scene of every test: four flat quarters.
glm::dvec3 quarter(int x, int y, int side)
{
    const bool right = x >= side / 2;
    if (y < side / 2) return right ? glm::dvec3(0.10, 0.20, 0.05) : glm::dvec3(0.4);
    return right ? glm::dvec3(0.02, 0.03, 0.30) : glm::dvec3(0.60, 0.20, 0.10);
}

constexpr int kSide = 48;

DngPicture quarters(bool bayer)
{
    DngPicture picture;
    picture.bayer = bayer;
    picture.black = 1024;
    picture.white = 60000;
    picture.camera_from_rec709 = kCamera;
    picture.neutral = kCamera * glm::dvec3(1.0);
    picture.sensor = Image<glm::u16vec3>(kSide, kSide);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            picture.sensor(x, y) = sensorValue(quarter(x, y, kSide), picture);
    return picture;
}

glm::dvec3 rec709Of(const Photo& photo, int x, int y)
{
    return photo.metadata.color.rec709_from_linear *
           (glm::dvec3(photo.image.codes(x, y)) / static_cast<double>(photo.image.max_code));
}

TEST(Raw, KnownColoursComeBackLinear)
{
    const TemporaryFolder folder;
    for (const bool bayer : {true, false}) {
        const DngPicture picture = quarters(bayer);
        const Photo photo = readPhoto(folder.add("a.dng", makeDng(picture)));
        ASSERT_EQ(photo.image.codes.width(), kSide);
        ASSERT_EQ(photo.image.codes.height(), kSide);
        EXPECT_EQ(photo.image.max_code, 65535);
        EXPECT_TRUE(photo.metadata.color.transfer_is_response);
        // White is white: 1 stands where the least amplified channel saturates.
        const double unit = std::max({picture.neutral.r, picture.neutral.g, picture.neutral.b});
        for (const glm::ivec2 at : {glm::ivec2(12, 12), {36, 12}, {12, 36}, {36, 36}}) {
            const glm::dvec3 truth = unit * quarter(at.x, at.y, kSide);
            const glm::dvec3 read = rec709Of(photo, at.x, at.y);
            // Sensor steps are 1.7e-5; white-balanced rounding and the matrix enlarge them.
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(read[c], truth[c], 3e-4) << at.x << "," << at.y << " " << c;
        }
    }
}

TEST(Raw, ChannelsSaturateAtFullScaleWhateverTheWhiteBalance)
{
    const TemporaryFolder folder;
    DngPicture picture = quarters(/*bayer=*/true);
    for (glm::u16vec3& value : picture.sensor.pixels())
        value = glm::u16vec3(static_cast<std::uint16_t>(picture.white));
    const Photo photo = readPhoto(folder.add("a.dng", makeDng(picture)));
    for (int c = 0; c < 3; ++c)
        EXPECT_GE(photo.image.codes(20, 20)[c], 65530);  // two roundings of LibRaw
    // The level of saturation is the camera's, not the picture's.
    for (glm::u16vec3& value : picture.sensor.pixels())
        value = glm::u16vec3(static_cast<std::uint16_t>(picture.black + 20000));
    const Photo dark = readPhoto(folder.add("b.dng", makeDng(picture)));
    const double expected = 65535.0 * 20000.0 / (picture.white - picture.black);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(dark.image.codes(20, 20)[c], expected, 3.0) << c;  // roundings, enlarged
}

TEST(Raw, MetadataAndOrientation)
{
    const TemporaryFolder folder;
    DngPicture picture = quarters(/*bayer=*/false);
    picture.seconds = 1.0 / 8.0;
    picture.f_number = 5.6;
    picture.iso = 400;
    picture.orientation = 6;  // to be turned clockwise
    picture.sensor = Image<glm::u16vec3>(kSide, kSide / 2, glm::u16vec3(9000));
    picture.sensor(0, 0) = glm::u16vec3(50000);
    const Photo photo = readPhoto(folder.add("a.dng", makeDng(picture)));
    EXPECT_NEAR(*photo.metadata.exposure.seconds, 0.125, 1e-6);  // LibRaw's floats
    EXPECT_NEAR(*photo.metadata.exposure.f_number, 5.6, 1e-5);   // LibRaw's floats
    EXPECT_EQ(photo.metadata.exposure.iso, 400.0);
    EXPECT_EQ(photo.metadata.make, "Insitu");
    EXPECT_EQ(photo.metadata.orientation, 6);
    ASSERT_EQ(photo.image.codes.width(), kSide / 2);
    ASSERT_EQ(photo.image.codes.height(), kSide);
    EXPECT_GT(photo.image.codes(kSide / 2 - 1, 0).g, photo.image.codes(0, 0).g);
    EXPECT_TRUE(photoFindings(photo.metadata, "a.dng").empty());
}

TEST(Raw, DevelopedIsSrgbWithWhiteAtTheTop)
{
    const TemporaryFolder folder;
    DngPicture picture = quarters(/*bayer=*/false);
    picture.sensor(3, 3) = glm::u16vec3(static_cast<std::uint16_t>(picture.white));
    const Photo photo = developed(readPhoto(folder.add("a.dng", makeDng(picture))));
    EXPECT_TRUE(photo.metadata.color.hasRec709Primaries());
    EXPECT_TRUE(photo.metadata.color.transfer_is_response);
    const double unit = std::max({picture.neutral.r, picture.neutral.g, picture.neutral.b});
    const glm::dvec3 truth = unit * quarter(36, 12, kSide);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(linearFromSrgb(photo.image.codes(36, 12)[c] / 65535.0), truth[c], 3e-4);
    // Saturated channels are white, not the colour of the white balance.
    for (int c = 0; c < 3; ++c)
        EXPECT_GE(photo.image.codes(3, 3)[c], 65530) << c;  // rounding of codes
    const Photo encoded{{Image<glm::u16vec3>(4, 4, glm::u16vec3(7)), 255}, {}};
    EXPECT_EQ(developed(encoded).image.codes, encoded.image.codes);
}

TEST(Raw, RefusesWithTheCause)
{
    const TemporaryFolder folder;
    const Bytes whole = makeDng(quarters(/*bayer=*/true));
    const auto message = [&](const Bytes& bytes, std::int64_t max_pixels = kMaxPixels) {
        const auto path = folder.add("a.dng", bytes);
        return inputErrorOf([&] { (void)readPhoto(path, max_pixels); });
    };
    EXPECT_THAT(message(whole, kSide * kSide - 1), HasSubstr("declares 48x48 pixels; at most"));
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2));
    EXPECT_THAT(message(cut), HasSubstr("as RAW"));
    const Bytes head(whole.begin(), whole.begin() + 40);
    EXPECT_THAT(message(head), HasSubstr("as RAW"));
    // A lie about the height that these bytes cannot hold.
    Bytes lie = whole;
    const Bytes height = {0x01, 0x01, 0, 4, 0, 0, 0, 1};
    const auto at = std::search(lie.begin(), lie.end(), height.begin(), height.end());
    ASSERT_NE(at, lie.end());
    at[9] = 0x7F;  // 8 million rows
    EXPECT_THAT(message(lie), testing::AnyOf(HasSubstr("cannot be stored"), HasSubstr("as RAW")));
}

}  // namespace
}  // namespace insitu
