#include "calib/room_views.h"

#include "core/io/json.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

using ::testing::HasSubstr;

constexpr double kFocal = 950.0;

struct Simulated {
    RoomViews room;
    std::vector<Camera> truth;
    std::vector<glm::dvec3> points;
};

/// Cameras in a room of 5 x 6 m that look at its middle from around it, one focal length; corners
/// of furniture and marks on the floor are shared.
Simulated simulate(int count, double noise_px, std::uint64_t seed)
{
    Simulated result;
    RandomStream random(seed, 0, 0);
    const double yaws[] = {20.0, 115.0, -80.0, 190.0};
    for (int v = 0; v < count; ++v) {
        const double yaw = yaws[v] + 10.0 * (random.uniformDouble() - 0.5);
        Camera camera = synthetic::cameraOf(
            {yaw, -20.0 - 6.0 * random.uniformDouble(), 2.0 * random.normal(), kFocal, 1.5});
        glm::dvec3 back = -camera.forward;
        back.y = 0.0;
        camera.position_m = 3.2 * glm::normalize(back);
        camera.position_m.y = 1.3 + 0.5 * random.uniformDouble();
        result.truth.push_back(camera);
    }
    // The world begins where the first view marks its origin.
    const glm::dvec2 origin_px(600.0, 800.0);
    const glm::dvec3 ray = result.truth[0].rayDirection(origin_px);
    glm::dvec3 shift = result.truth[0].position_m - ray * (result.truth[0].position_m.y / ray.y);
    for (Camera& camera : result.truth)
        camera.position_m -= glm::dvec3(shift.x, 0.0, shift.z);

    for (int i = 0; i < 10; ++i)
        result.points.push_back(glm::dvec3(1.6 * random.uniformDouble() - 0.8 - shift.x,
                                           i < 5 ? 0.0 : 0.9 * random.uniformDouble(),
                                           1.6 * random.uniformDouble() - 0.8 - shift.z));
    for (int v = 0; v < count; ++v) {
        const Camera& camera = result.truth[static_cast<std::size_t>(v)];
        RoomView view;
        view.name = fmt::format("view {}", v);
        view.camera = "phone";
        view.lines.width = camera.width;
        view.lines.height = camera.height;
        view.lines.origin_px = origin_px;
        view.lines.camera_height_m = camera.position_m.y;
        view.lines.camera_height_sigma_m = 0.005;
        const bool exchanged = std::abs(camera.right.x) < std::abs(camera.right.z);
        for (const RoomAxis axis : {RoomAxis::X, RoomAxis::Y, RoomAxis::Z})
            for (int i = 0; i < 5; ++i) {
                LineSegment segment = synthetic::randomSegment(camera, axis, random);
                // A view's own x is what points right in it.
                if (exchanged && axis != RoomAxis::Y)
                    segment.axis = axis == RoomAxis::X ? RoomAxis::Z : RoomAxis::X;
                view.lines.segments.push_back(segment);
            }
        synthetic::addNoise(view.lines, noise_px, random);
        *view.lines.camera_height_m += noise_px > 0.0 ? 0.005 * random.normal() : 0.0;
        result.room.views.push_back(view);
    }
    for (std::size_t i = 0; i < result.points.size(); ++i) {
        SharedPoint point;
        point.name = fmt::format("p{}", i);
        point.on_floor = result.points[i].y == 0.0;
        for (std::size_t v = 0; v < result.truth.size(); ++v)
            if (const auto seen = result.truth[v].project(result.points[i]);
                seen && synthetic::inside(result.truth[v], *seen))
                point.seen_px[v] = *seen + noise_px * glm::dvec2(random.normal(), random.normal());
        if (point.seen_px.size() >= 2) result.room.points.push_back(point);
    }
    return result;
}

TEST(JoinViews, ExactViewsGiveTheTrueCameras)
{
    for (int count = 1; count <= 4; ++count) {
        const Simulated room = simulate(count, 0.0, 30 + static_cast<std::uint64_t>(count));
        const JoinedViews found = joinViews(room.room, {}, "views");
        for (std::size_t v = 0; v < room.truth.size(); ++v) {
            const Camera& camera = found.cameras[v].camera;
            EXPECT_NEAR(camera.focal_px.x, kFocal, 1e-4) << count << v;
            EXPECT_LT(synthetic::rotationError(camera, room.truth[v]), 1e-7) << count << v;
            EXPECT_LT(glm::length(camera.position_m - room.truth[v].position_m), 1e-6)
                << count << v;
        }
        EXPECT_TRUE(hasFinding(found.findings, "views-joined"));
        EXPECT_FALSE(hasFinding(found.findings, "views-inconsistent"));
    }
}

/// Joined, the cameras are better than alone, and as good as they say.
TEST(JoinViews, BetterThanAloneAndWithinTheStatedDeviations)
{
    constexpr int kRooms = 40;
    double alone = 0.0;
    double together = 0.0;
    int within = 0;
    int all = 0;
    double chi = 0.0;
    double freedom = 0.0;
    for (int i = 0; i < kRooms; ++i) {
        const Simulated room = simulate(2 + i % 3, 1.0, 100 + static_cast<std::uint64_t>(i));
        const JoinedViews found = joinViews(room.room, {}, "views");
        chi += found.chi_squared;
        freedom += found.freedom;
        for (std::size_t v = 0; v < room.truth.size(); ++v) {
            const CameraEstimate own = calibrateCamera(room.room.views[v].lines, {}, "alone");
            const CameraEstimate& joint = found.cameras[v];
            alone += std::pow(std::log(own.camera.focal_px.x / kFocal), 2.0);
            together += std::pow(std::log(joint.camera.focal_px.x / kFocal), 2.0);
            const glm::dvec3 off = joint.camera.position_m - room.truth[v].position_m;
            for (int k = 0; k < 3; ++k) {
                within += std::abs(off[k]) < joint.position_sigma_m[k] ? 1 : 0;
                ++all;
            }
        }
    }
    // Two to four views with one focal length: the mean square falls by more than half.
    EXPECT_LT(together, 0.5 * alone);
    // 360 figures, correlated within a room: four binomial deviations of 120.
    EXPECT_NEAR(within / static_cast<double>(all), 0.683, 0.17);
    EXPECT_NEAR(chi / freedom, 1.0, 0.15);
}

TEST(JoinViews, SharedLengthsGiveTheScale)
{
    Simulated room = simulate(2, 0.0, 7);
    for (RoomView& view : room.room.views) {
        view.lines.camera_height_m = *view.lines.camera_height_m * 1.01;
        view.lines.camera_height_sigma_m = 0.2;
    }
    SharedLength length;
    length.from = 0;
    length.to = room.room.points.size() - 1;
    const auto truthOf = [&](std::size_t i) {
        return room.points[static_cast<std::size_t>(std::stoi(room.room.points[i].name.substr(1)))];
    };
    length.metres = glm::length(truthOf(length.from) - truthOf(length.to));
    length.sigma_m = 0.0005;
    room.room.lengths = {length};
    const JoinedViews found = joinViews(room.room, {}, "views");
    EXPECT_NEAR(found.cameras[0].camera.position_m.y / room.truth[0].position_m.y, 1.0, 1e-3);
}

TEST(JoinViews, APointThatIsAnotherIsNamed)
{
    Simulated room = simulate(3, 0.5, 9);
    auto& seen = room.room.points[0].seen_px;
    seen.begin()->second += glm::dvec2(25.0, 0.0);
    CalibrationOptions options;
    options.segment_sigma_px = 0.5;
    const JoinedViews found = joinViews(room.room, options, "views");
    ASSERT_TRUE(hasFinding(found.findings, "views-inconsistent"));
    EXPECT_THAT(found.findings.back().message, HasSubstr("\"" + room.room.points[0].name + "\""));
}

TEST(JoinViews, ViewsWithoutCommonPointsAreNoAnswer)
{
    Simulated room = simulate(2, 0.0, 11);
    for (SharedPoint& point : room.room.points)
        point.on_floor = false;
    EXPECT_THROW((void)joinViews(room.room, {}, "views"), NoAnswerError);
    room.room.points.clear();
    EXPECT_THAT(inputErrorOf([&] { (void)joinViews(room.room, {}, "views"); }),
                HasSubstr("view 1"));
}

class ViewsFile : public ::testing::Test {
protected:
    void SetUp() override
    {
        folder_.add("a.json", R"({"image": {"width": 100, "height": 80}, "origin_px": [50, 70],
            "segments": [{"axis": "x", "from_px": [1, 2], "to_px": [30, 4]}],
            "scale": {"camera_height_m": 1.5}})");
        json_ = Json::parse(R"({"format": "insitu-views", "version": 1,
            "views": [{"name": "a", "lines": "a.json", "camera": "phone"},
                      {"name": "b", "lines": "a.json"}],
            "points": [{"name": "p", "floor": true, "seen_px": {"a": [1, 2], "b": [3, 4]}},
                       {"name": "q", "seen_px": {"a": [5, 6], "b": [7, 8]}}],
            "lengths": [{"from": "p", "to": "q", "metres": 0.8, "sigma_m": 0.01}]})");
    }
    [[nodiscard]] RoomViews read() const
    {
        return readRoomViews(folder_.add("views.json", json_.dump()));
    }

    TemporaryFolder folder_;
    Json json_;
};

TEST_F(ViewsFile, IsReadWhole)
{
    const RoomViews room = read();
    ASSERT_EQ(room.views.size(), 2u);
    EXPECT_EQ(room.views[0].camera, "phone");
    EXPECT_EQ(room.views[1].lines.segments.size(), 1u);
    EXPECT_TRUE(room.points[0].on_floor);
    EXPECT_EQ(room.points[1].seen_px.at(1), glm::dvec2(7, 8));
    EXPECT_EQ(room.lengths[0].to, 1u);
    EXPECT_EQ(room.lengths[0].sigma_m, 0.01);
}

TEST_F(ViewsFile, MistakesAreNamedWithTheirPlace)
{
    const auto errorAfter = [&](auto change) {
        const Json good = json_;
        change(json_);
        const std::string error = inputErrorOf([&] { (void)read(); });
        json_ = good;
        return error;
    };
    EXPECT_THAT(errorAfter([](Json& j) { j["view"] = 1; }), HasSubstr("views"));
    EXPECT_THAT(errorAfter([](Json& j) { j["format"] = "x"; }), HasSubstr("insitu-views"));
    EXPECT_THAT(errorAfter([](Json& j) { j["version"] = 2; }), HasSubstr("version"));
    EXPECT_THAT(errorAfter([](Json& j) {
                    j["views"][1]["name"] = "a";
                    j.erase("points");
                    j.erase("lengths");
                }),
                HasSubstr("taken"));
    EXPECT_THAT(errorAfter([](Json& j) { j["views"] = Json::array(); }), HasSubstr("views"));
    EXPECT_THAT(errorAfter([](Json& j) {
                    j["points"][0]["seen_px"] = {{"c", {1, 2}}};
                }),
                HasSubstr("points[0].seen_px"));
    EXPECT_THAT(errorAfter([](Json& j) { j["points"][1]["seen_px"].erase("b"); }),
                HasSubstr("at least 2 views"));
    EXPECT_THAT(errorAfter([](Json& j) { j["lengths"][0]["to"] = "p"; }), HasSubstr("different"));
    EXPECT_THAT(errorAfter([](Json& j) { j["lengths"][0]["to"] = "r"; }), HasSubstr("no point"));
    EXPECT_THAT(errorAfter([](Json& j) { j["views"][0]["lines"] = "none.json"; }),
                HasSubstr("none.json"));
}

}  // namespace
}  // namespace insitu
