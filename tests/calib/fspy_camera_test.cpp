#include "calib/camera_formats.h"
#include "core/io/json.h"
#include "tests/calib/known_camera.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/errors.h"
#include "tests/support/file_bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using synthetic::estimateOf;
using synthetic::knownCamera;
using synthetic::kPicture;
using ::testing::HasSubstr;

TEST(Fspy, NumbersAreThoseOfItsImagePlane)
{
    const TemporaryFolder folder;
    const fs::path path = folder / "known.fspy.json";
    (void)writeCameraFile(path, estimateOf(knownCamera()), "", {});
    const Json json = readJson(path);
    // Half the long side is 500 px: 50 px right, 30 px up.
    EXPECT_NEAR(json["principalPoint"]["x"].get<double>(), 0.1, 1e-12);
    EXPECT_NEAR(json["principalPoint"]["y"].get<double>(), 0.06, 1e-12);
    EXPECT_NEAR(json["relativeFocalLength"].get<double>(), 1.6, 1e-12);
    EXPECT_EQ(json["imageWidth"], 1000);
    // Z is up there: our (1, 2, 3) is (1, −3, 2); the camera's right −z is +y, its up z, and it
    // looks along −x, so that its back is +x.
    const double expected[4][4] = {{0, 0, 1, 1}, {1, 0, 0, -3}, {0, 1, 0, 2}, {0, 0, 0, 1}};
    for (std::size_t r = 0; r < 4; ++r)
        for (std::size_t c = 0; c < 4; ++c)
            EXPECT_NEAR(json["cameraTransform"]["rows"][r][c].get<double>(), expected[r][c], 1e-12)
                << r << c;
    // The camera looks along −x: the vanishing point of x lies behind, so that −x is its axis, at
    // the principal point.
    EXPECT_EQ(json["vanishingPointAxes"][0], "xNegative");
    EXPECT_NEAR(json["vanishingPoints"][0]["x"].get<double>(), 0.1, 1e-12);
    EXPECT_NEAR(json["vanishingPoints"][0]["y"].get<double>(), 0.06, 1e-12);
}

TEST(Fspy, AProjectHoldsHeaderStateAndPicture)
{
    const TemporaryFolder folder;
    const fs::path path = folder / "known.fspy";
    (void)writeCameraFile(path, estimateOf(knownCamera()), "", kPicture);
    const std::string bytes = fileBytes(path);
    ASSERT_GT(bytes.size(), 16u);
    EXPECT_EQ(bytes.substr(0, 8), std::string("fspy\1\0\0\0", 8));
    const auto u32 = [&](std::size_t at) {
        std::uint32_t value = 0;
        for (int i = 3; i >= 0; --i)
            value = value << 8 | static_cast<std::uint8_t>(bytes[at + static_cast<std::size_t>(i)]);
        return value;
    };
    EXPECT_EQ(u32(12), kPicture.size());
    EXPECT_EQ(16u + u32(8) + u32(12), bytes.size());
    EXPECT_EQ(bytes.substr(16 + u32(8)), std::string(kPicture.begin(), kPicture.end()));
    EXPECT_THAT(
        inputErrorOf([&] { (void)writeCameraFile(path, estimateOf(knownCamera()), "", {}); }),
        HasSubstr("photograph"));
}

/// The control lines that fSpy solves again must be those of this camera.
TEST(Fspy, ControlLinesRunToTheVanishingPoints)
{
    const TemporaryFolder folder;
    Camera camera = synthetic::cameraOf({});
    camera.position_m = {0.3, 1.5, 2.0};
    const fs::path path = folder / "a.fspy";
    (void)writeCameraFile(path, estimateOf(camera), "", kPicture);
    const std::string bytes = fileBytes(path);
    const Json state = Json::parse(bytes.substr(16, bytes.size() - 16 - kPicture.size()));
    const glm::dvec2 size(camera.width, camera.height);
    const auto pointOf = [&](const Json& at) {
        return glm::dvec2(at["x"].get<double>(), at["y"].get<double>()) * size;
    };
    const auto check = [&](const Json& lines, glm::dvec3 axis) {
        for (const Json& line : lines["lineSegments"]) {
            const glm::dvec3 a = camera.rayDirection(pointOf(line[0]));
            const glm::dvec3 b = camera.rayDirection(pointOf(line[1]));
            EXPECT_NEAR(glm::dot(glm::normalize(glm::cross(a, b)), axis), 0.0, 1e-12);
        }
    };
    check(state["controlPointsStateBase"]["firstVanishingPoint"], {1, 0, 0});
    check(state["controlPointsState2VP"]["secondVanishingPoint"], {0, 0, 1});
    check(state["controlPointsState2VP"]["thirdVanishingPoint"], {0, 1, 0});
}

TEST(Fspy, UnitsAndUprightAxesAreThoseOfTheProject)
{
    const TemporaryFolder folder;
    const fs::path path = folder / "a.fspy";
    (void)writeCameraFile(path, estimateOf(knownCamera()), "", kPicture);
    std::string bytes = fileBytes(path);
    const auto with = [&](const std::string& unit) {
        std::string text = bytes;
        const std::size_t at = text.find("\"Meters\"");
        text.replace(at, 8, "\"" + unit + "\"");
        const std::string state_size(1, static_cast<char>(unit.size() - 6));
        // Keep the declared size: the state grew by the unit's name.
        const auto size = static_cast<std::uint8_t>(text[8]);
        const unsigned grown = size + static_cast<unsigned>(unit.size()) - 6u;
        text[8] = static_cast<char>(grown & 0xFF);
        text[9] = static_cast<char>(static_cast<std::uint8_t>(text[9]) + (grown >> 8));
        return readCameraFile(folder.add("b.fspy", text));
    };
    EXPECT_NEAR(with("Centimeters").camera.position_m.z, 0.03, 1e-12);
    EXPECT_NEAR(with("Inches").camera.position_m.x, 0.0254, 1e-12);
    const CameraEstimate bare = with("No unit");
    EXPECT_NEAR(bare.camera.position_m.z, 3.0, 1e-12);
    EXPECT_TRUE(hasFinding(bare.findings, "camera-unit-unknown"));
    EXPECT_THAT(inputErrorOf([&] { (void)with("Lightyears"); }), HasSubstr("no unit"));

    // A user who called y the upright axis: taken as it is.
    Json json = {{"principalPoint", {{"x", 0}, {"y", 0}}},
                 {"relativeFocalLength", 1.0},
                 {"imageWidth", 200},
                 {"imageHeight", 100}};
    json["cameraTransform"]["rows"] = {{1, 0, 0, 5}, {0, 1, 0, 6}, {0, 0, 1, 7}, {0, 0, 0, 1}};
    const Camera y_up = readCameraFile(folder.add("y.json", json.dump())).camera;
    EXPECT_EQ(y_up.position_m, glm::dvec3(5, 6, 7));
    EXPECT_EQ(y_up.forward, glm::dvec3(0, 0, -1));
    EXPECT_EQ(y_up.focal_px, glm::dvec2(100.0));
    EXPECT_EQ(y_up.principal_px, glm::dvec2(100.0, 50.0));
}

TEST(Fspy, AProjectWithoutACameraSaysSo)
{
    const TemporaryFolder folder;
    const std::string state = R"({"cameraParameters":null})";
    std::string bytes("fspy\1\0\0\0\0\0\0\0\0\0\0\0", 16);
    bytes[8] = static_cast<char>(state.size());
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(folder.add("none.fspy", bytes + state)); }),
                HasSubstr("no solved camera"));
    bytes[4] = 2;
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(folder.add("v2.fspy", bytes + state)); }),
                HasSubstr("version 2"));
    bytes[4] = 1;
    bytes[11] = 0x7F;
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(folder.add("long.fspy", bytes + state)); }),
                HasSubstr("ends early"));
}

}  // namespace
}  // namespace insitu
