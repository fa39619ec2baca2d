#include "core/io/exif.h"

#include "core/io/byte_writer.h"
#include "core/io/exif_acceleration.h"
#include "core/io/image_io.h"
#include "core/random.h"
#include "tests/support/apple_exif.h"
#include "tests/support/data.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

struct Tag {
    std::uint32_t tag;
    std::uint32_t type;  // 3 short, 4 long, 5 rational, 10 signed rational
    std::uint32_t value;
    std::uint32_t denominator = 1;
};

/// A big-endian block whose first directory holds just these tags, in this order.
Bytes blockOf(const std::vector<Tag>& tags)
{
    Bytes block;
    append(block, std::string_view("Exif\0\0MM\0\x2A\0\0\0\x08", 14));
    append16(block, static_cast<std::uint32_t>(tags.size()));
    Bytes values;
    const std::size_t values_at = 8 + 2 + 12 * tags.size() + 4;
    for (const Tag& tag : tags) {
        append16(block, tag.tag);
        append16(block, tag.type);
        append32(block, 1);
        if (tag.type == 3) {
            append16(block, tag.value);
            append16(block, 0);
        } else if (tag.type == 4) {
            append32(block, tag.value);
        } else {
            append32(block, static_cast<std::uint32_t>(values_at + values.size()));
            append32(values, tag.value);
            append32(values, tag.denominator);
        }
    }
    append32(block, 0);
    append(block, values);
    return block;
}

TEST(Exif, RoundTripOfEverythingWeWrite)
{
    PhotoMetadata metadata;
    metadata.exposure = {1.0 / 8000.0, 2.8, 12800.0};
    metadata.focal_mm = 19.8;
    metadata.focal_35mm = 29.0;
    metadata.focal_px = 1234.5;
    metadata.make = "Insitu";
    metadata.model = "Simulated camera";
    const PhotoMetadata read = parseExif(makeExif(metadata, 1500, 1000), 1500, 1000);
    EXPECT_EQ(read.exposure.seconds, metadata.exposure.seconds);
    EXPECT_EQ(read.exposure.f_number, metadata.exposure.f_number);
    EXPECT_EQ(read.exposure.iso, metadata.exposure.iso);
    EXPECT_EQ(read.focal_mm, metadata.focal_mm);
    EXPECT_EQ(read.focal_35mm, metadata.focal_35mm);
    ASSERT_TRUE(read.focal_px);
    EXPECT_NEAR(*read.focal_px, 1234.5, 1234.5 * tolerance::kDouble);
    EXPECT_EQ(read.make, metadata.make);
    EXPECT_EQ(read.model, metadata.model);
    EXPECT_EQ(read.orientation, 1);
}

TEST(Exif, NothingKnownStaysUnknown)
{
    const PhotoMetadata read = parseExif(makeExif({}), 100, 100);
    EXPECT_FALSE(read.exposure.seconds);
    EXPECT_FALSE(read.exposure.f_number);
    EXPECT_FALSE(read.exposure.iso);
    EXPECT_FALSE(read.focal_mm);
    EXPECT_FALSE(read.focal_px);
    EXPECT_EQ(read.make, "");
    EXPECT_FALSE(parseExif({}, 100, 100).exposure.seconds);
}

TEST(Exif, AnyExposureTimeSurvives)
{
    RandomStream random(3, 0, 0);
    for (int i = 0; i < 200; ++i) {
        PhotoMetadata metadata;
        const double seconds = std::exp2(random.uniformDouble() * 20.0 - 15.0);
        metadata.exposure.seconds = seconds;
        const auto read = parseExif(makeExif(metadata), 10, 10).exposure.seconds;
        ASSERT_TRUE(read);
        // Fractions of 32-bit integers near 2^-15 lie no closer than that.
        EXPECT_NEAR(*read, seconds, seconds * 1e-9);
    }
}

TEST(Exif, ZeroDenominatorsAndZerosAreAbsent)
{
    const Bytes block = blockOf({{0x829A, 5, 1, 0}, {0x829D, 5, 0, 1}, {0x8827, 3, 0}});
    const PhotoMetadata read = parseExif(block, 10, 10);
    EXPECT_FALSE(read.exposure.seconds);
    EXPECT_FALSE(read.exposure.f_number);
    EXPECT_FALSE(read.exposure.iso);
}

// EXIF 2.32, annex C: Tv = -log2 t, Av = 2 log2 N.
TEST(Exif, ApexValuesStandIn)
{
    const PhotoMetadata read = parseExif(blockOf({{0x9201, 10, 6, 1}, {0x9202, 5, 3, 1}}), 10, 10);
    EXPECT_EQ(read.exposure.seconds, 1.0 / 64.0);
    ASSERT_TRUE(read.exposure.f_number);
    EXPECT_NEAR(*read.exposure.f_number, std::pow(2.0, 1.5), tolerance::kDouble);
}

// 20 mm in front of 5000 pixels per inch; the picture was reduced from 6000 to 1500 pixels.
TEST(Exif, FocalPixelsFromTheFocalPlaneFollowAReduction)
{
    const std::vector<Tag> tags = {{0x920A, 5, 20, 1},
                                   {0xA002, 4, 6000},
                                   {0xA003, 4, 4000},
                                   {0xA20E, 5, 5000, 1},
                                   {0xA210, 3, 2}};
    const PhotoMetadata full = parseExif(blockOf(tags), 6000, 4000);
    ASSERT_TRUE(full.focal_px);
    EXPECT_NEAR(*full.focal_px, 20.0 * 5000.0 / 25.4, 1e-9);
    const PhotoMetadata small = parseExif(blockOf(tags), 1500, 1000);
    ASSERT_TRUE(small.focal_px);
    EXPECT_NEAR(*small.focal_px, 20.0 * 5000.0 / 25.4 / 4.0, 1e-9);
    // Without the size that the resolution belongs to it says nothing.
    EXPECT_FALSE(parseExif(blockOf({tags[0], tags[3], tags[4]}), 1500, 1000).focal_px);
}

TEST(Exif, ImpossibleSensorFallsBackToTheFilmEquivalent)
{
    // 300 pixels per inch is a printer's figure: 6000 pixels would be a sensor of half a metre.
    const PhotoMetadata read = parseExif(blockOf({{0x920A, 5, 20, 1},
                                                  {0xA002, 4, 4000},
                                                  {0xA003, 4, 6000},
                                                  {0xA20E, 5, 300, 1},
                                                  {0xA210, 3, 2},
                                                  {0xA405, 3, 30}}),
                                         4000,
                                         6000);
    ASSERT_TRUE(read.focal_px);
    EXPECT_NEAR(*read.focal_px, 30.0 / 36.0 * 6000.0, 1e-9);
    EXPECT_EQ(read.focal_35mm, 30.0);
}

// The focal plane of 6000 pixels on 23.5 mm, but a size that was rewritten after a reduction.
TEST(Exif, TheFilmEquivalentExposesARewrittenSize)
{
    const PhotoMetadata read = parseExif(blockOf({{0x920A, 5, 20, 1},
                                                  {0xA002, 4, 1500},
                                                  {0xA003, 4, 1000},
                                                  {0xA20E, 5, 60000, 235},
                                                  {0xA210, 3, 4},
                                                  {0xA405, 3, 30}}),
                                         1500,
                                         1000);
    EXPECT_EQ(read.focal_px, 30.0 / 36.0 * 1500.0);
}

TEST(Exif, OrientationIsReadAndReset)
{
    const Bytes block = blockOf({{0x0112, 3, 8}, {0x8827, 3, 200}});
    EXPECT_EQ(parseExif(block, 10, 10).orientation, 8);
    const Bytes upright = uprightExif(block);
    EXPECT_EQ(parseExif(upright, 10, 10).orientation, 1);
    EXPECT_EQ(parseExif(upright, 10, 10).exposure.iso, 200.0);
    EXPECT_EQ(parseExif(blockOf({{0x0112, 3, 9}}), 10, 10).orientation, 1);
    EXPECT_TRUE(uprightExif({}).empty());
}

TEST(Exif, ABareTiffHeaderWillDo)
{
    Bytes block = blockOf({{0x8827, 3, 200}});
    block.erase(block.begin(), block.begin() + 6);
    const PhotoMetadata read = parseExif(block, 10, 10);
    EXPECT_EQ(read.exposure.iso, 200.0);
    EXPECT_EQ(read.exif.size(), block.size() + 6);
}

TEST(Exif, NoDamageIsFatal)
{
    PhotoMetadata metadata;
    metadata.exposure = {0.5, 2.8, 100.0};
    metadata.make = "Insitu";
    metadata.focal_mm = 20.0;
    metadata.focal_px = 1000.0;
    const Bytes whole = makeExif(metadata);
    for (std::size_t size = 0; size < whole.size(); ++size) {
        const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        (void)parseExif(cut, 100, 100);
        (void)uprightExif(cut);
    }
    RandomStream random(9, 0, 0);
    for (int i = 0; i < 5000; ++i) {
        Bytes mutated = whole;
        for (int k = 0; k < 3; ++k)
            mutated[6 + random.below(static_cast<std::uint32_t>(whole.size()) - 6)] =
                static_cast<std::uint8_t>(random.below(256));
        const PhotoMetadata read = parseExif(mutated, 100, 100);
        (void)uprightExif(mutated);
        for (const auto& value : {read.exposure.seconds, read.exposure.f_number, read.focal_px})
            EXPECT_TRUE(!value || (std::isfinite(*value) && *value > 0.0));
    }
}

TEST(Exif, AccelerationPointsUpInTheStoredPicture)
{
    // Held with its top to the left: at rest it is pushed towards its right side, which is up.
    const auto landscape = accelerationFromExif(appleExif({-1.0, 0.0, 0.0}));
    ASSERT_TRUE(landscape);
    EXPECT_LT(glm::length(*landscape - glm::dvec3(0.0, -1.0, 0.0)), tolerance::kDouble);
    // Upright: pushed towards its top, which is the stored picture's left. Looking up a little, the
    // acceleration has a part along the view.
    const auto portrait = accelerationFromExif(appleExif({0.0, -0.98, 0.2}, 6));
    ASSERT_TRUE(portrait);
    EXPECT_LT(glm::length(*portrait - glm::dvec3(-0.98, 0.0, 0.2)), tolerance::kDouble);
    EXPECT_FALSE(accelerationFromExif(appleExif({-1, 0, 0}, 1, "iPhone 11 front camera 2.71mm")));
    EXPECT_FALSE(accelerationFromExif(makeExif({})));
    EXPECT_FALSE(accelerationFromExif({}));
}

TEST(Exif, DamagedAccelerationsAreNone)
{
    const Bytes block = appleExif({-0.6, 0.0, 0.8});
    for (std::size_t size = 0; size + 1 < block.size(); ++size)
        (void)accelerationFromExif(std::span(block).first(size));
    RandomStream random(3, 0, 0);
    for (int i = 0; i < 20000; ++i) {
        Bytes mutated = block;
        for (int k = 0; k < 4; ++k)
            mutated[random.below(static_cast<std::uint32_t>(mutated.size()))] =
                static_cast<std::uint8_t>(random.below(256));
        const auto read = accelerationFromExif(mutated);
        EXPECT_TRUE(!read || std::isfinite(glm::length(*read)));
    }
}

TEST(Exif, RealCameras)
{
    INSITU_NEEDS_DATA();
    // 17 mm on a Canon 6D, reduced to 2000 pixels without a word in EXIF: taken as it stands, its
    // focal plane would be a sensor of 13 mm and the focal length 2.7 times too long.
    const auto rooms = dataFolder() / "rooms";
    const Photo atrium = readPhoto(rooms / "hannover_lichthof_indoor.jpg");
    EXPECT_EQ(atrium.metadata.focal_mm, 17.0);
    EXPECT_FALSE(atrium.metadata.focal_px);
    // The same with the size rewritten: 640 pixels would be a sensor of 2.8 mm.
    const Photo desk = readPhoto(dataFolder() / "brackets/piccante_desk_room/stack_room_exp_0.jpg");
    EXPECT_FALSE(desk.metadata.focal_px);
    // Calibrated: 674.918 px (York Urban DB); the film equivalent is of a 4:3 sensor.
    const Photo corridor = readPhoto(rooms / "yud" / "P1020816.jpg");
    ASSERT_TRUE(corridor.metadata.focal_px);
    EXPECT_NEAR(*corridor.metadata.focal_px, 674.918, 0.09 * 674.918);
    const Photo living = readPhoto(dataFolder() / "brackets/ball_olapietka_livingroom/raw0.jpg");
    EXPECT_EQ(living.metadata.focal_mm, 19.8);
    ASSERT_TRUE(living.metadata.focal_px);
    EXPECT_NEAR(*living.metadata.focal_px, 19.8 / 23.5 * 1500.0, 0.05 * 1264.0);  // APS-C, 23.5 mm
    // An iPhone 11 held level.
    const Photo dining = readPhoto(dataFolder() / "brackets/ball_tarik_dining/background.jpg");
    const auto up = accelerationFromExif(dining.metadata.exif);
    ASSERT_TRUE(up);
    EXPECT_LT(glm::length(*up - glm::dvec3(0.001, -0.999, -0.017)), 0.001);
}

}  // namespace
}  // namespace insitu
