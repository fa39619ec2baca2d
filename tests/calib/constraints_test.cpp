#include "calib/camera_solve.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>

namespace insitu {
namespace {

using synthetic::makeRoom;
using synthetic::Room;
using synthetic::rotationError;

CameraEstimate solved(const LineSet& lines, const CalibrationOptions& options = {})
{
    return calibrateCamera(lines, options, "lines");
}

/// `count` lines of the room, traced at nine points, as the room's bent camera shows them.
void traceLines(Room& room, int count, RandomStream& random)
{
    Camera straight = room.camera;
    straight.division = 0.0;
    const auto seen = [&](glm::dvec2 pixel) { return room.camera.distorted(pixel).value(); };
    for (int i = 0; i < count; ++i) {
        const LineSegment one =
            synthetic::randomSegment(straight, static_cast<RoomAxis>(i % 3), random);
        LineSegment traced{one.axis, seen(one.from_px), seen(one.to_px)};
        for (int k = 1; k < 8; ++k)
            traced.via_px.push_back(seen(glm::mix(one.from_px, one.to_px, k / 8.0)));
        room.lines.segments.push_back(traced);
    }
    room.lines.origin_px = seen(room.lines.origin_px);
}

void shake(LineSet& lines, double sigma_px, RandomStream& random)
{
    synthetic::addNoise(lines, sigma_px, random);
    for (LineSegment& segment : lines.segments)
        for (glm::dvec2& point : segment.via_px)
            point += sigma_px * glm::dvec2(random.normal(), random.normal());
}

// Thirty curved lines give a division of ±0.1 within 5 %, with an honest standard deviation.
TEST(Distortion, IsRecoveredFromThirtyCurvedLines)
{
    for (const double division : {-0.1, 0.1}) {
        double squares = 0.0;
        constexpr int kDraws = 12;
        for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
            SCOPED_TRACE(draw);
            Room room = makeRoom({35.0, -18.0, 0.0, 900.0, 1.5}, {0, 0, 0}, draw);
            room.camera.division = division;
            RandomStream random(81, 0, draw);
            traceLines(room, 30, random);
            shake(room.lines, 0.5, random);
            CalibrationOptions options;
            options.segment_sigma_px = 0.5;
            options.principal_sigma = 0.0;
            const CameraEstimate found = solved(room.lines, options);
            EXPECT_TRUE(hasFinding(found.findings, "distortion-estimated"));
            EXPECT_NEAR(found.camera.division, division, 0.05 * std::abs(division));
            EXPECT_NEAR(found.camera.focal_px.x, 900.0, 4.0 * found.focal_sigma_px);
            const double off = (found.camera.division - division) / found.division_sigma;
            squares += off * off / kDraws;
        }
        EXPECT_NEAR(squares, 1.0, tolerance::kStandardErrors * std::sqrt(2.0 / kDraws));
    }
}

TEST(Distortion, StraightLinesGiveNone)
{
    Room room = makeRoom({35.0, -18.0, 0.0, 900.0, 1.5}, {0, 0, 0}, 3);
    RandomStream random(83, 0, 0);
    traceLines(room, 30, random);
    shake(room.lines, 0.5, random);
    CalibrationOptions options;
    options.segment_sigma_px = 0.5;
    const CameraEstimate found = solved(room.lines, options);
    EXPECT_LT(std::abs(found.camera.division), 2.0 * found.division_sigma);
    EXPECT_LT(found.division_sigma, 0.01);
}

TEST(Distortion, LinesOfAnyDirectionTellIt)
{
    Room room = makeRoom({35.0, -18.0, 0.0, 900.0, 1.5}, {0, 0, 0}, 5);
    room.camera.division = -0.08;
    RandomStream random(85, 0, 0);
    traceLines(room, 12, random);
    for (LineSegment& segment : room.lines.segments)
        segment.via_px.clear();
    for (int i = 0; i < 12; ++i) {
        const glm::dvec2 from(1200.0 * random.uniformDouble(), 900.0 * random.uniformDouble());
        const glm::dvec2 to(1200.0 * random.uniformDouble(), 900.0 * random.uniformDouble());
        auto& line = room.lines.straight_lines.emplace_back();
        for (int k = 0; k <= 6; ++k)
            line.push_back(room.camera.distorted(glm::mix(from, to, k / 6.0)).value());
    }
    const CameraEstimate found = solved(room.lines);
    EXPECT_NEAR(found.camera.division, -0.08, 1e-3);  // the prior pulls by a 600th
    EXPECT_LT(rotationError(found.camera, room.camera), 1e-4);
}

// Two-point segments show a strong lens too, by where they meet; told as a finding.
TEST(Distortion, ShowsInStraightSegmentsWhenStrong)
{
    Room room = makeRoom({35.0, -18.0, 0.0, 900.0, 1.5}, {0, 0, 0}, 7);
    room.camera.division = -0.1;
    RandomStream random(87, 0, 0);
    traceLines(room, 36, random);
    for (LineSegment& segment : room.lines.segments)
        segment.via_px.clear();
    synthetic::addNoise(room.lines, 0.5, random);
    CalibrationOptions options;
    options.segment_sigma_px = 0.5;
    const CameraEstimate found = solved(room.lines, options);
    EXPECT_TRUE(hasFinding(found.findings, "distortion-estimated"));
    EXPECT_NEAR(found.camera.division, -0.1, 4.0 * found.division_sigma);
    EXPECT_TRUE(
        hasFinding(solved(makeRoom({}, {9, 9, 9}, 9).lines).findings, "distortion-assumed"));
}

TEST(Constraints, ExactOnesChangeNothing)
{
    Room room = makeRoom({35.0, -18.0, 0.0, 900.0, 1.5}, {4, 4, 4}, 11);
    const auto see = [&](glm::dvec3 point) { return room.camera.project(point).value(); };
    MarkedRectangle picture;  // on the wall behind
    picture.corners_px = {
        see({0, 1, -1}), see({0.9, 1, -1}), see({0.9, 1.6, -1}), see({0, 1.6, -1})};
    picture.ratio = 1.5;
    MarkedRectangle carpet;  // askew on the floor, its ratio unknown
    const glm::dvec3 along = 0.8 * glm::dvec3(std::cos(0.5), 0.0, std::sin(0.5));
    const glm::dvec3 across(-0.7 * along.z, 0.0, 0.7 * along.x);
    carpet.corners_px = {see({0, 0, 0}), see(along), see(along + across), see(across)};
    carpet.on_floor = true;
    room.lines.rectangles = {picture, carpet};
    room.lines.right_angles = {{see({0.1, 0, 0.1}),
                                see(glm::dvec3(0.1, 0, 0.1) + along),
                                see(glm::dvec3(0.1, 0, 0.1) - across)}};
    room.lines.points = {{see({0.5, 0, -0.5}), {0.5, 0, -0.5}},
                         {see({-0.3, 0.4, 0}), {-0.3, 0.4, 0}}};
    const Camera& c = room.camera;
    room.lines.gravity = Gravity{{c.right.y, -c.up.y, c.forward.y}, 0.01};
    const CameraEstimate found = solved(room.lines);
    EXPECT_NEAR(found.camera.focal_px.x, 900.0, 900.0 * tolerance::kIterative);
    EXPECT_LT(rotationError(found.camera, room.camera), tolerance::kIterative);
    EXPECT_LT(glm::length(found.camera.position_m - c.position_m), 10.0 * tolerance::kIterative);
    // Each of them tells something.
    const CameraEstimate lines_only =
        solved(makeRoom({35.0, -18.0, 0.0, 900.0, 1.5}, {4, 4, 4}, 11).lines);
    EXPECT_LT(found.focal_sigma_px, 0.9 * lines_only.focal_sigma_px);
    EXPECT_LT(found.rotation_sigma_rad, lines_only.rotation_sigma_rad);
    EXPECT_LT(glm::length(found.position_sigma_m), glm::length(lines_only.position_sigma_m));
}

TEST(Constraints, GravityHoldsTheHorizon)
{
    Room room = makeRoom({35.0, -18.0, 2.0, 900.0, 1.5}, {4, 0, 3}, 13);
    const CameraEstimate before = solved(room.lines);
    const Camera& c = room.camera;
    room.lines.gravity = Gravity{{c.right.y, -c.up.y, c.forward.y}, 0.002};
    EXPECT_LT(solved(room.lines).turn_sigma_rad.z, before.turn_sigma_rad.z);
}

TEST(Constraints, SeveralLengthsAreLeastSquares)
{
    Room room = makeRoom({38.0, -22.0, 0.0, 900.0, 1.5}, {6, 6, 6}, 15);
    room.lines.camera_height_m.reset();
    const auto add = [&](double metres) {
        room.lines.lengths.push_back({*room.camera.project({0.1, 0, 0}),
                                      *room.camera.project({0.6, 0, 0}),
                                      KnownLength::On::Floor,
                                      metres,
                                      0.01});
    };
    // Same ends, so that the lengths' own errors decide: the mean of 0.51, 0.49, 0.515.
    for (const double metres : {0.51, 0.49, 0.515})
        add(metres);
    const CameraEstimate found = solved(room.lines);
    EXPECT_NEAR(found.camera.position_m.y / 1.5, 0.505 / 0.5, 1e-3);
    EXPECT_FALSE(hasFinding(found.findings, "scale-disagrees"));
    EXPECT_TRUE(hasFinding(found.findings, "known-length"));
}

// Principal point: a prior that enters every interval; the truth may be where it says.
TEST(PrincipalPoint, ThePriorWidensTheIntervals)
{
    const Room room = makeRoom({38.0, -22.0, 0.0, 900.0, 1.5}, {5, 0, 5}, 23);
    CalibrationOptions options;
    options.principal_sigma = 0.0;
    const CameraEstimate known = solved(room.lines, options);
    EXPECT_EQ(known.principal_sigma_px, glm::dvec2(0.0));
    options.principal_sigma = 0.02;
    const CameraEstimate open = solved(room.lines, options);
    EXPECT_GT(open.focal_sigma_px, known.focal_sigma_px);
    EXPECT_GT(open.rotation_sigma_rad, 2.0 * known.rotation_sigma_rad);
    EXPECT_NEAR(open.principal_sigma_px.x, 24.0, 2.0);  // 2 % of 1200 px: the prior's
    EXPECT_EQ(open.camera.focal_px.x, open.camera.focal_px.y);
    EXPECT_TRUE(hasFinding(open.findings, "principal-point-assumed"));
}

TEST(PrincipalPoint, AGivenOneIsUsed)
{
    Room room = makeRoom({38.0, -22.0, 0.0, 900.0, 1.5}, {5, 5, 5}, 25);
    for (LineSegment& segment : room.lines.segments) {
        segment.from_px += glm::dvec2(70.0, -40.0);
        segment.to_px += glm::dvec2(70.0, -40.0);
    }
    room.lines.origin_px += glm::dvec2(70.0, -40.0);
    room.lines.principal_point = KnownPrincipalPoint{{670.0, 410.0}, 0.0};
    const CameraEstimate found = solved(room.lines);
    EXPECT_NEAR(found.camera.focal_px.x, 900.0, 900.0 * tolerance::kIterative);
    EXPECT_EQ(found.camera.principal_px, glm::dvec2(670.0, 410.0));
}

// Stated along, across and height against what 200 noisy calibrations do.
TEST(Placement, SigmasPredictTheErrors)
{
    constexpr int kDraws = 200;
    const Room room = makeRoom({38.0, -22.0, 1.0, 900.0, 1.5}, {5, 5, 5}, 21);
    const glm::dvec3 truth(0.2, 0.0, -0.3);
    const glm::dvec2 pixel = room.camera.project(truth).value();
    double along = 0.0;
    double across = 0.0;
    for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
        RandomStream random(31, 0, draw);
        LineSet lines = room.lines;
        synthetic::addNoise(lines, 0.7, random);
        CalibrationOptions options;
        options.segment_sigma_px = 0.7;
        options.principal_sigma = 0.0;
        const CameraEstimate found = solved(lines, options);
        const glm::dvec3 ray = found.camera.rayDirection(pixel);
        const glm::dvec3 seen = found.camera.position_m - ray * (found.camera.position_m.y / ray.y);
        const auto sigma = placementSigma(found, seen);
        ASSERT_TRUE(sigma);
        const glm::dvec2 away = glm::normalize(
            glm::dvec2(seen.x - found.camera.position_m.x, seen.z - found.camera.position_m.z));
        const glm::dvec2 off(seen.x - truth.x, seen.z - truth.z);
        along += std::pow(glm::dot(off, away) / sigma->along_m, 2.0) / kDraws;
        across += std::pow((away.x * off.y - away.y * off.x) / sigma->across_m, 2.0) / kDraws;
    }
    const double spread = tolerance::kStandardErrors * std::sqrt(2.0 / kDraws);
    EXPECT_NEAR(along, 1.0, spread);
    EXPECT_NEAR(across, 1.0, spread);
}

TEST(Placement, NothingWithoutCovarianceOrView)
{
    const Room room = makeRoom({}, {4, 4, 4}, 27);
    CameraEstimate found = solved(room.lines);
    EXPECT_TRUE(placementSigma(found, {0, 0, 0}));
    EXPECT_FALSE(placementSigma(found, found.camera.position_m - found.camera.forward));
    found.covariance = {};
    EXPECT_FALSE(placementSigma(found, {0, 0, 0}));
}

}  // namespace
}  // namespace insitu
