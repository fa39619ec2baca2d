#include "pipeline/simulate.h"

#include "calib/line_segments.h"
#include "capture/light_probe.h"
#include "core/check.h"
#include "core/color.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "core/parallel.h"
#include "tests/pipeline/small_room.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <string>

namespace insitu {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;
namespace fs = std::filesystem;

TEST_F(SimulateRoom, BadRoomsAreRefused)
{
    EXPECT_THAT(complaint([](Json& j) { j["format"] = "insitu-project"; }),
                HasSubstr("insitu-room"));
    EXPECT_THAT(complaint([](Json& j) { j["window"] = 1; }),
                AllOf(HasSubstr("did you mean"), HasSubstr("windows")));
    EXPECT_THAT(complaint([](Json& j) {
                    j.erase("environment");
                    j.erase("lamps");
                }),
                HasSubstr("dark"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["room"]["min_m"] = {-2, 0.5, -2};
                }),
                HasSubstr("height 0"));
    EXPECT_THAT(complaint([](Json& j) { j["room"]["surfaces"].erase("back"); }), HasSubstr("back"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["windows"][0]["to_m"] = {1, 3};
                }),
                HasSubstr("windows[0]"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["lamps"][0]["edge_v_m"] = {1, 0, 0};
                }),
                HasSubstr("no area"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["camera"]["position_m"] = {9, 1, 2};
                }),
                HasSubstr("outside the room"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["camera"]["target_m"] = {1.1, 1.4, 2.9};
                }),
                HasSubstr("towards -z"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["camera"]["target_m"] = {1.1, 2.0, -0.5};
                }),
                HasSubstr("origin"));
    EXPECT_THAT(complaint([](Json& j) { j["camera"]["width"] = 1; }), HasSubstr("8 to"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["ball"]["view_position_m"] = {0, 0.4, 0.1};
                }),
                HasSubstr("too near"));
    EXPECT_THAT(complaint([](Json& j) {
                    j["ball"]["further_view_positions_m"] = {{0.4, 0.6, 1}, {0, 0.4, 9}};
                }),
                AllOf(HasSubstr("further_view_positions_m[1]"), HasSubstr("outside")));
    EXPECT_THAT(complaint([](Json& j) {
                    j["ball"]["view_position_m"] = {0, 1.4, 0};
                }),
                HasSubstr("straight up or down"));
    EXPECT_THAT(complaint([](Json& j) { j["photography"]["ball_seconds"] = Json::array(); }),
                HasSubstr("empty"));
    EXPECT_THAT(complaint([](Json& j) { j["render"]["samples_per_pixel"] = 0; }),
                HasSubstr("samples_per_pixel"));
    EXPECT_THAT(complaint([](Json& j) { j["object"]["model"] = "no.obj"; }), HasSubstr("no.obj"));
    EXPECT_THAT(
        complaint([](Json& j) { j["room"]["surfaces"]["floor"]["boards"] = Json::object(); }),
        HasSubstr("more than one"));
}

TEST_F(SimulateRoom, SameBytesForEveryNumberOfThreads)
{
    const SimulatedRoom room = read(good());
    setThreadCount(1);
    const SimulatedCapture one = simulate(room, silent_);
    setThreadCount(4);
    const SimulatedCapture four = simulate(room, silent_);
    EXPECT_EQ(one.truth.plate, four.truth.plate);
    EXPECT_EQ(one.truth.balls, four.truth.balls);
    EXPECT_EQ(one.truth.panorama, four.truth.panorama);
    EXPECT_EQ(one.plate.image.codes, four.plate.image.codes);
    EXPECT_EQ(one.with.image.codes, four.with.image.codes);
    EXPECT_EQ(one.brackets.at(0).at(1).image.codes, four.brackets.at(0).at(1).image.codes);
    EXPECT_EQ(one.lines.segments.at(0).to_px, four.lines.segments.at(0).to_px);
}

TEST_F(SimulateRoom, WhatIsWrittenIsAProject)
{
    const SimulatedRoom room = read(good());
    const fs::path out = folder_ / "capture";
    const SimulatedCapture capture = simulate(room, silent_);
    writeCapture(capture, room, out);
    writeCapture(capture, room, out);  // overwrites itself

    const Project project = readProject(out / "project.json");
    EXPECT_EQ(project.photo.path, out / "plate.jpg");
    ASSERT_TRUE(project.light.probe);
    EXPECT_THAT(project.light.probe->views[0].images, SizeIs(2));
    EXPECT_EQ(project.light.probe->views[0].view_position_m, room.ball_views_m.at(0));
    EXPECT_EQ(project.light.probe->views[0].ball.radius_px, room.ball.radius_px);
    ASSERT_THAT(project.room.boxes, SizeIs(3));  // room, crate, tent
    EXPECT_EQ(project.room.boxes[1].name, "crate");
    EXPECT_TRUE(project.room.boxes[2].solid);
    ASSERT_THAT(project.room.openings, SizeIs(1));
    EXPECT_EQ(project.room.openings[0].corners_m[2], glm::dvec3(-2, 2.2, 1));
    ASSERT_THAT(project.objects, SizeIs(1));
    EXPECT_EQ(project.objects[0].model, folder_ / "tent.obj");
    EXPECT_EQ(project.objects[0].material->base_color, room.object.material->base_color);

    const LineSet lines = readLineSet(*project.camera_lines);
    EXPECT_EQ(lines.width, 64);
    EXPECT_EQ(lines.camera_height_m, 1.4);
    EXPECT_EQ(lines.segments.size(), capture.edges.size());

    const Photo ball = readPhoto(project.light.probe->views[0].images[1].path);
    EXPECT_NEAR(ball.metadata.exposure.seconds.value(), 0.03125, 1e-9);
    for (const char* name : {"truth.jpg",
                             "truth_linear.exr",
                             "plate_linear.exr",
                             "plate.jpg",
                             "pano_linear.exr",
                             "object_mask.png",
                             "truth.json"})
        EXPECT_TRUE(fs::exists(out / "truth" / name)) << name;
    const Json truth = readJson(out / "truth" / "truth.json");
    EXPECT_EQ(truth["response"]["curve"].size(), 3u);
    EXPECT_EQ(truth["exposure_seconds"]["plate"], room.plate_seconds);
}

// Every edge runs towards the vanishing point of its axis; noise has the stated size.
TEST_F(SimulateRoom, LinesAgreeWithTheCamera)
{
    const SimulatedRoom room = read(good());
    const SimulatedScene scene = buildScene(room);
    const std::vector<LineSegment> edges = trueEdges(room, scene);
    int count[3] = {0, 0, 0};
    for (const LineSegment& edge : edges) {
        const int axis = static_cast<int>(edge.axis);
        ++count[axis];
        glm::dvec3 direction{0.0};
        direction[axis] = 1.0;
        // Vanishing point in homogeneous pixels: K R d.
        const Camera& camera = room.camera;
        const glm::dvec3 d{glm::dot(camera.right, direction),
                           -glm::dot(camera.up, direction),
                           glm::dot(camera.forward, direction)};
        const glm::dvec3 vanishing{camera.focal_px.x * d.x + camera.principal_px.x * d.z,
                                   camera.focal_px.y * d.y + camera.principal_px.y * d.z,
                                   d.z};
        const glm::dvec2 middle = 0.5 * (edge.from_px + edge.to_px);
        const glm::dvec2 to_vanishing = glm::dvec2(vanishing) - middle * vanishing.z;
        const glm::dvec2 along = edge.to_px - edge.from_px;
        const double cross = along.x * to_vanishing.y - along.y * to_vanishing.x;
        EXPECT_NEAR(cross / (glm::length(along) * glm::length(to_vanishing)), 0.0, 1e-9)
            << "axis " << axis;
    }
    for (int axis = 0; axis < 3; ++axis)
        EXPECT_GE(count[axis], 2) << "axis " << axis;

    SimulatedRoom quiet = room;
    quiet.line_noise_px = 0.0;
    const LineSet exact = markedLines(quiet, edges);
    EXPECT_EQ(exact.segments[0].from_px, edges[0].from_px);
    EXPECT_EQ(exact.origin_px, room.camera.project(glm::dvec3(0.0)));
    const LineSet noisy = markedLines(room, edges);
    EXPECT_NE(noisy.segments[0].from_px, edges[0].from_px);
    EXPECT_LT(glm::distance(noisy.segments[0].from_px, edges[0].from_px), 5.0 * room.line_noise_px);
}

// The ball's picture, unwrapped by the capture stage, is the panorama: two ways to the same light.
TEST_F(SimulateRoom, BallAndPanoramaAgree)
{
    SimulatedRoom room = read(good());
    room.ball_size_px = 96;
    room.ball.center_px = glm::dvec2(48.0);
    room.ball.radius_px = 48.0 / 1.15;
    const SimulatedScene scene = buildScene(room);
    const SimulatedTruth truth = renderRoom(room, scene, silent_);
    UnwrapOptions options;
    options.width = 32;
    const Camera camera = ballCamera(room.ball, room.ball_views_m.at(0), 96, 96);
    const LightProbe probe = unwrapMirrorBall(truth.balls.at(0), room.ball, camera, options);
    double ball = 0.0;
    double panorama = 0.0;
    double difference = 0.0;
    for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 32; ++x) {
            const double weight = environmentTexelSolidAngle(32, 16, y);
            const double a = static_cast<double>(luminance(probe.environment.pixels(x, y)));
            const double b = static_cast<double>(luminance(truth.panorama(x, y)));
            ball += weight * a;
            panorama += weight * b;
            difference += weight * std::abs(a - b);
        }
    // What is left: the blind spot, the 6 cm between ball and centre at the window's border
    // (texels of 11 degrees), and noise.
    EXPECT_NEAR(ball / panorama, 1.0, 0.1);
    EXPECT_LT(difference / panorama, 0.25);
}

// The object hides what is behind it, darkens the floor next to it and is where its mask is.
TEST_F(SimulateRoom, ObjectIsInTheTruthOnly)
{
    SimulatedRoom room = read(good());
    room.samples_per_pixel = 16;
    const SimulatedScene scene = buildScene(room);
    const SimulatedTruth truth = renderRoom(room, scene, silent_);
    const auto tip = room.camera.project({0.0, 0.5, 0.0});
    ASSERT_TRUE(tip);
    EXPECT_EQ(truth.coverage(static_cast<int>(tip->x), static_cast<int>(tip->y)), 1.0f);
    EXPECT_EQ(truth.coverage(0, 0), 0.0f);
    // Red object: more red than green where it covers all, as the plate is not.
    double with = 0.0;
    double without = 0.0;
    for (std::size_t i = 0; i < truth.coverage.pixelCount(); ++i)
        if (truth.coverage.pixels()[i] == 1.0f) {
            with += static_cast<double>(truth.with.pixels()[i].r / truth.with.pixels()[i].g);
            without += static_cast<double>(truth.plate.pixels()[i].r / truth.plate.pixels()[i].g);
        }
    EXPECT_GT(with, 1.5 * without);
}

}  // namespace
}  // namespace insitu
