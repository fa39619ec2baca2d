#include "core/io/exif.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/capture/synthetic_ball.h"
#include "tests/capture/synthetic_bracket.h"
#include "tests/cli/run_program.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <fstream>
#include <map>

namespace insitu {
namespace {

using testing::HasSubstr;

/// A bracket of tiles on disk, as PNG (no EXIF) or JPEG (with exposure times).
class MergeAndProbe : public testing::Test {
protected:
    void SetUp() override
    {
        SyntheticCamera camera;
        camera.curve = [](int, double e) { return std::pow(e, 0.45); };
        scene_ = tiles(160, 160, 8, 0.01, 20.0);
        const Bracket bracket = photograph(scene_, seconds_, camera);
        for (const BracketFrame& frame : bracket.frames) {
            PhotoMetadata metadata;
            metadata.exposure.seconds = frame.relative_exposure;
            const auto name = folder_ / (frame.name + ".jpg");
            writeEncoded(name, frame.image, makeExif(metadata));
            writeEncoded(folder_ / (frame.name + ".png"), frame.image);
        }
    }

    std::vector<std::string> command(const std::string& name,
                                     const std::string& extension,
                                     std::vector<std::string> more) const
    {
        std::vector<std::string> arguments = {name};
        for (std::size_t k = 0; k < seconds_.size(); ++k)
            arguments.push_back((folder_ / fmt::format("frame_{}{}", k, extension)).string());
        arguments.insert(arguments.end(), more.begin(), more.end());
        return arguments;
    }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }

    TemporaryFolder folder_;
    Image<Rgb> scene_;
    std::vector<double> seconds_ = {1.0, 0.5, 0.25, 0.125, 1.0 / 16};
};

TEST_F(MergeAndProbe, MergeRecoversTheSceneUpToOneScaleAChannel)
{
    const ProgramRun run = runProgram(
        command("merge", ".jpg", {"-o", file("room.exr"), "--save-response", file("r.json")}));
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    const Image<Rgb> radiance = readRadiance(file("room.exr")).pixels;
    const auto ratio = [&](int x, int y) { return radiance(x, y).g / scene_(x, y).g; };
    // Middles of tiles of middle brightness.
    EXPECT_NEAR(ratio(20, 60) / ratio(20, 140), 1.0, 0.03);  // rounding and JPEG, 3 %
    EXPECT_NEAR(ratio(20, 100) / ratio(20, 140), 1.0, 0.03);

    const ProgramRun again = runProgram(
        command("merge", ".jpg", {"-o", file("again.exr"), "--response", file("r.json")}));
    ASSERT_EQ(again.exit_code, 0) << again.messages;
    const Image<Rgb> same = readRadiance(file("again.exr")).pixels;
    EXPECT_NEAR(same(20, 100).g / radiance(20, 100).g, 1.0, 1e-5);
}

TEST_F(MergeAndProbe, AnExrHoldsVarianceAndValidityTheOthersDoNot)
{
    const std::string name = file("layers.EXR");
    const ProgramRun run = runProgram(command("merge", ".jpg", {"-o", name}));
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    std::map<std::string, Image<float>> layers;
    for (ExrChannel& channel : readLayeredExr(name))
        layers.emplace(channel.name, std::move(channel.values));
    ASSERT_EQ(layers.size(), 7u);
    const auto at = [&](const char* layer, int x, int y) { return layers.at(layer)(x, y); };
    EXPECT_EQ(readRadiance(name).pixels(20, 100).g, at("G", 20, 100));
    const float deviation = std::sqrt(at("variance.G", 20, 100)) / at("G", 20, 100);
    EXPECT_GT(deviation, 1e-4f);  // rounding to 8 bits in five frames leaves 0.1 to 3 %
    EXPECT_LT(deviation, 0.03f);
    EXPECT_EQ(at("validity", 20, 100), 0.0f);
    EXPECT_EQ(at("validity", 155, 155), 1.0f);  // 20 / 16 of full scale in the shortest

    EXPECT_EQ(runProgram(command("merge", ".jpg", {"-o", file("plain.pfm")})).exit_code, 0);
    EXPECT_EQ(readRadiance(file("plain.pfm")).pixels(20, 100).g, at("G", 20, 100));
}

TEST_F(MergeAndProbe, ExposuresAreAskedForAndTaken)
{
    const ProgramRun without = runProgram(command("merge", ".png", {"-o", file("room.exr")}));
    EXPECT_EQ(without.exit_code, 1);
    EXPECT_THAT(without.messages, HasSubstr("frame_0.png: no exposure time in EXIF"));
    const ProgramRun with = runProgram(
        command("merge", ".png", {"-o", file("room.exr"), "--exposures", "1,1/2,0.25,1/8,1/16"}));
    EXPECT_EQ(with.exit_code, 0) << with.messages;
    for (const char* bad : {"1,1/2", "1,1/0,1,1,1", "1,-2,1,1,1", "1,x,1,1,1"}) {
        const ProgramRun run =
            runProgram(command("merge", ".png", {"-o", file("bad.exr"), "--exposures", bad}));
        EXPECT_EQ(run.exit_code, 1) << bad;
        EXPECT_THAT(run.messages, HasSubstr("--exposures")) << bad;
    }
}

TEST_F(MergeAndProbe, OneExposureIsAWarningAndStrictSaysSo)
{
    const std::vector<std::string> arguments = {
        "merge", file("frame_1.jpg"), "-o", file("one.exr"), "--strict"};
    const ProgramRun run = runProgram(arguments);
    EXPECT_EQ(run.exit_code, 4);
    EXPECT_THAT(run.messages, HasSubstr("bracket-single-exposure"));
    EXPECT_THAT(run.messages, HasSubstr("response-not-recoverable"));
}

TEST_F(MergeAndProbe, RefusesToOverwriteAndToWriteAPhotograph)
{
    writeRadiance(file("there.exr"), scene_);
    EXPECT_EQ(runProgram(command("merge", ".jpg", {"-o", file("there.exr")})).exit_code, 1);
    EXPECT_EQ(runProgram(command("merge", ".jpg", {"-o", file("there.exr"), "--force"})).exit_code,
              0);
    EXPECT_EQ(runProgram(command("merge", ".jpg", {"-o", file("room.png")})).exit_code, 1);
}

TEST_F(MergeAndProbe, ProbeMakesAnEnvironmentOfEachKind)
{
    writeRadiance(file("ball.exr"), Image<Rgb>(160, 160, Rgb(2.0f)));
    const ProgramRun ball = runProgram({"probe",
                                        file("ball.exr"),
                                        "-o",
                                        file("env.exr"),
                                        "--center",
                                        "80,80",
                                        "--radius",
                                        "70",
                                        "--reflectance",
                                        "0.5",
                                        "--view-position",
                                        "0.5,1,2",
                                        "--width",
                                        "128"});
    ASSERT_EQ(ball.exit_code, 0) << ball.messages;
    EXPECT_THAT(ball.messages, HasSubstr("probe-blind-spot"));
    const Image<Rgb> environment = readRadiance(file("env.exr")).pixels;
    EXPECT_EQ(environment.width(), 128);
    EXPECT_EQ(environment.height(), 64);
    EXPECT_NEAR(environment(64, 32).r, 4.0f, 1e-5f);

    EXPECT_EQ(
        runProgram({"probe", file("ball.exr"), "-o", file("a.exr"), "--kind", "angular"}).exit_code,
        0);
    writeRadiance(file("map.exr"), Image<Rgb>(64, 32, Rgb(1.0f)));
    EXPECT_EQ(
        runProgram({"probe", file("map.exr"), "-o", file("l.exr"), "--kind", "latlong"}).exit_code,
        0);
    EXPECT_EQ(
        runProgram({"probe", file("ball.exr"), "-o", file("w.exr"), "--kind", "latlong"}).exit_code,
        1);
}

TEST_F(MergeAndProbe, MergeReportsExposuresAndDrawsTheResponse)
{
    const ProgramRun run = runProgram(
        command("merge",
                ".jpg",
                {"-o", file("r.exr"), "--report", file("r.json"), "--plot", file("r.svg")}));
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    std::ifstream report_file(file("r.json"));
    const auto report = nlohmann::json::parse(report_file);
    EXPECT_EQ(report["format"], "insitu-capture-report");
    ASSERT_GT(report["exposures"].size(), 1u);
    double longer = 1e30;
    for (const auto& frame : report["exposures"]) {
        const double used = frame["used_exposure"];
        EXPECT_LT(used, longer);
        EXPECT_NEAR(used / frame["nominal_exposure"].get<double>(), 1.0, 0.2);
        EXPECT_NEAR(used / frame["measured_exposure"].get<double>(), 1.0, 0.05);
        longer = used;
    }
    EXPECT_EQ(report["response"]["exposure"].size(), 3u);
    EXPECT_EQ(report["noise"].size(), 3u);
    std::ifstream plot(file("r.svg"));
    const std::string svg((std::istreambuf_iterator<char>(plot)), {});
    EXPECT_THAT(svg, HasSubstr("<svg"));
    EXPECT_THAT(svg, HasSubstr("frame_3.jpg"));
    for (const char* panel : {"Response", "Weight of each", "Standard deviation", "Clipped"})
        EXPECT_THAT(svg, HasSubstr(panel));
    ASSERT_EQ(report["weights"].size(), 3u);
    EXPECT_EQ(report["weights"][0]["weight"].size(), report["exposures"].size());
    EXPECT_GT(report["deviations"].size(), 5u);
    EXPECT_THAT(svg, ::testing::EndsWith("</svg>\n"));
}

TEST_F(MergeAndProbe, ProbeReadsCubeCrosses)
{
    writeRadiance(file("cross.exr"), Image<Rgb>(64, 48, Rgb(2.0f)));
    const ProgramRun run =
        runProgram({"probe", file("cross.exr"), "-o", file("c.exr"), "--kind", "cube-cross"});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_NEAR(readRadiance(file("c.exr")).pixels(5, 5).g, 2.0f, 1e-5f);
    writeRadiance(file("square.exr"), Image<Rgb>(64, 64, Rgb(2.0f)));
    EXPECT_EQ(runProgram({"probe", file("square.exr"), "-o", file("s.exr"), "--kind", "cube-cross"})
                  .exit_code,
              1);
}

TEST_F(MergeAndProbe, ProbeFindsTheBall)
{
    const std::filesystem::path sample =
        std::filesystem::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";
    const ProgramRun run = runProgram({"probe",
                                       (sample / "ball_1_8.jpg").string(),
                                       (sample / "ball_1_32.jpg").string(),
                                       (sample / "ball_1_128.jpg").string(),
                                       "-o",
                                       file("env.exr"),
                                       "--width",
                                       "64"});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("probe-outline-found"));
}

TEST_F(MergeAndProbe, ProbeMergesABracketAndSaysWhatItAssumed)
{
    const ProgramRun run = runProgram(command("probe", ".jpg", {"-o", file("env.exr")}));
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("probe-outline-assumed"));
    EXPECT_THAT(run.messages, HasSubstr("probe-view-assumed"));
}

// --- several views, masks, rolled cameras

/// A far room by direction: walls that get lighter upwards, a lamp.
Rgb farRoom(glm::dvec3 /*origin*/, glm::dvec3 d)
{
    if (glm::dot(d, glm::normalize(glm::dvec3(0.4, 0.8, -0.3))) > 0.97) return Rgb(20.0f);
    return Rgb(glm::dvec3(0.6 + 0.3 * d.x, 0.7 + 0.4 * d.y, 0.5 - 0.3 * d.z));
}

/// Two pictures of one ball with a black photographer in each, masks of them, and the file that
/// describes them. The second camera is rolled.
class TwoViews : public testing::Test {
protected:
    static constexpr int kSide = 220;
    static constexpr double kPerson = 0.25;  // radians

    void SetUp() override
    {
        ball_.center_m = {0.1, 0.9, -0.2};
        ball_.radius_m = 0.06;
        ball_.radius_px = 100.0;
        ball_.center_px = glm::dvec2(0.5 * kSide);
        writeView("front", {-0.2, 1.1, 1.0}, {0.0, 1.0, 0.0});
        writeView("side", {-1.3, 1.1, -0.5}, {0.2, 1.0, 0.4});
        nlohmann::ordered_json probe = {{"kind", "mirror-ball"},
                                        {"center_m", {0.1, 0.9, -0.2}},
                                        {"views", {view("front", {-0.2, 1.1, 1.0})}}};
        probe["views"].push_back(view("side", {-1.3, 1.1, -0.5}));
        probe["views"][1]["view"]["up"] = {0.2, 1.0, 0.4};
        std::ofstream(folder_ / "probe.json") << probe.dump();
    }
    void writeView(const std::string& name, glm::dvec3 position, glm::dvec3 up) const
    {
        const Camera camera = ballCamera(ball_, position, kSide, kSide, up);
        const glm::dvec3 person = glm::normalize(position - ball_.center_m);
        writeRadiance(
            file(name + ".exr"), renderBall(ball_, camera, [&](glm::dvec3 o, glm::dvec3 d) {
                return glm::dot(d, person) > std::cos(kPerson) ? Rgb(0.0f) : farRoom(o, d);
            }));
        EncodedImage mask;
        mask.codes = Image<glm::u16vec3>(kSide, kSide);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                if (glm::length(glm::dvec2(x + 0.5, y + 0.5) - ball_.center_px) <
                    (std::sin(0.5 * kPerson) + 0.03) * ball_.radius_px)
                    mask.codes(x, y) = glm::u16vec3(255);
        writeEncoded(file(name + "_mask.png"), mask);
    }
    [[nodiscard]] static nlohmann::ordered_json view(const std::string& name,
                                                     std::array<double, 3> position)
    {
        return {
            {"images", nlohmann::ordered_json::array({name + ".exr"})},
            {"mask", name + "_mask.png"},
            {"ball",
             {{"center_px", {0.5 * kSide, 0.5 * kSide}}, {"radius_px", 100.0}, {"radius_m", 0.06}}},
            {"view", {{"position_m", position}}}};
    }
    [[nodiscard]] std::string file(const std::string& name) const
    {
        return (folder_ / name).string();
    }

    TemporaryFolder folder_;
    MirrorBall ball_;
};

TEST_F(TwoViews, ShowTheRoomWithoutThePhotographer)
{
    const ProgramRun run =
        runProgram({"probe", file("probe.json"), "-o", file("env.exr"), "--width", "256"});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, testing::Not(HasSubstr("probe-views-disagree")));
    EXPECT_THAT(run.messages, testing::Not(HasSubstr("probe-inpainted")));
    const EnvironmentMap found{readRadiance(file("env.exr")).pixels};
    const EnvironmentMap truth = panorama(farRoom, ball_.center_m, 256);
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {1.0, -1.0}) {
            glm::dvec3 normal(0.0);
            normal[axis] = sign;
            const glm::dvec3 ratio = irradiance(found, normal) / irradiance(truth, normal);
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(ratio[c], 1.0, 0.01);  // the aim of the stage
        }
    }
}

TEST_F(TwoViews, OneMaskedOnTheCommandLineIsPaintedIn)
{
    const std::vector<std::string> command = {"probe",
                                              file("side.exr"),
                                              "-o",
                                              file("one.exr"),
                                              "--center",
                                              "110,110",
                                              "--radius",
                                              "100",
                                              "--radius-m",
                                              "0.06",
                                              "--position",
                                              "0.1,0.9,-0.2",
                                              "--view-position",
                                              "-1.3,1.1,-0.5",
                                              "--up",
                                              "0.2,1,0.4",
                                              "--mask"};
    std::vector<std::string> good = command;
    good.push_back(file("side_mask.png"));
    const ProgramRun run = runProgram(good);
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("probe-inpainted"));
    const EnvironmentMap found{readRadiance(file("one.exr")).pixels};
    const glm::dvec3 person = glm::normalize(glm::dvec3(-1.3, 1.1, -0.5) - ball_.center_m);
    EXPECT_NEAR(lookUp(found, person).r, farRoom({}, person).r, 0.05);  // black without the mask
    const glm::dvec3 above(0.0, 1.0, 0.0);  // where the rolled camera's up matters
    EXPECT_NEAR(lookUp(found, above).g, farRoom({}, above).g, 0.01);

    EncodedImage small;
    small.codes = Image<glm::u16vec3>(20, 10);
    writeEncoded(file("small.png"), small);
    std::vector<std::string> bad = command;
    bad.push_back(file("small.png"));
    bad.emplace_back("--force");
    const ProgramRun refused = runProgram(bad);
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.messages, HasSubstr("as large as"));
}

}  // namespace
}  // namespace insitu
