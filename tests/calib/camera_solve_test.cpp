#include "calib/camera_solve.h"

#include "core/check.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

using synthetic::makeRoom;
using synthetic::Room;
using synthetic::rotationError;
using synthetic::View;

void expectSameCamera(const Camera& actual, const Camera& expected)
{
    EXPECT_NEAR(
        actual.focal_px.x, expected.focal_px.x, tolerance::kIterative * expected.focal_px.x);
    EXPECT_LT(rotationError(actual, expected), tolerance::kIterative);
    EXPECT_LT(glm::length(actual.position_m - expected.position_m), tolerance::kIterative * 10.0);
}

TEST(CalibrateCamera, ExactLinesGiveTheExactCamera)
{
    RandomStream random(7, 0, 0);
    for (std::uint64_t i = 0; i < 40; ++i) {
        SCOPED_TRACE(i);
        const Room room = makeRoom(synthetic::randomView(random), {3, 3, 3}, i);
        const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines");
        expectSameCamera(estimate.camera, room.camera);
        EXPECT_LT(estimate.residual_rms_px, tolerance::kIterative);
        EXPECT_FALSE(hasFinding(estimate.findings, "segments-inconsistent"));
    }
}

TEST(CalibrateCamera, AnyTwoAxesSuffice)
{
    // The horizontal directions alone leave the focal length weaker than with an upright, but
    // exact.
    const View view{40.0, -25.0, 2.0, 850.0, 1.4};
    for (const std::array<int, 3> counts :
         {std::array{3, 0, 3}, std::array{3, 3, 0}, std::array{0, 3, 3}, std::array{2, 1, 2}}) {
        SCOPED_TRACE(testing::PrintToString(counts));
        const Room room = makeRoom(view, counts, 3);
        expectSameCamera(calibrateCamera(room.lines, {}, "lines").camera, room.camera);
    }
}

TEST(CalibrateCamera, EndsMayBeNamedInEitherOrder)
{
    Room room = makeRoom({}, {3, 2, 3}, 5);
    for (std::size_t i = 0; i < room.lines.segments.size(); i += 2)
        std::swap(room.lines.segments[i].from_px, room.lines.segments[i].to_px);
    expectSameCamera(calibrateCamera(room.lines, {}, "lines").camera, room.camera);
}

TEST(CalibrateCamera, AxesAreRightHandedWithXRightAndYUp)
{
    RandomStream random(11, 0, 0);
    for (std::uint64_t i = 0; i < 10; ++i) {
        const Room room = makeRoom(synthetic::randomView(random), {2, 2, 2}, 100 + i);
        const Camera camera = calibrateCamera(room.lines, {}, "lines").camera;
        EXPECT_GT(camera.right.x, 0.0);
        EXPECT_GT(camera.up.y, 0.0);
        EXPECT_LT(camera.forward.z, 0.0);
        EXPECT_NEAR(glm::dot(glm::cross(camera.right, camera.up), camera.forward),
                    -1.0,
                    tolerance::kDouble * 10.0);
    }
}

TEST(CalibrateCamera, ACeilingOrAFloorCanFillTheView)
{
    // Looking almost straight down "up in the picture" says nothing; the origin on the floor does.
    const Room room = makeRoom({30.0, -86.0, 0.0, 900.0, 2.0}, {4, 0, 4}, 9);
    CalibrationOptions options;
    options.exif_focal_px = 900.0;
    options.exif_focal_sigma = 1e-4;
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines");
    EXPECT_NEAR(estimate.camera.position_m.y, 2.0, 1e-3);  // the prior's own error times the height
}

// mean of squared errors over their predicted variances = 1 within its sampling error.
TEST(CalibrateCamera, StandardDeviationsPredictTheErrors)
{
    constexpr int kDraws = 200;
    constexpr double kNoise = 0.7;
    const Room room = makeRoom({38.0, -22.0, 1.0, 900.0, 1.5}, {5, 5, 5}, 21);
    double focal = 0.0;
    double rotation = 0.0;
    glm::dvec3 position(0.0);
    for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
        RandomStream random(31, 0, draw);
        LineSet lines = room.lines;
        synthetic::addNoise(lines, kNoise, random);
        CalibrationOptions options;
        options.segment_sigma_px = kNoise;
        const CameraEstimate estimate = calibrateCamera(lines, options, "lines");
        const double f = (estimate.camera.focal_px.x - 900.0) / estimate.focal_sigma_px;
        const double r = rotationError(estimate.camera, room.camera) / estimate.rotation_sigma_rad;
        const glm::dvec3 p =
            (estimate.camera.position_m - room.camera.position_m) / estimate.position_sigma_m;
        focal += f * f / kDraws;
        rotation += r * r / kDraws;
        // The given height is exact, so that y has neither error nor deviation.
        position += glm::dvec3(p.x * p.x, 0.0, p.z * p.z) / static_cast<double>(kDraws);
    }
    // Variance of the mean of N squared unit normals: 2/N.
    const double spread = tolerance::kStandardErrors * std::sqrt(2.0 / kDraws);
    EXPECT_NEAR(focal, 1.0, spread);
    EXPECT_NEAR(rotation, 1.0, spread);
    for (const int i : {0, 2})
        EXPECT_NEAR(position[i], 1.0, spread) << i;
}

TEST(CalibrateCamera, AGivenHeightIsKept)
{
    Room room = makeRoom({}, {3, 3, 3}, 22);
    EXPECT_EQ(calibrateCamera(room.lines, {}, "lines").position_sigma_m.y, 0.0);
    room.lines.camera_height_sigma_m = 0.02;
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines");
    EXPECT_NEAR(estimate.camera.position_m.y, 1.5, 1.5 * tolerance::kDouble);
    EXPECT_NEAR(estimate.position_sigma_m.y, 0.02, 0.02 * tolerance::kJacobian);
}

TEST(CalibrateCamera, MoreSegmentsHelp)
{
    const auto errorWith = [](int count) {
        double sum = 0.0;
        const Room room = makeRoom({}, {count, count, count}, 2);
        for (std::uint64_t draw = 0; draw < 40; ++draw) {
            RandomStream random(5, 0, draw);
            LineSet lines = room.lines;
            synthetic::addNoise(lines, 0.8, random);
            const double error =
                calibrateCamera(lines, {}, "lines").camera.focal_px.x / room.camera.focal_px.x -
                1.0;
            sum += error * error;
        }
        return std::sqrt(sum / 40.0);
    };
    EXPECT_LT(errorWith(12), 0.7 * errorWith(3));
}

TEST(CalibrateCamera, NearlyParallelLinesAreNoSpecialCase)
{
    // x is within a thousandth of a degree of the picture plane; z and y carry the focal length.
    const Room room = makeRoom({0.001, -25.0, 0.0, 900.0, 1.5}, {4, 4, 4}, 13);
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines");
    expectSameCamera(estimate.camera, room.camera);
    EXPECT_FALSE(estimate.vanishing_points_px[0]);
    EXPECT_TRUE(estimate.vanishing_points_px[2]);
}

TEST(CalibrateCamera, OnePointViewTakesTheFocalLengthFromExif)
{
    Room room = makeRoom({0.0, 0.0, 0.0, 1000.0, 1.5}, {4, 4, 4}, 17);
    EXPECT_THROW(static_cast<void>(calibrateCamera(room.lines, {}, "lines")), NoAnswerError);
    CalibrationOptions options;
    options.exif_focal_px = 1000.0;
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines");
    EXPECT_TRUE(hasFinding(estimate.findings, "focal-from-exif"));
    expectSameCamera(estimate.camera, room.camera);
    EXPECT_NEAR(estimate.focal_sigma_px / 1000.0, options.exif_focal_sigma, 1e-4);  // the prior's
}

TEST(CalibrateCamera, ExifIsIgnoredOnRequestWhereLinesSuffice)
{
    const Room room = makeRoom({}, {3, 3, 3}, 19);
    CalibrationOptions options;
    options.exif_focal_px = 930.0;  // 3.3 % off: no contradiction at 3 %
    const double pulled = calibrateCamera(room.lines, options, "lines").camera.focal_px.x;
    options.use_exif = false;
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines");
    EXPECT_GT(pulled, 900.0 + 1e-3);
    expectSameCamera(estimate.camera, room.camera);
}

// What the assumed principal point costs: 1 % of the picture's width off.
TEST(CalibrateCamera, PrincipalPointOffCentreShiftsButDoesNotBreak)
{
    Room room = makeRoom({38.0, -22.0, 0.0, 900.0, 1.5}, {5, 5, 5}, 23);
    for (LineSegment& segment : room.lines.segments) {
        segment.from_px.x += 12.0;
        segment.to_px.x += 12.0;
    }
    room.lines.origin_px.x += 12.0;
    CalibrationOptions options;
    options.principal_sigma = 0.0;
    const CameraEstimate estimate = calibrateCamera(room.lines, options, "lines");
    EXPECT_TRUE(hasFinding(estimate.findings, "principal-point-assumed"));
    // An offset of 12 px at 900 px focal length is a turn of 0.76°, and no more than that.
    EXPECT_NEAR(glm::degrees(rotationError(estimate.camera, room.camera)), 0.76, 0.3);
    EXPECT_NEAR(estimate.camera.focal_px.x, 900.0, 0.03 * 900.0);
    // With its place open within 1 %, the third vanishing point tells most of it.
    const CameraEstimate open = calibrateCamera(room.lines, {}, "lines");
    EXPECT_GT(open.camera.principal_px.x, 606.0);
    EXPECT_LT(rotationError(open.camera, room.camera),
              0.5 * rotationError(estimate.camera, room.camera));
}

TEST(CalibrateCamera, UnitsOfTheHeightAreTheUnitsOfThePosition)
{
    Room room = makeRoom({}, {3, 3, 3}, 29);
    room.lines.camera_height_m = 1500.0;  // millimetres
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines");
    EXPECT_LT(glm::length(estimate.camera.position_m - 1000.0 * room.camera.position_m), 1e-2);
}

KnownLength measure(const Camera& camera, glm::dvec3 from, glm::dvec3 to, KnownLength::On on)
{
    return {*camera.project(from), *camera.project(to), on, glm::length(to - from)};
}

TEST(CalibrateCamera, KnownLengthsGiveTheScale)
{
    Room room = makeRoom({}, {3, 3, 3}, 37);
    room.lines.camera_height_m.reset();
    const KnownLength on_floor =
        measure(room.camera, {0.1, 0, 0}, {0.7, 0, -0.4}, KnownLength::On::Floor);
    const KnownLength upright =
        measure(room.camera, {-0.3, 0, -0.5}, {-0.3, 0.6, -0.5}, KnownLength::On::Vertical);
    for (const std::vector<KnownLength>& lengths :
         {std::vector{on_floor}, std::vector{upright}, std::vector{on_floor, upright}}) {
        room.lines.lengths = lengths;
        expectSameCamera(calibrateCamera(room.lines, {}, "lines").camera, room.camera);
    }
}

TEST(CalibrateCamera, NoisyLengthsHaveHonestSigmas)
{
    constexpr int kDraws = 100;
    Room room = makeRoom({38.0, -22.0, 0.0, 900.0, 1.5}, {5, 5, 5}, 41);
    room.lines.camera_height_m.reset();
    room.lines.lengths = {
        measure(room.camera, {0.1, 0, 0}, {0.6, 0, -0.4}, KnownLength::On::Floor),
        measure(room.camera, {-0.3, 0, -0.5}, {-0.3, 0.5, -0.5}, KnownLength::On::Vertical)};
    glm::dvec3 position(0.0);
    for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
        RandomStream random(43, 0, draw);
        LineSet lines = room.lines;
        synthetic::addNoise(lines, 0.5, random);
        CalibrationOptions options;
        options.segment_sigma_px = 0.5;
        const CameraEstimate estimate = calibrateCamera(lines, options, "lines");
        const glm::dvec3 p =
            (estimate.camera.position_m - room.camera.position_m) / estimate.position_sigma_m;
        position += p * p / static_cast<double>(kDraws);
    }
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(position[i], 1.0, tolerance::kStandardErrors * std::sqrt(2.0 / kDraws)) << i;
}

TEST(CalibrateCamera, ABarrelLensIsStraightened)
{
    Room room = makeRoom({}, {4, 4, 4}, 47);
    room.camera.division = -0.07;
    room.lines.distortion = {-0.07};
    for (LineSegment& segment : room.lines.segments) {
        segment.from_px = room.camera.distorted(segment.from_px).value();
        segment.to_px = room.camera.distorted(segment.to_px).value();
    }
    room.lines.origin_px = room.camera.distorted(room.lines.origin_px).value();
    const CameraEstimate estimate = calibrateCamera(room.lines, {}, "lines");
    expectSameCamera(estimate.camera, room.camera);
    EXPECT_EQ(estimate.camera.division, -0.07);
    room.lines.distortion = {};
    // Unsaid, it shows where the segments do not meet.
    EXPECT_NEAR(calibrateCamera(room.lines, {}, "lines").camera.division, -0.07, 0.005);
}

}  // namespace
}  // namespace insitu
