#include "calib/probe_pose.h"

#include "capture/ball_outline.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/random.h"
#include "core/response_curve.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/data.h"
#include "tests/support/errors.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using ::testing::HasSubstr;

CameraEstimate exactCamera()
{
    CameraEstimate estimate;
    estimate.camera = synthetic::cameraOf({20, -15, 3, 900, 1.5});
    estimate.camera.position_m = {0.4, 1.5, 3.0};
    return estimate;
}

SeenBall seen(const BallOutline& outline, double radius_m)
{
    SeenBall ball;
    ball.center_px = outline.center_px;
    ball.radius_px = outline.radius_px;
    ball.radius_m = radius_m;
    return ball;
}

/// The outline traced ray by ray (capture/ball_outline.h) against the closed form.
TEST(ProbePose, TheOutlineOfATracedBallGivesItsCentre)
{
    const CameraEstimate camera = exactCamera();
    RandomStream random(4, 0, 0);
    for (int i = 0; i < 30; ++i) {
        const glm::dvec2 pixel(1200.0 * random.uniformDouble(), 900.0 * random.uniformDouble());
        const double distance = 0.3 + 4.0 * random.uniformDouble();
        const double radius = distance * (0.01 + 0.2 * random.uniformDouble());
        const glm::dvec3 center =
            camera.camera.position_m + camera.camera.rayDirection(pixel) * distance;
        const BallOutline outline = predictBallOutline(center, radius, camera.camera);
        const BallPlace found = placeBall(camera, seen(outline, radius), "test");
        // The traced outline has 3600 points: its axes and middle are known to a millionth.
        EXPECT_NEAR(glm::length(found.center_m - center) / distance, 0.0, 2e-5) << i;
        EXPECT_NEAR(found.distance_m / distance, 1.0, 2e-5) << i;
    }
}

/// Off the axis the ball's own centre is not where the outline's is: 45° off, half angle 30°, the
/// cone reaches from 15° to 75°, so the outline's middle is at f (tan 15° + tan 75°)/2 = 2 f.
TEST(ProbePose, KnownCone)
{
    CameraEstimate camera;
    camera.camera = Camera::lookAt({0, 0, 0}, {0, 0, -1}, 100.0, 1000, 1000);
    SeenBall ball;
    ball.center_px = {500.0 + 200.0, 500.0};
    const double along = 100.0 * (std::tan(glm::radians(75.0)) - std::tan(glm::radians(15.0))) / 2;
    const double across = 100.0 * 0.5 / std::sqrt(0.5 - 0.25);
    ball.radius_px = 0.5 * (along + across);
    ball.radius_m = 0.5;
    const BallPlace found = placeBall(camera, ball, "test");
    EXPECT_NEAR(found.distance_m, 1.0, 1e-9);
    const double side = std::sqrt(0.5);
    EXPECT_NEAR(glm::length(found.center_m - glm::dvec3(side, 0.0, -side)), 0.0, 1e-9);
}

/// How often truth lies within the stated deviations, outline and size measured with errors.
TEST(ProbePose, StatedDeviationsHold)
{
    const CameraEstimate camera = exactCamera();
    const double radius = 0.06;
    RandomStream random(6, 0, 0);
    constexpr int kPlaces = 40;
    constexpr int kDraws = 2000;
    std::vector<glm::dvec3> centers;
    std::vector<BallOutline> outlines;
    for (int i = 0; i < kPlaces; ++i) {
        const glm::dvec2 pixel(1200.0 * random.uniformDouble(), 900.0 * random.uniformDouble());
        centers.push_back(camera.camera.position_m +
                          camera.camera.rayDirection(pixel) * (1.0 + 2.0 * random.uniformDouble()));
        outlines.push_back(predictBallOutline(centers.back(), radius, camera.camera));
    }
    int within_one[3] = {};
    int within_two[3] = {};
    for (int i = 0; i < kDraws; ++i) {
        const glm::dvec3 center = centers[static_cast<std::size_t>(i % kPlaces)];
        const BallOutline& outline = outlines[static_cast<std::size_t>(i % kPlaces)];
        SeenBall ball = seen(outline, radius);
        ball.center_sigma_px = 0.3;
        ball.radius_sigma_px = 0.2;
        ball.radius_sigma_m = 0.0005;
        ball.center_px += 0.3 * glm::dvec2(random.normal(), random.normal());
        ball.radius_px += 0.2 * random.normal();
        ball.radius_m += 0.0005 * random.normal();
        const BallPlace found = placeBall(camera, ball, "test");
        for (int k = 0; k < 3; ++k) {
            const double off = std::abs(found.center_m[k] - center[k]) / found.sigma_m[k];
            within_one[k] += off < 1.0 ? 1 : 0;
            within_two[k] += off < 1.96 ? 1 : 0;
        }
    }
    // Binomial deviation of 2000 draws: 1.0 and 0.5 %; four of them.
    for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(within_one[k] / static_cast<double>(kDraws), 0.683, 0.042) << k;
        EXPECT_NEAR(within_two[k] / static_cast<double>(kDraws), 0.95, 0.02) << k;
    }
}

TEST(ProbePose, TheCamerasOwnErrorsAreInIt)
{
    const CameraEstimate exact = exactCamera();
    CameraEstimate doubtful = exact;
    doubtful.focal_sigma_px = 9.0;
    doubtful.rotation_sigma_rad = 0.01;
    doubtful.position_sigma_m = glm::dvec3(0.02);
    const glm::dvec3 center =
        exact.camera.position_m + exact.camera.rayDirection({600.0, 450.0}) * 2.0;
    const SeenBall ball = seen(predictBallOutline(center, 0.06, exact.camera), 0.06);
    EXPECT_NEAR(glm::length(placeBall(exact, ball, "test").sigma_m), 0.0, 1e-12);
    const BallPlace found = placeBall(doubtful, ball, "test");
    // In the middle of the picture 1 % of focal length is 1 % of distance, and the turn's two
    // components across move it by 0.01/√3 · 2 m each.
    EXPECT_NEAR(found.distance_sigma_m, 0.02, 2e-4);
    const double across = 0.01 / std::sqrt(3.0) * 2.0;
    const double expected = 0.02 * 0.02 + 2.0 * across * across + 3.0 * 0.02 * 0.02;
    EXPECT_NEAR(glm::dot(found.sigma_m, found.sigma_m), expected, 0.02 * expected);
}

TEST(ProbePose, WhatACalibrationGetsWrongTogetherIsStated)
{
    constexpr int kDraws = 400;
    int within_one[3] = {};
    int within_two[3] = {};
    double stated = 0.0;
    double as_if_independent = 0.0;
    for (int draw = 0; draw < kDraws; ++draw) {
        synthetic::Room room =
            synthetic::makeRoom({33.0, -16.0, 1.0, 900.0, 1.5}, {5, 5, 5}, 4000 + draw);
        const glm::dvec3 center(0.25, 0.4, -0.3);
        RandomStream random(45, 0, static_cast<std::uint64_t>(draw));
        SeenBall ball = seen(predictBallOutline(center, 0.1, room.camera), 0.1);
        ball.center_sigma_px = 0.1;
        ball.radius_sigma_px = 0.05;
        ball.center_px += 0.1 * glm::dvec2(random.normal(), random.normal());
        ball.radius_px += 0.05 * random.normal();
        synthetic::addNoise(room.lines, 2.0, random);
        CalibrationOptions options;
        options.segment_sigma_px = 2.0;
        options.principal_sigma = 0.0;
        CameraEstimate found = calibrateCamera(room.lines, options, "room");
        const BallPlace place = placeBall(found, ball, "test");
        for (int k = 0; k < 3; ++k) {
            const double off = std::abs(place.center_m[k] - center[k]) / place.sigma_m[k];
            within_one[k] += off < 1.0 ? 1 : 0;
            within_two[k] += off < 1.96 ? 1 : 0;
        }
        stated += glm::dot(place.sigma_m, place.sigma_m);
        found.covariance = {};
        const glm::dvec3 other = placeBall(found, ball, "test").sigma_m;
        as_if_independent += glm::dot(other, other);
    }
    // Binomial deviation of 400 draws: 2.3 and 1.1 %; three of them.
    for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(within_one[k] / static_cast<double>(kDraws), 0.683, 0.07) << k;
        EXPECT_NEAR(within_two[k] / static_cast<double>(kDraws), 0.95, 0.033) << k;
    }
    // Near the origin a turn and the place that follows from it all but cancel.
    EXPECT_LT(stated, 0.5 * as_if_independent);
}

TEST(ProbePose, FindingsAndErrors)
{
    const CameraEstimate camera = exactCamera();
    SeenBall ball;
    ball.center_px = {600, 700};
    ball.radius_px = 10.0;
    ball.radius_sigma_px = 1.0;
    ball.radius_m = 0.06;
    EXPECT_TRUE(hasFinding(placeBall(camera, ball, "b").findings, "probe-place-weak"));
    ball.radius_sigma_px = 0.0;
    EXPECT_FALSE(hasFinding(placeBall(camera, ball, "b").findings, "probe-place-weak"));
    // Ten times as far as the floor is there.
    EXPECT_TRUE(hasFinding(placeBall(camera, ball, "b").findings, "probe-below-floor"));
    const auto errorWith = [&](auto change) {
        SeenBall bad = ball;
        change(bad);
        return inputErrorOf([&] { (void)placeBall(camera, bad, "ball.jpg"); });
    };
    EXPECT_THAT(errorWith([](SeenBall& b) { b.radius_px = 0.0; }), HasSubstr("radius_px"));
    EXPECT_THAT(errorWith([](SeenBall& b) { b.radius_m = -1.0; }), HasSubstr("radius_m"));
    EXPECT_THAT(errorWith([](SeenBall& b) { b.center_px.x = std::nan(""); }),
                HasSubstr("center_px"));
    EXPECT_THAT(errorWith([](SeenBall& b) { b.radius_sigma_px = -1.0; }),
                HasSubstr("radius_sigma_px"));
}

/// Balls that another renderer put into its rooms, found in the picture.
TEST(ProbePose, TruthRooms)
{
    INSITU_NEEDS_DATA();
    for (const char* room : {"truth-room-a", "truth-room-b", "truth-room-c"}) {
        const auto folder = dataFolder() / room;
        const Json json = readJson(folder / "truth.json");
        const JsonNode truth(json, "truth.json");
        const JsonNode node = truth.at("camera");
        CameraEstimate camera;
        camera.camera = {800,
                         600,
                         glm::dvec2(node.at("fx_px").number()),
                         {node.at("cx_px").number(), node.at("cy_px").number()},
                         node.at("position_in_world_m").vec3(),
                         glm::normalize(node.at("right_in_world").vec3()),
                         glm::normalize(node.at("up_in_world").vec3()),
                         glm::normalize(node.at("forward_in_world").vec3())};
        const glm::dvec3 center = truth.at("ball").at("center_in_world_m").vec3();
        const double radius = truth.at("ball").at("radius_m").number();
        const Photo photo = readPhoto(folder / "plate_with_ball.jpg");
        Image<Rgb> picture(800, 600);
        for (std::size_t i = 0; i < picture.pixelCount(); ++i)
            picture.pixels()[i] = Rgb(photo.image.codes.pixels()[i]) / 255.0f + 0.002f;
        BallOutlineOptions options;
        options.ellipse = true;
        options.start = predictBallOutline(center, radius, camera.camera);
        options.start->center_px += glm::dvec2(0.6, -0.5);
        options.start->radius_px *= 1.05;
        const BallOutlineResult found = findBallOutline(picture, options);
        ASSERT_TRUE(found.outline) << room;
        SeenBall ball = seen(*found.outline, radius);
        ball.center_sigma_px = found.outline->center_sigma;
        ball.radius_sigma_px = found.outline->radius_sigma;
        const BallPlace place = placeBall(camera, ball, room);
        const glm::dvec3 off = place.center_m - center;
        // A noisy ball of some 12 px, at the lower end of what outlines are found of: 0.6 px of its
        // radius is a twentieth of the distance.
        EXPECT_LT(glm::length(off), 0.07 * place.distance_m) << room;
        EXPECT_LT(std::abs(place.distance_m - glm::length(center - camera.camera.position_m)),
                  3.0 * place.distance_sigma_m)
            << room;
        const glm::dvec3 ray = glm::normalize(center - camera.camera.position_m);
        EXPECT_LT(glm::length(off - ray * glm::dot(off, ray)), 0.01 * place.distance_m) << room;
    }
}

}  // namespace
}  // namespace insitu
