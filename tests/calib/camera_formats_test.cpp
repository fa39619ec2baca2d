#include "calib/camera_formats.h"

#include "core/io/json.h"
#include "tests/calib/known_camera.h"
#include "tests/calib/synthetic_room.h"
#include "tests/support/errors.h"
#include "tests/support/file_bytes.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <fstream>
#include <random>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using synthetic::estimateOf;
using synthetic::knownCamera;
using synthetic::kPicture;
using ::testing::HasSubstr;

void expectSame(const Camera& found, const Camera& truth, double principal = 1e-9)
{
    EXPECT_EQ(found.width, truth.width);
    EXPECT_EQ(found.height, truth.height);
    // Text with 17 digits, and one product and quotient or two.
    EXPECT_NEAR(found.focal_px.x, truth.focal_px.x, 1e-9 * truth.focal_px.x);
    EXPECT_NEAR(found.focal_px.y, truth.focal_px.y, 1e-9 * truth.focal_px.y);
    EXPECT_NEAR(glm::length(found.principal_px - truth.principal_px), 0.0, principal);
    EXPECT_NEAR(glm::length(found.position_m - truth.position_m), 0.0, 1e-9);
    EXPECT_LT(synthetic::rotationError(found, truth), 1e-9);
}

/// Every format: written and read back, also with other focal lengths and turned by all angles.
class EveryFormat : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Names,
                         EveryFormat,
                         ::testing::Values("camera.json",
                                           "camera.fspy",
                                           "camera.fspy.json",
                                           "camera.gltf",
                                           "camera.blender.json",
                                           "cameras.txt"));

TEST_P(EveryFormat, GivesBackTheCamera)
{
    RandomStream random(11, 0, 0);
    for (int i = 0; i < 12; ++i) {
        const TemporaryFolder folder;
        Camera camera = synthetic::cameraOf(synthetic::randomView(random));
        camera.position_m = {random.normal(), 1.5 + 0.3 * random.normal(), random.normal()};
        camera.principal_px += glm::dvec2(20.0 * random.normal(), 20.0 * random.normal());
        if (i % 2 == 1) std::swap(camera.width, camera.height);
        const fs::path path = folder / GetParam();
        (void)writeCameraFile(path, estimateOf(camera), "room one.jpg", kPicture);
        expectSame(readCameraFile(path).camera, camera);
    }
}

TEST_P(EveryFormat, NamesTheFilesThatItWrites)
{
    const TemporaryFolder folder;
    const fs::path path = folder / GetParam();
    (void)writeCameraFile(path, estimateOf(knownCamera()), "room.jpg", kPicture);
    std::size_t written = 0;
    for (const auto& entry : fs::directory_iterator(path.parent_path()))
        written += entry.is_regular_file() ? 1u : 0u;
    EXPECT_EQ(written, cameraFilesOf(path).size());
    for (const fs::path& file : cameraFilesOf(path))
        EXPECT_TRUE(fs::exists(file)) << file;
}

TEST_P(EveryFormat, ASizeThatIsNotThePhotographsIsRefused)
{
    if (std::string(GetParam()) == "camera.json") return;  // compared by whom reads it, too
    const TemporaryFolder folder;
    const fs::path path = folder / GetParam();
    (void)writeCameraFile(path, estimateOf(knownCamera()), "room.jpg", kPicture);
    CameraReading reading;
    reading.size_px = glm::ivec2(500, 300);
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(path, reading); }), HasSubstr("1000x600"));
}

/// Truncated at every length and changed at random: an InputError or a camera, never more.
TEST_P(EveryFormat, SurvivesDamage)
{
    const TemporaryFolder folder;
    const fs::path path = folder / GetParam();
    (void)writeCameraFile(path, estimateOf(knownCamera()), "room.jpg", kPicture);
    for (const fs::path& file : cameraFilesOf(path)) {
        const std::string whole = fileBytes(file);
        const auto tryWith = [&](const std::string& bytes) {
            fs::remove(file);
            std::ofstream(file, std::ios::binary) << bytes;
            try {
                const Camera camera = readCameraFile(path).camera;
                EXPECT_TRUE(std::isfinite(camera.focal_px.x) && camera.focal_px.x > 0.0);
                EXPECT_TRUE(std::isfinite(glm::length(camera.position_m)));
                EXPECT_NEAR(glm::length(camera.forward), 1.0, 1e-9);
            } catch (const InputError& error) {
                EXPECT_THAT(error.what(), HasSubstr(path.parent_path().string()));
            }
        };
        for (std::size_t length = 0; length < whole.size(); length += 1 + whole.size() / 60)
            tryWith(whole.substr(0, length));
        std::mt19937 random(17);
        for (int run = 0; run < 150; ++run) {
            std::string bytes = whole;
            for (int change = 0; change < 2 && !bytes.empty(); ++change) {
                static constexpr std::string_view kTelling = "09-.e{}[]\",: \n\xFF\x80";
                const std::size_t at = random() % bytes.size();
                if (random() % 3 == 0)
                    bytes.erase(at, 1 + random() % 6);
                else
                    bytes[at] = random() % 2 == 0 ? kTelling[random() % kTelling.size()]
                                                  : static_cast<char>(random() & 0xFF);
            }
            tryWith(bytes);
        }
        fs::remove(file);
        std::ofstream(file, std::ios::binary) << whole;
    }
}

TEST(Colmap, QuaternionAndTranslationAreCameraFromWorld)
{
    const TemporaryFolder folder;
    // Half a turn about x: our y up is its y down; it looks along −z. T = −R C with C = (1, 2, 3).
    folder.add("images.txt",
               "# c\n7 0 1 0 0 -1 2 3 4 my room.jpg\n\n8 1 0 0 0 0 0 0 4 b.jpg\n1 2 3\n");
    const fs::path path = folder.add(
        "cameras.txt", "# c\n3 PINHOLE 9 9 1 1 1 1\n4 PINHOLE 640 480 500 510 320.5 241\n");
    const CameraEstimate found = readCameraFile(path);
    const Camera& camera = found.camera;
    EXPECT_EQ(camera.focal_px, glm::dvec2(500, 510));
    EXPECT_EQ(camera.principal_px, glm::dvec2(320.5, 241));  // (0, 0) is the corner there, too
    EXPECT_NEAR(glm::length(camera.position_m - glm::dvec3(1, 2, 3)), 0.0, 1e-12);
    EXPECT_NEAR(glm::length(camera.forward - glm::dvec3(0, 0, -1)), 0.0, 1e-12);
    EXPECT_NEAR(glm::length(camera.up - glm::dvec3(0, 1, 0)), 0.0, 1e-12);
    EXPECT_TRUE(hasFinding(found.findings, "camera-several"));
    CameraReading reading;
    reading.picture = "b.jpg";
    EXPECT_NEAR(readCameraFile(path, reading).camera.up.y, -1.0, 1e-12);
    reading.picture = "c.jpg";
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(path, reading); }),
                HasSubstr("my room.jpg"));
}

/// k1 = −0.1 and f = the half diagonal: the corner, seen at radius 1, lies at the straight radius r
/// with r (1 − 0.1 r²) = 1.
TEST(Colmap, RadialDistortionBecomesTheDivisionModel)
{
    const TemporaryFolder folder;
    folder.add("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n");
    const CameraEstimate found =
        readCameraFile(folder.add("cameras.txt", "1 SIMPLE_RADIAL 600 800 500 300 400 -0.1\n"));
    double r = 1.0;
    for (int i = 0; i < 100; ++i)
        r = 1.0 / (1.0 - 0.1 * r * r);
    EXPECT_NEAR(found.camera.division, 1.0 / r - 1.0, 1e-9);
    EXPECT_NEAR(r * (1.0 - 0.1 * r * r), 1.0, 1e-9);
    EXPECT_TRUE(hasFinding(found.findings, "camera-distortion-converted"));
    // The corner's straight pixel, by the polynomial.
    const glm::dvec2 straight = found.camera.straightened(glm::dvec2(0.0));
    EXPECT_NEAR(glm::length(straight - found.camera.principal_px), 500.0 * r, 1e-6);
    // And back: the same corner.
    const Findings findings = writeCameraFile(folder / "out.json", found, "", {});
    EXPECT_TRUE(findings.empty());
    fs::create_directories(folder / "two");
    (void)writeCameraFile(folder / "two" / "cameras.txt", found, "a.jpg", {});
    EXPECT_NEAR(readCameraFile(folder / "two" / "cameras.txt").camera.division,
                found.camera.division,
                1e-9);
    EXPECT_TRUE(
        hasFinding(writeCameraFile(folder / "a.gltf", found, "", {}), "camera-distortion-lost"));

    const CameraEstimate tangential = readCameraFile(
        folder.add("cameras.txt", "1 OPENCV 600 800 500 500 300 400 -0.1 0 0.01 0\n"));
    EXPECT_TRUE(hasFinding(tangential.findings, "camera-distortion-ignored"));
    const CameraEstimate folded =
        readCameraFile(folder.add("cameras.txt", "1 SIMPLE_RADIAL 600 800 500 300 400 -0.9\n"));
    EXPECT_EQ(folded.camera.division, 0.0);
    EXPECT_TRUE(hasFinding(folded.findings, "camera-distortion-ignored"));
}

TEST(Gltf, LooksAlongMinusZOfItsNodeAndParents)
{
    const TemporaryFolder folder;
    // The parent moves by (0, 0, 5) and is turned by 90° about y: the child's −z is the world's −x.
    const std::string text = R"({"asset": {"version": "2.0"},
        "nodes": [{"children": [1], "translation": [0, 0, 5],
                   "rotation": [0, 0.7071067811865476, 0, 0.7071067811865476]},
                  {"camera": 0, "translation": [1, 2, 0], "scale": [2, 2, 2]}],
        "cameras": [{"type": "perspective",
                     "perspective": {"yfov": 1.5707963267948966, "znear": 0.1,
                                     "aspectRatio": 2}}]})";
    const fs::path path = folder.add("a.gltf", text);
    CameraReading reading;
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(path); }), HasSubstr("photograph"));
    reading.size_px = glm::ivec2(800, 400);
    const Camera camera = readCameraFile(path, reading).camera;
    EXPECT_NEAR(camera.focal_px.x, 200.0, 1e-9);  // a right angle over 400 px
    EXPECT_EQ(camera.principal_px, glm::dvec2(400.0, 200.0));
    EXPECT_NEAR(glm::length(camera.forward - glm::dvec3(-1, 0, 0)), 0.0, 1e-12);
    EXPECT_NEAR(glm::length(camera.position_m - glm::dvec3(0, 2, 4)), 0.0, 1e-12);
    reading.size_px = glm::ivec2(800, 600);
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile(path, reading); }),
                HasSubstr("aspectRatio"));
}

TEST(Gltf, SaysWhatOtherProgramsLose)
{
    const TemporaryFolder folder;
    const Findings findings = writeCameraFile(folder / "a.gltf", estimateOf(knownCamera()), "", {});
    EXPECT_TRUE(hasFinding(findings, "camera-principal-point-lost"));
    const Json json = readJson(folder / "a.gltf");
    EXPECT_NEAR(json["cameras"][0]["perspective"]["yfov"].get<double>(),
                2.0 * std::atan(300.0 / 800.0),
                1e-12);
    Camera oblong = knownCamera();
    oblong.focal_px.y = 810.0;
    EXPECT_TRUE(hasFinding(writeCameraFile(folder / "a.fspy.json", estimateOf(oblong), "", {}),
                           "camera-focal-averaged"));
}

TEST(Gltf, RefusesLoopsAndStrangeReferences)
{
    const TemporaryFolder folder;
    const auto errorOf = [&](const std::string& nodes) {
        const std::string text =
            R"({"cameras": [{"perspective": {"yfov": 1}, "extras": {"insitu": {"width": 4, "height": 4}}}], "nodes": )" +
            nodes + "}";
        return inputErrorOf([&] { (void)readCameraFile(folder.add("a.gltf", text)); });
    };
    EXPECT_THAT(errorOf(R"([{"children": [1]}, {"children": [0], "camera": 0}])"),
                HasSubstr("ancestor"));
    EXPECT_THAT(errorOf(R"([{"camera": 3}])"), HasSubstr("names no camera"));
    EXPECT_THAT(errorOf(R"([{"children": [9]}])"), HasSubstr("names no node"));
    EXPECT_THAT(errorOf(R"([{}])"), HasSubstr("no node holds a camera"));
    EXPECT_THAT(errorOf(R"([{"camera": 0, "scale": [1, 1, -1]}])"), HasSubstr("mirrored"));
}

TEST(Blender, LensAndShiftAreInSharesOfTheSensor)
{
    const TemporaryFolder folder;
    const fs::path path = folder / "a.blender.json";
    (void)writeCameraFile(path, estimateOf(knownCamera()), "", {});
    const Json json = readJson(path);
    EXPECT_NEAR(json["lens"].get<double>(), 0.8 * 36.0, 1e-12);
    EXPECT_NEAR(json["shift_x"].get<double>(), -0.05, 1e-12);
    EXPECT_NEAR(json["shift_y"].get<double>(), -0.03, 1e-12);
    EXPECT_NEAR(json["matrix_world"][1][3].get<double>(), -3.0, 1e-12);
    EXPECT_NEAR(json["matrix_world"][2][3].get<double>(), 2.0, 1e-12);
}

TEST(CameraFormats, AnUnknownNameSaysWhichAreKnown)
{
    EXPECT_THAT(inputErrorOf([&] { (void)readCameraFile("camera.abc"); }), HasSubstr(".fspy"));
    EXPECT_THAT(inputErrorOf([&] { (void)cameraFilesOf("points.txt"); }), HasSubstr("cameras.txt"));
}

}  // namespace
}  // namespace insitu
