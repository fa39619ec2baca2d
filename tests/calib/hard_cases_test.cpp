#include "calib/camera_solve.h"
#include "calib/photo_calibration.h"
#include "core/check.h"
#include "core/io/image_io.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/data.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

using synthetic::makeRoom;
using synthetic::Room;
using synthetic::rotationError;
using testing::HasSubstr;

std::string messageOf(const Findings& findings, const std::string& code)
{
    for (const Finding& finding : findings)
        if (finding.code == code) return finding.message;
    return "";
}

CameraEstimate solved(const Room& room, const CalibrationOptions& options = {})
{
    return calibrateCamera(room.lines, options, "lines");
}

/// The truth lies within four stated standard deviations.
void expectWithin(const CameraEstimate& found, const Camera& truth)
{
    EXPECT_LT(std::abs(found.camera.focal_px.x - truth.focal_px.x), 4.0 * found.focal_sigma_px);
    EXPECT_LT(rotationError(found.camera, truth), 4.0 * found.rotation_sigma_rad);
    EXPECT_LT(glm::length(found.camera.position_m - truth.position_m),
              4.0 * glm::length(found.position_sigma_m));
}

TEST(HardCases, AnOutlierOfAnotherDirectionIsNamedAndLeftOut)
{
    Room room = makeRoom({38.0, -20.0, 0.0, 900.0, 1.5}, {6, 5, 6}, 51);
    RandomStream random(52, 0, 0);
    synthetic::addNoise(room.lines, 0.7, random);
    const CameraEstimate clean = solved(room);
    EXPECT_FALSE(hasFinding(clean.findings, "segment-outlier"));
    // A table that stands askew, marked as the wall's direction.
    const glm::dvec2 middle = 0.5 * (room.lines.segments[3].from_px + room.lines.segments[3].to_px);
    const glm::dvec2 half = 0.5 * (room.lines.segments[3].to_px - middle);
    room.lines.segments[3].to_px = middle + glm::dvec2(half.x - half.y, half.x + half.y);
    const CameraEstimate found = solved(room);
    EXPECT_THAT(messageOf(found.findings, "segment-outlier"), HasSubstr("segments[3]"));
    EXPECT_EQ(found.outlier_segments, std::vector<std::size_t>{3});
    EXPECT_FALSE(hasFinding(found.findings, "segments-inconsistent"));
    expectWithin(found, room.camera);
}

TEST(HardCases, TwoOutliersOfOneAxisDoNotHideEachOther)
{
    Room room = makeRoom({30.0, -20.0, 0.0, 900.0, 1.5}, {7, 6, 7}, 53);
    for (const std::size_t i : {1u, 4u})
        room.lines.segments[i].to_px += glm::dvec2(6.0, 40.0);
    const CameraEstimate found = solved(room);
    EXPECT_EQ(found.outlier_segments, (std::vector<std::size_t>{1, 4}));
    expectWithin(found, room.camera);
}

TEST(HardCases, NearlyParallelLines)
{
    // Half a degree off the wall: x meets 100 000 px away, noise puts it anywhere.
    Room room = makeRoom({0.5, -24.0, 0.0, 900.0, 1.5}, {6, 6, 6}, 55);
    RandomStream random(56, 0, 0);
    synthetic::addNoise(room.lines, 0.7, random);
    expectWithin(solved(room), room.camera);
}

TEST(HardCases, SegmentsOfTwentyPixels)
{
    Room room = makeRoom({38.0, -20.0, 0.0, 900.0, 1.5}, {20, 20, 20}, 57);
    for (LineSegment& segment : room.lines.segments)
        segment.to_px = segment.from_px + 20.0 * glm::normalize(segment.to_px - segment.from_px);
    RandomStream random(58, 0, 0);
    synthetic::addNoise(room.lines, 0.3, random);
    CalibrationOptions options;
    options.segment_sigma_px = 0.3;
    const CameraEstimate found = solved(room, options);
    expectWithin(found, room.camera);
    EXPECT_LT(found.focal_sigma_px, 0.15 * 900.0);
}

TEST(HardCases, AllLinesOfAnAxisOnOneSide)
{
    Room room = makeRoom({38.0, -20.0, 0.0, 900.0, 1.5}, {0, 6, 6}, 59);
    RandomStream random(60, 0, 0);
    while (room.lines.segments.size() < 18) {
        const LineSegment one = synthetic::randomSegment(room.camera, RoomAxis::X, random);
        if (one.from_px.x < 300.0 && one.to_px.x < 300.0) room.lines.segments.push_back(one);
    }
    synthetic::addNoise(room.lines, 0.7, random);
    expectWithin(solved(room), room.camera);
}

TEST(HardCases, APortrait)
{
    Room room = makeRoom({}, {0, 0, 0}, 61);
    std::swap(room.camera.width, room.camera.height);
    room.camera.principal_px = {450.0, 600.0};
    room.lines.width = 900;
    room.lines.height = 1200;
    room.lines.origin_px = {460.0, 1100.0};
    const glm::dvec3 ray = room.camera.rayDirection(room.lines.origin_px);
    room.camera.position_m = ray * (1.5 / ray.y);
    RandomStream random(62, 0, 0);
    for (int i = 0; i < 15; ++i)
        room.lines.segments.push_back(
            synthetic::randomSegment(room.camera, static_cast<RoomAxis>(i % 3), random));
    const CameraEstimate found = solved(room);
    EXPECT_NEAR(found.camera.focal_px.x, 900.0, 900.0 * tolerance::kIterative);
    EXPECT_LT(glm::length(found.camera.position_m - room.camera.position_m), 1e-5);
}

TEST(HardCases, LinesAlmostThroughTheVanishingPoint)
{
    // z vanishes in the picture; segments end 3 px beside that point, or pass it.
    Room room = makeRoom({12.0, -4.0, 0.0, 900.0, 1.5}, {6, 6, 4}, 63);
    const glm::dvec2 vanishing =
        room.camera.project(room.camera.position_m - glm::dvec3(0, 0, 1e7)).value();
    for (const double angle : {0.4, 2.0, 3.6, 5.2}) {
        const glm::dvec2 away(std::cos(angle), std::sin(angle));
        room.lines.segments.push_back(
            {RoomAxis::Z, vanishing + 260.0 * away, vanishing + 3.0 * away});
    }
    room.lines.segments.push_back(
        {RoomAxis::Z, vanishing + glm::dvec2(200.0, 90.0), vanishing - glm::dvec2(20.0, 9.0)});
    RandomStream random(64, 0, 0);
    synthetic::addNoise(room.lines, 0.7, random);
    const CameraEstimate found = solved(room);
    EXPECT_TRUE(found.outlier_segments.empty());
    expectWithin(found, room.camera);
}

// The right third of a picture that looked up at a corner: the middle of the whole is outside.
TEST(HardCases, APrincipalPointOutsideTheCrop)
{
    Room room = makeRoom({40.0, -30.0, 0.0, 700.0, 1.5}, {0, 0, 0}, 65);
    room.camera.principal_px = {-150.0, 420.0};
    const glm::dvec3 ray = room.camera.rayDirection(room.lines.origin_px);
    room.camera.position_m = ray * (1.5 / ray.y);
    RandomStream random(66, 0, 0);
    for (int i = 0; i < 36; ++i)
        room.lines.segments.push_back(
            synthetic::randomSegment(room.camera, static_cast<RoomAxis>(i % 3), random));
    synthetic::addNoise(room.lines, 0.5, random);
    CalibrationOptions options;
    options.segment_sigma_px = 0.5;
    options.principal_sigma = 1.0;
    const CameraEstimate found = solved(room, options);
    EXPECT_TRUE(hasFinding(found.findings, "principal-point-estimated"));
    EXPECT_LT(glm::length(found.camera.principal_px - room.camera.principal_px),
              4.0 * glm::length(found.principal_sigma_px));
    EXPECT_LT(found.camera.principal_px.x, 0.0);
    expectWithin(found, room.camera);
}

TEST(HardCases, ScaleFromATenCentimetreObject)
{
    Room room = makeRoom({38.0, -20.0, 0.0, 900.0, 1.5}, {6, 6, 6}, 67);
    room.lines.camera_height_m.reset();
    const glm::dvec3 foot(0.2, 0.0, 0.1);
    room.lines.lengths = {{*room.camera.project(foot),
                           *room.camera.project(foot + glm::dvec3(0.0, 0.1, 0.0)),
                           KnownLength::On::Vertical,
                           0.1,
                           0.001}};
    RandomStream random(68, 0, 0);
    synthetic::addNoise(room.lines, 0.5, random);
    CalibrationOptions options;
    options.segment_sigma_px = 0.5;
    const CameraEstimate found = solved(room, options);
    expectWithin(found, room.camera);
    EXPECT_TRUE(hasFinding(found.findings, "known-length"));
    // 0.7 px of about 25 px, and 1 % of the length.
    EXPECT_NEAR(
        glm::length(found.position_sigma_m) / glm::length(room.camera.position_m), 0.03, 0.02);
}

/// A one-point view: nothing but the picture plane's own directions and the depth.
Room onePoint()
{
    return makeRoom({0.0, 0.0, 0.0, 1000.0, 1.5}, {6, 6, 6}, 71);
}

TEST(HardCases, AOnePointViewSaysWhatItNeeds)
{
    try {
        static_cast<void>(solved(onePoint()));
        FAIL() << "a one-point view has no focal length";
    } catch (const NoAnswerError& error) {
        EXPECT_THAT(error.what(), HasSubstr("one-point"));
        EXPECT_THAT(error.what(), HasSubstr("rectangle of known ratio"));
    }
}

TEST(HardCases, ARectangleOnTheFloorOpensAOnePointView)
{
    Room room = onePoint();
    MarkedRectangle rectangle;
    const glm::dvec3 corner(-0.4, 0.0, -1.2);
    const glm::dvec3 corners[4] = {corner,
                                   corner + glm::dvec3(1.2, 0, 0),
                                   corner + glm::dvec3(1.2, 0, 0.8),
                                   corner + glm::dvec3(0, 0, 0.8)};
    for (std::size_t i = 0; i < 4; ++i)
        rectangle.corners_px[i] = *room.camera.project(corners[i]);
    rectangle.ratio = 1.5;
    rectangle.on_floor = true;
    room.lines.rectangles = {rectangle};
    const CameraEstimate found = solved(room);
    EXPECT_NEAR(found.camera.focal_px.x, 1000.0, 1e-3);
    EXPECT_LT(found.focal_sigma_px, 0.1 * 1000.0);
}

TEST(HardCases, ALengthInDepthOpensAOnePointView)
{
    Room room = onePoint();
    room.lines.lengths = {{*room.camera.project({0.3, 0.0, -1.5}),
                           *room.camera.project({0.3, 0.0, 0.5}),
                           KnownLength::On::Floor,
                           2.0}};
    const CameraEstimate found = solved(room);
    EXPECT_NEAR(found.camera.focal_px.x, 1000.0, 1e-3);
}

// Marked by eye along the gallery's skirting, ceiling and picture frames: one vanishing point.
TEST(HardCases, TheGalleryOfOnePoint)
{
    INSITU_NEEDS_DATA();
    const Photo photo = readPhoto(dataFolder() / "rooms" / "museum_one_point.jpg");
    LineSet lines;
    lines.width = photo.image.codes.width();
    lines.height = photo.image.codes.height();
    lines.segments = {{RoomAxis::Z, {0, 585}, {183, 511}},
                      {RoomAxis::Z, {1024, 612}, {778, 512}},
                      {RoomAxis::Z, {0, 83}, {185, 196}},
                      {RoomAxis::Z, {1024, 45}, {778, 197}},
                      {RoomAxis::Z, {283, 0}, {375, 172}},
                      {RoomAxis::X, {185, 511}, {778, 512}},
                      {RoomAxis::X, {186, 196}, {778, 197}},
                      {RoomAxis::X, {268, 171}, {697, 172}},
                      {RoomAxis::Y, {186, 197}, {183, 511}},
                      {RoomAxis::Y, {778, 198}, {778, 512}},
                      {RoomAxis::Y, {310, 294}, {309, 464}},
                      {RoomAxis::Y, {378, 294}, {378, 464}}};
    const double w = lines.width;
    const double h = lines.height;
    lines.origin_px = {0.5 * w, 0.9 * h};
    lines.camera_height_m = 1.6;
    CalibrationOptions options;
    options.segment_sigma_px = 1.5;
    EXPECT_THROW(static_cast<void>(calibratePhoto(lines, photo, options, "lines")), NoAnswerError);
    options.exif_focal_px = 0.9 * w;
    const CameraEstimate found = calibratePhoto(lines, photo, options, "lines");
    EXPECT_TRUE(hasFinding(found.findings, "focal-from-exif"));
}

}  // namespace
}  // namespace insitu
