#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/capture/commands_bracket.h"
#include "tests/capture/synthetic_ball.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <fstream>

namespace insitu {
namespace {

using testing::HasSubstr;

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

/// A part of a picture, as one cuts it out by hand.
EncodedImage cutOut(const EncodedImage& image, glm::ivec2 from, glm::ivec2 size)
{
    EncodedImage part{Image<glm::u16vec3>(size.x, size.y), image.max_code};
    for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x)
            part.codes(x, y) = image.codes(from.x + x, from.y + y);
    return part;
}

// Four pictures of a ball, each cut out a little differently, show the same light as whole ones.
TEST_F(MergeAndProbe, ProbeLaysHandCutPicturesOfABallOntoEachOther)
{
    const std::filesystem::path sample =
        std::filesystem::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";
    const std::array<int, 4> parts = {8, 32, 128, 512};
    const std::array<glm::ivec2, 4> from = {
        glm::ivec2{24, 21}, glm::ivec2{19, 26}, glm::ivec2{27, 24}, glm::ivec2{22, 18}};
    const std::array<glm::ivec2, 4> sizes = {
        glm::ivec2{552, 556}, glm::ivec2{557, 551}, glm::ivec2{550, 553}, glm::ivec2{555, 560}};
    nlohmann::ordered_json probe = {{"kind", "mirror-ball"},
                                    {"center_m", {0, 0.45, 0}},
                                    {"ball", {{"radius_m", 0.06}}},
                                    {"view", {{"position_m", {0.5, 0.65, 1.1}}}}};
    // Cut-outs have no EXIF.
    probe["f_number"] = 8.0;
    probe["iso"] = 100.0;
    nlohmann::ordered_json whole = probe;
    for (std::size_t k = 0; k < parts.size(); ++k) {
        const auto path = sample / fmt::format("ball_1_{}.jpg", parts[k]);
        const std::string name = fmt::format("cut_{}.png", k);
        writeEncoded(file(name), cutOut(readPhoto(path).image, from[k], sizes[k]));
        for (nlohmann::ordered_json* json : {&probe, &whole})
            (*json)["exposure_seconds"].push_back(1.0 / parts[k]);
        probe["images"].push_back(name);
        whole["images"].push_back(path.string());
    }
    const auto run = [&](const nlohmann::ordered_json& json, const std::string& name) {
        std::ofstream(file(name + ".json")) << json.dump();
        return runProgram(
            {"probe", file(name + ".json"), "-o", file(name + ".exr"), "--width", "128"});
    };
    ASSERT_EQ(run(whole, "whole").exit_code, 0);
    const ProgramRun cut = run(probe, "cut");
    ASSERT_EQ(cut.exit_code, 0) << cut.messages;
    for (const char* finding : {"bracket-hand-cut", "bracket-aligned", "probe-outline-found"})
        EXPECT_THAT(cut.messages, HasSubstr(finding));
    const Image<Rgb> truth = readRadiance(file("whole.exr")).pixels;
    const Image<Rgb> found = readRadiance(file("cut.exr")).pixels;
    double sum = 0.0;
    double off = 0.0;
    for (int y = 0; y < truth.height(); ++y)
        for (int x = 0; x < truth.width(); ++x) {
            const double weight = environmentTexelSolidAngle(truth.width(), truth.height(), y);
            sum += weight * static_cast<double>(truth(x, y).g);
            off += weight * static_cast<double>(std::abs(found(x, y).g - truth(x, y).g));
        }
    EXPECT_LT(off / sum, 0.02);  // frames one pixel off each other give 0.05

    // Where the outline is given, nobody knows in which of the pictures.
    probe["ball"]["center_px"] = {276, 278};
    probe["ball"]["radius_px"] = 261;
    const ProgramRun refused = run(probe, "given");
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.messages, HasSubstr("same size"));
    // A picture without a ball.
    probe["ball"] = {{"radius_m", 0.06}};
    probe["images"] = {file("frame_0.png"), file("frame_2.png")};
    probe["exposure_seconds"] = {1.0, 0.25};
    const ProgramRun none = run(probe, "none");
    EXPECT_EQ(none.exit_code, 3);
    EXPECT_THAT(none.messages, HasSubstr("was not found"));
}

TEST_F(MergeAndProbe, ProbeMergesABracketAndSaysWhatItAssumed)
{
    const ProgramRun run = runProgram(command("probe", ".jpg", {"-o", file("env.exr")}));
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("probe-outline-assumed"));
    EXPECT_THAT(run.messages, HasSubstr("probe-view-assumed"));
}

// --- several views, masks, rolled cameras

}  // namespace
}  // namespace insitu
