#include "calib/calibration_overlay.h"
#include "tests/calib/drawn_room.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/errors.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using ::testing::HasSubstr;

EncodedImage blank(int width, int height)
{
    EncodedImage image;
    image.codes = Image<glm::u16vec3>(width, height, glm::u16vec3(0));
    return image;
}

double sumOf(const EncodedImage& image)
{
    double sum = 0.0;
    for (const glm::u16vec3& code : image.codes.pixels())
        sum += code.g / 255.0;
    return sum;
}

/// The light of an anti-aliased line is its area, wherever between the pixels it lies.
TEST(Drawing, ALineCoversItsArea)
{
    for (const double off : {0.0, 0.25, 0.5, 0.8}) {
        EncodedImage image = blank(100, 60);
        drawLine(image, {20.0, 30.0 + off}, {80.0, 30.0 + off}, {glm::vec3(1.0f), 3.0, 1.0});
        // 60 long and 3 wide, and a half disc at either end.
        EXPECT_NEAR(sumOf(image), 60.0 * 3.0 + 2.25 * 3.14159, 2.0) << off;
    }
    EncodedImage slanted = blank(100, 60);
    drawLine(slanted, {10, 10}, {90, 50}, {glm::vec3(1.0f), 2.0, 1.0});
    EXPECT_NEAR(sumOf(slanted), 2.0 * std::hypot(80.0, 40.0) + 3.14159, 3.0);
    EXPECT_EQ(slanted.codes(50, 30).g, 255);
    EXPECT_EQ(slanted.codes(50, 40).g, 0);
}

TEST(Drawing, WhatLiesOutsideIsLeftOut)
{
    EncodedImage image = blank(50, 40);
    drawLine(image, {-1e7, 20.5}, {1e7, 20.5}, {glm::vec3(1.0f), 1.0, 1.0});
    EXPECT_NEAR(sumOf(image), 50.0, 0.5);
    drawLine(image, {std::nan(""), 0.0}, {10.0, 10.0}, {});
    drawLine(image, {200.0, 200.0}, {300.0, 250.0}, {});
    drawLabel(image, {1000.0, 1000.0}, "far", 10.0, {});
    EXPECT_NEAR(sumOf(image), 50.0, 0.5);
}

TEST(Drawing, AWorldLineIsCutBeforeTheCamera)
{
    Camera camera = Camera::lookAt({0, 1, 0}, {0, 1, -1}, 100.0, 200, 100);
    EncodedImage image = blank(200, 100);
    // From behind the camera to a point far ahead, on the floor: seen from the middle down.
    drawWorldLine(image, camera, {0, 0, 50}, {0, 0, -1000}, {glm::vec3(1.0f), 1.0, 1.0});
    EXPECT_GT(image.codes(99, 60).g + image.codes(100, 60).g, 200);
    EXPECT_GT(image.codes(99, 98).g + image.codes(100, 98).g, 200);
    EXPECT_EQ(image.codes(100, 40).g, 0);
}

TEST(Overlay, ShowsHorizonGridAndResiduals)
{
    const synthetic::Room room = synthetic::makeRoom({20, -12, 0, 900, 1.5}, {4, 4, 4}, 3);
    EncodedImage photo = blank(room.camera.width, room.camera.height);
    CameraEstimate estimate;
    estimate.camera = room.camera;
    const EncodedImage exact = drawCalibration(photo, estimate, room.lines.segments);
    // The horizon: level camera without roll, so a row; yellow has no blue to speak of.
    const double row = room.camera.principal_px.y - 900.0 * std::tan(glm::radians(12.0));
    const glm::u16vec3 on = exact.codes(30, static_cast<int>(row));
    EXPECT_GT(on.r, 120);
    EXPECT_LT(on.b, 60);
    // The first segment in its axis' colour: x is red.
    const glm::dvec2 middle = 0.5 * (room.lines.segments[0].from_px + room.lines.segments[0].to_px);
    const glm::u16vec3 line = exact.codes(static_cast<int>(middle.x), static_cast<int>(middle.y));
    EXPECT_GT(line.r, line.g);
    // A camera that is turned by a degree leaves whiskers: more light in the picture.
    CameraEstimate turned = estimate;
    turned.camera.focal_px *= 1.1;
    OverlayOptions plain;
    plain.exaggeration = 1e-3;
    OverlayOptions large;
    large.exaggeration = 30.0;
    EXPECT_GT(sumOf(drawCalibration(photo, turned, room.lines.segments, large)),
              sumOf(drawCalibration(photo, turned, room.lines.segments, plain)) + 200.0);
}

/// The ellipse at the world's origin: as long as placementSigma says, in the picture.
TEST(Overlay, ShowsHowFarOffThingsMayBe)
{
    const synthetic::Room room = synthetic::makeRoom({20, -25, 0, 900, 1.5}, {5, 5, 5}, 4);
    CalibrationOptions calibration;
    calibration.segment_sigma_px = 2.0;
    const CameraEstimate estimate = calibrateCamera(room.lines, calibration, "room");
    const EncodedImage photo = blank(room.camera.width, room.camera.height);
    OverlayOptions small;
    small.ellipse_sigmas = 1e-3;
    OverlayOptions large;
    large.ellipse_sigmas = 4.0;
    const double more = sumOf(drawCalibration(photo, estimate, room.lines.segments, large)) -
                        sumOf(drawCalibration(photo, estimate, room.lines.segments, small));
    EXPECT_GT(more, 300.0);
    // Nothing known of the errors, nothing drawn.
    CameraEstimate unknown;
    unknown.camera = estimate.camera;
    EXPECT_EQ(drawCalibration(photo, unknown, {}, small).codes,
              drawCalibration(photo, unknown, {}, large).codes);
}

TEST(Overlay, RefusesAnotherSizeAndUnusableOptions)
{
    CameraEstimate estimate;
    estimate.camera = synthetic::cameraOf({});
    EXPECT_THAT(inputErrorOf([&] { (void)drawCalibration(blank(10, 10), estimate, {}); }),
                HasSubstr("1200x900"));
    OverlayOptions options;
    options.grid_step_m = -1.0;
    options.grid_reach = 0;
    options.exaggeration = 0.0;
    options.ellipse_sigmas = 0.0;
    EXPECT_EQ(options.validate().size(), 4u);
    EXPECT_THAT(inputErrorOf([&] { (void)drawCalibration(blank(10, 10), estimate, {}, options); }),
                HasSubstr("grid_step_m"));
}

}  // namespace
}  // namespace insitu
