#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/capture/commands_bracket.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <map>

namespace insitu {
namespace {

using testing::HasSubstr;

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

}  // namespace
}  // namespace insitu
