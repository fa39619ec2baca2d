#include "calib/exif_gravity.h"

#include "calib/automatic_calibration.h"
#include "calib/photo_calibration.h"
#include "core/io/image_io.h"
#include "tests/calib/drawn_room.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/apple_exif.h"
#include "tests/support/data.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

PhotoMetadata phone(glm::dvec3 acceleration, int orientation = 1)
{
    PhotoMetadata metadata;
    metadata.orientation = orientation;
    metadata.exif = appleExif(acceleration, orientation);
    return metadata;
}

TEST(ExifGravity, UpTurnsWithThePixels)
{
    const TemporaryFolder folder;
    // A bright spot of the stored picture, and an acceleration that points to it.
    EncodedImage stored;
    stored.codes = Image<glm::u16vec3>(64, 48, glm::u16vec3(20));
    for (int y = 8; y < 16; ++y)
        for (int x = 40; x < 48; ++x)
            stored.codes(x, y) = glm::u16vec3(230);
    const glm::dvec3 to_spot = glm::normalize(glm::dvec3(44 - 32, 12 - 24, 5));
    const Bytes exif = appleExif({to_spot.y, to_spot.x, to_spot.z});
    for (int orientation = 1; orientation <= 8; ++orientation) {
        const auto file = folder / ("spot" + std::to_string(orientation) + ".jpg");
        writeStored(file, stored, exif, orientation);
        const Photo photo = readPhoto(file);
        glm::dvec2 sum(0.0);
        double count = 0.0;
        for (int y = 0; y < photo.image.codes.height(); ++y)
            for (int x = 0; x < photo.image.codes.width(); ++x)
                if (photo.image.codes(x, y).g > 125) {
                    sum += glm::dvec2(x + 0.5, y + 0.5);
                    count += 1.0;
                }
        const glm::dvec2 spot =
            sum / count - 0.5 * glm::dvec2(photo.image.codes.width(), photo.image.codes.height());
        const auto gravity = gravityFromExif(photo.metadata);
        ASSERT_TRUE(gravity) << orientation;
        const glm::dvec3 expected = glm::normalize(glm::dvec3(spot, 5.0));
        // JPEG moves the spot's middle by less than a pixel of 17.
        EXPECT_LT(glm::length(gravity->up - expected), 0.05) << orientation;
    }
}

TEST(ExifGravity, AMovingTelephoneTellsNothing)
{
    EXPECT_TRUE(gravityFromExif(phone({-0.97, 0.0, 0.0})));
    EXPECT_FALSE(gravityFromExif(phone({-0.9, 0.0, 0.0})));
    EXPECT_FALSE(gravityFromExif(phone({-0.9, 0.6, 0.0})));
    EXPECT_FALSE(gravityFromExif(PhotoMetadata{}));
}

CalibrationOptions holding(const Camera& camera, double off_rad)
{
    CalibrationOptions options;
    options.principal_sigma = 0.0;
    const glm::dvec3 up(camera.right.y, -camera.up.y, camera.forward.y);
    const glm::dvec3 aside = glm::normalize(glm::cross(up, glm::dvec3(0, 0, 1)));
    options.exif_gravity = Gravity{up * std::cos(off_rad) + aside * std::sin(off_rad), 0.02};
    return options;
}

TEST(ExifGravity, HoldsWhatFewLinesLeaveOpen)
{
    synthetic::Room room = synthetic::makeRoom({12.0, -6.0, 1.0, 900.0, 1.5}, {3, 2, 3}, 71);
    RandomStream random(72, 0, 0);
    synthetic::addNoise(room.lines, 3.0, random);
    CalibrationOptions options = holding(room.camera, 0.0);
    options.segment_sigma_px = 3.0;
    const CameraEstimate with = calibrateCamera(room.lines, options, "lines.json");
    options.exif_gravity.reset();
    const CameraEstimate alone = calibrateCamera(room.lines, options, "lines.json");
    EXPECT_TRUE(hasFinding(with.findings, "gravity-from-exif"));
    EXPECT_LT(with.rotation_sigma_rad, alone.rotation_sigma_rad);
    EXPECT_LT(with.focal_sigma_px, alone.focal_sigma_px);
    EXPECT_LT(std::abs(with.camera.focal_px.x - 900.0), 3.0 * with.focal_sigma_px);
}

TEST(ExifGravity, GivesWayToLinesThatContradictIt)
{
    const synthetic::Room room = synthetic::makeRoom({}, {5, 5, 5}, 73);
    const CameraEstimate found =
        calibrateCamera(room.lines, holding(room.camera, glm::radians(9.0)), "lines.json");
    EXPECT_TRUE(hasFinding(found.findings, "gravity-disagrees-with-exif"));
    EXPECT_FALSE(hasFinding(found.findings, "gravity-from-exif"));
    EXPECT_NEAR(found.camera.focal_px.x, 900.0, 900.0 * tolerance::kIterative);
    // What the user says of gravity comes first.
    synthetic::Room told = room;
    told.lines.gravity =
        Gravity{{room.camera.right.y, -room.camera.up.y, room.camera.forward.y}, 0.01};
    const CameraEstimate by_hand =
        calibrateCamera(told.lines, holding(room.camera, glm::radians(9.0)), "lines.json");
    EXPECT_FALSE(hasFinding(by_hand.findings, "gravity-disagrees-with-exif"));
}

TEST(ExifGravity, ARealTelephoneAgreesWithTheRoom)
{
    INSITU_NEEDS_DATA();
    const Photo photo = readPhoto(dataFolder() / "brackets/ball_tarik_dining/background.jpg");
    const auto gravity = gravityFromExif(photo.metadata);
    ASSERT_TRUE(gravity);
    CalibrationOptions options;
    options.use_exif_gravity = false;
    AutomaticOptions automatic;
    automatic.accept_doubtful = true;
    const AutomaticCalibration found =
        calibrateAutomatically(photo, options, automatic, "background.jpg");
    const Camera& camera = found.camera.camera;
    const glm::dvec3 up(camera.right.y, -camera.up.y, camera.forward.y);
    EXPECT_LT(glm::degrees(std::acos(glm::dot(up, gravity->up))), 1.5);
}

}  // namespace
}  // namespace insitu
