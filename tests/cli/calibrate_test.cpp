#include "calib/camera_solve.h"
#include "core/io/exif.h"
#include "tests/calib/drawn_board.h"
#include "tests/calib/drawn_room.h"
#include "tests/cli/json_file.h"
#include "tests/cli/run_program.h"
#include "tests/support/apple_exif.h"
#include "tests/support/data.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;

const fs::path kSample = fs::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";

/// The shipped sample's photograph and lines, the lines with one thing changed.
class CalibrateSample : public ::testing::Test {
protected:
    void SetUp() override { lines_ = readJsonFile(kSample / "lines.json"); }

    [[nodiscard]] ProgramRun calibrate() const
    {
        const fs::path file = folder_.add("lines.json", lines_.dump());
        return runProgram({"calibrate",
                           (kSample / "plate.jpg").string(),
                           "--lines",
                           file.string(),
                           "-o",
                           camera().string()});
    }
    [[nodiscard]] fs::path camera() const { return folder_ / "camera.json"; }

    TemporaryFolder folder_;
    Json lines_;
};

TEST_F(CalibrateSample, WritesTheCameraThatTookThePicture)
{
    const ProgramRun run = calibrate();
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    const Json found = readJsonFile(camera());
    const Json truth = readJsonFile(kSample / "truth" / "truth.json");
    const double focal = truth["camera"]["fx_px"].get<double>();
    // docs/validation.md: 0.2 to 0.5 % on rooms like this.
    EXPECT_NEAR(found["focal_px"][0].get<double>() / focal, 1.0, 0.01);
    EXPECT_GT(found["focal_px_sigma"][0].get<double>(), 0.0);

    const ProgramRun again = calibrate();
    EXPECT_EQ(again.exit_code, 1);
    EXPECT_THAT(again.messages, HasSubstr("--force"));
}

TEST_F(CalibrateSample, ASingleAxisIsNoAnswer)
{
    Json kept = Json::array();
    for (const Json& segment : lines_["segments"])
        if (segment["axis"] == "x") kept.push_back(segment);
    lines_["segments"] = kept;
    const ProgramRun run = calibrate();
    EXPECT_EQ(run.exit_code, 3) << run.messages;
    EXPECT_FALSE(fs::exists(camera()));
}

TEST_F(CalibrateSample, BadLinesEndWithTheirPlaceAndCause)
{
    const Json good = lines_;
    lines_["segments"][0]["axes"] = "x";
    EXPECT_THAT(calibrate().messages, HasSubstr("axis"));
    lines_ = good;
    lines_["image"]["width"] = 64;
    const ProgramRun run = calibrate();
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.messages, HasSubstr("lines.json"));
    EXPECT_FALSE(fs::exists(camera()));
}

TEST_F(CalibrateSample, FindsTheRoomByItself)
{
    const auto automatic = [&](const std::vector<std::string>& more) {
        std::vector<std::string> all = {
            "calibrate", (kSample / "plate.jpg").string(), "-o", camera().string()};
        all.insert(all.end(), more.begin(), more.end());
        return runProgram(all);
    };
    const ProgramRun run =
        automatic({"--auto", "--camera-height", "1.55", "--origin", "640", "800"});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("automatic-lines"));
    EXPECT_THAT(run.messages, ::testing::Not(HasSubstr("-assumed]: the world")));
    const Json found = readJsonFile(camera());
    const Json truth = readJsonFile(kSample / "truth" / "truth.json");
    EXPECT_NEAR(found["focal_px"][0].get<double>() / truth["camera"]["fx_px"].get<double>(),
                1.0,
                0.01);  // docs/validation.md, automatic calibration
    EXPECT_NEAR(found["position_m"][1].get<double>(), 1.55, 1e-9);

    const ProgramRun both =
        automatic({"--auto", "--lines", (kSample / "lines.json").string(), "--force"});
    ASSERT_EQ(both.exit_code, 0) << both.messages;
    EXPECT_THAT(both.messages, HasSubstr("lines-completed"));

    EXPECT_EQ(automatic({"--force"}).exit_code, 2);
    EXPECT_EQ(automatic({"--origin", "1", "2", "--force"}).exit_code, 2);
    EXPECT_EQ(automatic({"--auto", "--camera-height", "-1", "--force"}).exit_code, 2);
}

TEST_F(CalibrateSample, APortraitIsTurnedByItsOrientation)
{
    // A telephone held upright, looking down by 8°: stored as landscape, orientation 6.
    Camera truth = Camera::lookAt({0.3, 1.4, 2.6}, {-1.0, 0.9, -0.4}, 780.0, 600, 900);
    const glm::dvec3 up(truth.right.y, -truth.up.y, truth.forward.y);
    const EncodedImage stored = storedSideways(synthetic::drawRoom(truth, 1.0, 9));
    const auto photo = [&](glm::dvec3 up_in_picture, const char* name) {
        // Right, down, forward of the upright picture are the telephone's right, bottom, back.
        const Bytes exif = appleExif({-up_in_picture.x, up_in_picture.y, up_in_picture.z}, 6);
        writeStored(folder_ / name, stored, exif, 6);
        return (folder_ / name).string();
    };
    const auto run = [&](const std::string& file, std::vector<std::string> more) {
        std::vector<std::string> all = {"calibrate",
                                        file,
                                        "--auto",
                                        "--camera-height",
                                        "1.4",
                                        "--force",
                                        "-o",
                                        camera().string()};
        all.insert(all.end(), more.begin(), more.end());
        return runProgram(all);
    };
    const std::string held = photo(up, "held.jpg");
    const ProgramRun found = run(held, {});
    ASSERT_EQ(found.exit_code, 0) << found.messages;
    EXPECT_THAT(found.messages, HasSubstr("gravity-from-exif"));
    const Json json = readJsonFile(camera());
    EXPECT_EQ(json["image"]["width"], 600);
    EXPECT_EQ(json["image"]["height"], 900);
    // docs/validation.md, automatic calibration.
    EXPECT_NEAR(json["focal_px"][0].get<double>() / 780.0, 1.0, 0.01);
    EXPECT_NEAR(json["up"][1].get<double>(), truth.up.y, 0.004);
    EXPECT_NEAR(json["forward"][1].get<double>(), truth.forward.y, 0.004);

    const ProgramRun without = run(held, {"--ignore-exif-gravity"});
    EXPECT_EQ(without.exit_code, 0);
    EXPECT_THAT(without.messages, ::testing::Not(HasSubstr("gravity-from-exif")));
    const glm::dvec3 askew = glm::normalize(up + glm::dvec3(0.2, 0.0, 0.0));
    const ProgramRun contradicted = run(photo(askew, "askew.jpg"), {});
    EXPECT_THAT(contradicted.messages, HasSubstr("gravity-disagrees-with-exif"));
}

TEST_F(CalibrateSample, ReadsAndWritesCamerasOfOtherPrograms)
{
    ASSERT_EQ(calibrate().exit_code, 0);
    const std::string plate = (kSample / "plate.jpg").string();
    const std::string overlay = (folder_ / "overlay.png").string();
    std::string from = camera().string();
    for (const char* name : {"a.fspy", "a.fspy.json", "a.gltf", "a.blender.json", "cameras.txt"}) {
        const std::string to = (folder_ / name).string();
        const ProgramRun run = runProgram({"calibrate", plate, "--from", from, "-o", to});
        ASSERT_EQ(run.exit_code, 0) << name << run.messages;
        from = to;
    }
    const std::string last = (folder_ / "last.json").string();
    ASSERT_EQ(runProgram({"calibrate", plate, "--from", from, "-o", last, "--overlay", overlay})
                  .exit_code,
              0);
    const Json before = readJsonFile(camera());
    const Json after = readJsonFile(last);
    for (const char* key : {"focal_px", "position_m", "forward", "right"})
        EXPECT_NEAR(before[key][0].get<double>(), after[key][0].get<double>(), 1e-6) << key;
    EXPECT_GT(fs::file_size(overlay), 10000u);

    EXPECT_EQ(
        runProgram({"calibrate", "--from", from, "-o", (folder_ / "x.json").string()}).exit_code,
        0);
    EXPECT_EQ(runProgram({"calibrate", "--auto", "-o", (folder_ / "y.json").string()}).exit_code,
              2);
    EXPECT_EQ(runProgram({"calibrate", plate, "--from", from, "-o", (folder_ / "y.abc").string()})
                  .exit_code,
              1);
}

TEST_F(CalibrateSample, JoinsViewsIntoAFolder)
{
    folder_.add("lines.json", lines_.dump());
    Json views = {
        {"format", "insitu-views"},
        {"version", 1},
        {"views",
         {{{"name", "a"}, {"image", (kSample / "plate.jpg").string()}, {"lines", "lines.json"}}}}};
    const std::string file = folder_.add("views.json", views.dump()).string();
    const fs::path cameras = folder_ / "cameras";
    const ProgramRun run = runProgram({"calibrate", "--views", file, "-o", cameras.string()});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    const Json truth = readJsonFile(kSample / "truth" / "truth.json");
    EXPECT_NEAR(readJsonFile(cameras / "a.json")["focal_px"][0].get<double>() /
                    truth["camera"]["fx_px"].get<double>(),
                1.0,
                0.01);
    EXPECT_EQ(runProgram({"calibrate", "--views", file, "-o", cameras.string()}).exit_code, 1);
    // A second view that shares no point with the first.
    views["views"].push_back(views["views"][0]);
    views["views"][1]["name"] = "b";
    folder_.add("views.json", views.dump());
    EXPECT_EQ(
        runProgram({"calibrate", "--views", file, "-o", (folder_ / "two").string()}).exit_code, 3);
}

TEST_F(CalibrateSample, LocatesABallInATruthRoom)
{
    INSITU_NEEDS_DATA();
    const fs::path room = dataFolder() / "truth-room-a";
    std::vector<std::string> arguments = {"calibrate",
                                          (room / "plate.jpg").string(),
                                          "--lines",
                                          (room / "lines.json").string(),
                                          "-o",
                                          camera().string(),
                                          "--locate-ball",
                                          (room / "plate_with_ball.jpg").string()};
    EXPECT_EQ(runProgram(arguments).exit_code, 2);  // how large is it?
    for (const char* more : {"--ball-radius", "0.06", "--ball-near", "447", "367", "12"})
        arguments.emplace_back(more);
    const ProgramRun run = runProgram(arguments);
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    const Json found = Json::parse(run.output);
    // The truth is (0, 0.45, 0), 3.2 m from the camera; ± 0.2 m along the view is stated for this
    // small ball (docs/validation.md).
    const double expected[] = {0.0, 0.45, 0.0};
    for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(found["center_m"][k].get<double>(), expected[k], 0.3) << k;
}

TEST_F(CalibrateSample, APrintedBoardBringsACloseUpIntoTheRoom)
{
    using namespace drawn_board;
    const Laid laid;
    const DrawnBall ball{laid.at({0.34, 0.08}) + glm::dvec3(0.0, 0.05, 0.0), 0.05};
    const Camera room = roomCamera();
    CameraEstimate known;
    known.camera = room;
    writeCamera(folder_ / "known.json", known);
    writeEncoded(folder_ / "room.png", photograph(laid, room, ball));
    const Camera close = closeCamera();
    PhotoMetadata metadata;
    metadata.focal_mm = 50.0;
    metadata.focal_px = close.focal_px.x;
    const EncodedImage picture = photograph(laid, close, ball);
    writeEncoded(folder_ / "close.png", picture, makeExif(metadata, close.width, close.height));
    const glm::dvec2 middle = close.project(ball.center).value();
    const double radius =
        close.focal_px.x * ball.radius_m / glm::distance(ball.center, close.position_m);
    const auto run = [&](const std::vector<std::string>& more) {
        std::vector<std::string> all = {"calibrate",
                                        (folder_ / "room.png").string(),
                                        "--from",
                                        (folder_ / "known.json").string(),
                                        "-o",
                                        camera().string(),
                                        "--force",
                                        "--locate-ball",
                                        (folder_ / "close.png").string(),
                                        "--ball-radius",
                                        "0.05",
                                        "--ball-near",
                                        fmt::format("{}", middle.x + 2.0),
                                        fmt::format("{}", middle.y - 1.0),
                                        fmt::format("{}", 1.03 * radius)};
        all.insert(all.end(), more.begin(), more.end());
        return runProgram(all);
    };
    const ProgramRun found =
        run({"--board", "4", "3", "--board-marker", "0.05", "--board-gap", "0.012"});
    ASSERT_EQ(found.exit_code, 0) << found.messages;
    const Json json = Json::parse(found.output);
    for (int k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const double off = std::abs(json["center_m"][i].get<double>() - ball.center[k]);
        const double sigma = json["center_m_sigma"][i].get<double>();
        // EXIF's focal length is good to 1 % of 0.8 m.
        EXPECT_LT(off, 0.015) << k;
        EXPECT_LT(off, 3.0 * sigma) << k;
        EXPECT_NEAR(json["view"]["position_m"][i].get<double>(), close.position_m[k], 0.02) << k;
    }
}

TEST_F(CalibrateSample, TheOpticalAxisMayMissTheMiddle)
{
    const auto focalSigma = [&](const char* principal_sigma) {
        const ProgramRun run = runProgram({"calibrate",
                                           (kSample / "plate.jpg").string(),
                                           "--lines",
                                           (kSample / "lines.json").string(),
                                           "--principal-sigma",
                                           principal_sigma,
                                           "--force",
                                           "-o",
                                           camera().string()});
        EXPECT_EQ(run.exit_code, 0) << run.messages;
        return readJsonFile(camera())["focal_px_sigma"][0].get<double>();
    };
    const double fixed = focalSigma("0");
    const Json exact = readJsonFile(camera());
    EXPECT_EQ(exact["principal_point_px"], Json::array({640.0, 480.0}));
    EXPECT_LT(fixed, focalSigma("0.01"));
    EXPECT_LT(focalSigma("0.01"), focalSigma("0.05"));
    EXPECT_EQ(
        runProgram({"calibrate", "x.jpg", "--principal-sigma", "2", "-o", "y.json"}).exit_code, 2);
}

}  // namespace
}  // namespace insitu
