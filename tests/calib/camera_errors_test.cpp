#include "calib/camera_solve.h"
#include "core/check.h"
#include "tests/calib/synthetic_room.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>

namespace insitu {
namespace {

using synthetic::makeRoom;
using synthetic::Room;
using testing::HasSubstr;

/// The message of the error of type `Error` that calibrating throws; "" when none is thrown.
template <typename Error>
std::string complaint(const LineSet& lines, const CalibrationOptions& options = {})
{
    try {
        static_cast<void>(calibrateCamera(lines, options, "lines.json"));
    } catch (const Error& error) {
        return error.what();
    }
    return "";
}

TEST(CalibrateErrors, ASingleAxisIsNoAnswer)
{
    const Room room = makeRoom({}, {4, 0, 0}, 1);
    CalibrationOptions options;
    options.exif_focal_px = 900.0;
    EXPECT_THAT(complaint<NoAnswerError>(room.lines, options), HasSubstr("second direction"));
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("lines.json:segments"));
}

TEST(CalibrateErrors, NoSegmentsAndOneEachAreNoAnswer)
{
    EXPECT_THAT(complaint<NoAnswerError>(makeRoom({}, {0, 0, 0}, 1).lines), HasSubstr("two axes"));
    EXPECT_THAT(complaint<NoAnswerError>(makeRoom({}, {1, 1, 1}, 1).lines),
                HasSubstr("at least two edges"));
}

TEST(CalibrateErrors, TwoAxesThatTheLinesLeaveOpen)
{
    // Three segments for four unknowns.
    const Room room = makeRoom({}, {2, 0, 1}, 3);
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("focal length"));
    CalibrationOptions options;
    options.exif_focal_px = 900.0;
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines.json");
    EXPECT_TRUE(hasFinding(estimate.findings, "focal-from-exif"));
    EXPECT_LT(synthetic::rotationError(estimate.camera, room.camera), 1e-4);
}

TEST(CalibrateErrors, LinesThatDoNotMeet)
{
    Room room = makeRoom({}, {3, 3, 3}, 5);
    room.lines.segments[0] = {RoomAxis::X, {100, 100}, {400, 500}};
    room.lines.segments[1] = {RoomAxis::X, {100, 500}, {500, 120}};
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("check"));
    CalibrationOptions options;
    options.exif_focal_px = 900.0;
    EXPECT_THAT(complaint<NoAnswerError>(room.lines, options), HasSubstr("do not meet"));
}

TEST(CalibrateErrors, OriginAboveTheHorizon)
{
    Room room = makeRoom({}, {3, 3, 3}, 7);
    room.lines.origin_px = {600.0, 20.0};
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("horizon"));
}

TEST(CalibrateErrors, UprightsThatRunHorizontally)
{
    // x and y exchanged: consistent lines, impossible names.
    Room room = makeRoom({}, {3, 3, 3}, 9);
    for (LineSegment& segment : room.lines.segments)
        if (segment.axis != RoomAxis::Z)
            segment.axis = segment.axis == RoomAxis::X ? RoomAxis::Y : RoomAxis::X;
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("sideways"));
}

TEST(CalibrateErrors, NoScale)
{
    Room room = makeRoom({}, {3, 3, 3}, 11);
    room.lines.camera_height_m.reset();
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("no scale"));
}

TEST(CalibrateErrors, ALengthThatIsNotOnTheFloor)
{
    Room room = makeRoom({}, {3, 3, 3}, 13);
    room.lines.camera_height_m.reset();
    room.lines.lengths = {{{600, 10}, {700, 800}, KnownLength::On::Floor, 1.0}};
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("scale.lengths[0]"));
    // "Straight up" that goes down.
    room.lines.lengths = {{{600, 600}, {600, 800}, KnownLength::On::Vertical, 1.0}};
    EXPECT_THAT(complaint<NoAnswerError>(room.lines), HasSubstr("scale.lengths[0]"));
}

TEST(CalibrateErrors, OptionsOutOfRange)
{
    const Room room = makeRoom({}, {3, 3, 3}, 15);
    CalibrationOptions options;
    options.segment_sigma_px = 0.0;
    options.principal_sigma = 1.5;
    EXPECT_THAT(complaint<InputError>(room.lines, options),
                testing::AllOf(HasSubstr("segment_sigma_px"), HasSubstr("principal_sigma")));
    options = {};
    options.exif_focal_sigma = -1.0;
    options.exif_focal_px = 0.0;
    EXPECT_THAT(complaint<InputError>(room.lines, options),
                testing::AllOf(HasSubstr("exif_focal_sigma"), HasSubstr("exif_focal_px")));
}

TEST(CalibrateErrors, BrokenNumbersNameTheirPlace)
{
    const Room room = makeRoom({}, {3, 3, 3}, 15);
    LineSet lines = room.lines;
    lines.segments[4].to_px.y = std::nan("");
    EXPECT_THAT(complaint<InputError>(lines), HasSubstr("segments[4].to_px"));
    lines = room.lines;
    lines.segments[2].to_px = lines.segments[2].from_px;
    EXPECT_THAT(complaint<InputError>(lines), HasSubstr("segments[2]"));
    lines = room.lines;
    lines.origin_px.x = std::numeric_limits<double>::infinity();
    EXPECT_THAT(complaint<InputError>(lines), HasSubstr("origin_px"));
    lines = room.lines;
    lines.segments[0].from_px.x = 1e9;
    EXPECT_THAT(complaint<InputError>(lines), HasSubstr("far outside"));
    lines = room.lines;
    lines.width = 0;
    EXPECT_THAT(complaint<InputError>(lines), HasSubstr("image"));
    lines = room.lines;
    lines.camera_height_m = -1.0;
    EXPECT_THAT(complaint<InputError>(lines), HasSubstr("camera_height_m"));
}

TEST(CalibrateErrors, LinesOfAnotherPicture)
{
    const Room room = makeRoom({}, {3, 3, 3}, 17);
    EXPECT_NO_THROW(checkLinesMatchPhoto(room.lines, 1200, 900, "lines.json"));
    EXPECT_THROW(checkLinesMatchPhoto(room.lines, 900, 1200, "lines.json"), InputError);
}

TEST(CalibrateFindings, FocalDisagreesWithExif)
{
    const Room room = makeRoom({}, {4, 4, 4}, 19);
    CalibrationOptions options;
    options.exif_focal_px = 1400.0;  // a crop to two thirds that kept the tag
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines.json");
    ASSERT_TRUE(hasFinding(estimate.findings, "focal-disagrees-with-exif"));
    EXPECT_THAT(estimate.findings.front().message, HasSubstr("1400.0"));
    EXPECT_NEAR(estimate.camera.focal_px.x, 900.0, 1e-3);
}

// Too many are off for any of them to be the exception.
TEST(CalibrateFindings, SegmentsInconsistentNamesTheWorst)
{
    Room room = makeRoom({}, {4, 4, 4}, 23);
    RandomStream random(3, 0, 0);
    synthetic::addNoise(room.lines, 4.0, random);
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines.json");
    ASSERT_TRUE(hasFinding(estimate.findings, "segments-inconsistent"));
    EXPECT_TRUE(estimate.outlier_segments.empty());
    for (const Finding& finding : estimate.findings)
        if (finding.code == "segments-inconsistent") {
            EXPECT_THAT(finding.message, HasSubstr("the worst is segments["));
        }
}

TEST(CalibrateFindings, WeakCalibrationSaysSo)
{
    // Almost a one-point view: exact lines, but a pixel of error is worth tens of percent.
    const Room room = makeRoom({4.0, -4.0, 0.0, 900.0, 1.5}, {2, 2, 2}, 25);
    CalibrationOptions options;
    options.exif_focal_px = 900.0;
    options.exif_focal_sigma = 0.1;
    options.segment_sigma_px = 3.0;
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines.json");
    EXPECT_TRUE(hasFinding(estimate.findings, "calibration-weak"));
}

TEST(CalibrateFindings, XAlongTheView)
{
    const Room room = makeRoom({89.5, -20.0, 0.0, 900.0, 1.5}, {4, 4, 4}, 27);
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines.json");
    EXPECT_TRUE(hasFinding(estimate.findings, "axis-sign-ambiguous"));
}

TEST(CalibrateFindings, ScaleDisagrees)
{
    Room room = makeRoom({}, {4, 4, 4}, 29);
    const glm::dvec3 from(0.1, 0.0, 0.0);
    const glm::dvec3 to(0.7, 0.0, -0.4);
    room.lines.lengths = {{*room.camera.project(from),
                           *room.camera.project(to),
                           KnownLength::On::Floor,
                           1.3 * glm::length(to - from)}};
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines.json");
    EXPECT_TRUE(hasFinding(estimate.findings, "scale-disagrees"));
    room.lines.lengths[0].metres /= 1.3;
    EXPECT_FALSE(
        hasFinding(calibrateCamera(room.lines, {}, "lines.json").findings, "scale-disagrees"));
}

}  // namespace
}  // namespace insitu
