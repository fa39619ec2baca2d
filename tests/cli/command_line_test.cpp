#include "apps/cli/command.h"
#include "core/io/image_io.h"
#include "core/io/json.h"
#include "tests/cli/run_program.h"
#include "tests/support/file_bytes.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <set>

namespace insitu::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::vector<std::string> kCommands = {INSITU_COMMANDS};

void writeText(const std::filesystem::path& path, const std::string& text)
{
    std::ofstream(path) << text;
}

EncodedImage grey(int width, int height, std::uint16_t code)
{
    return {Image<glm::u16vec3>(width, height, glm::u16vec3(code)), 255};
}

TEST(CommandLine, HelpNamesEveryCommandAndIsNoFailure)
{
    const ProgramRun run = runProgram({"--help"});
    EXPECT_EQ(run.exit_code, kDone);
    EXPECT_EQ(run.messages, "");
    for (const std::string& command : kCommands)
        EXPECT_THAT(run.output, HasSubstr("\n  " + command)) << command;
}

TEST(CommandLine, EveryCommandHasHelpWithExamples)
{
    for (const std::string& command : kCommands) {
        const ProgramRun run = runProgram({command, "--help"});
        EXPECT_EQ(run.exit_code, kDone) << command;
        EXPECT_THAT(run.output, HasSubstr("insitu " + command + " ")) << command;
        EXPECT_THAT(run.output, HasSubstr("xample")) << command;
        EXPECT_THAT(run.output, HasSubstr("--strict")) << command;
    }
}

TEST(CommandLine, VersionNamesCompilerAndLibraries)
{
    const ProgramRun run = runProgram({"--version"});
    EXPECT_EQ(run.exit_code, kDone);
    EXPECT_THAT(run.output, testing::MatchesRegex("insitu [0-9]+\\.[0-9]+\\.[0-9]+\n(.|\n)*"));
    for (const char* name : {"OpenCV 4", "OpenEXR 3", "Ceres 2", "Embree 3", "GNU"})
        EXPECT_THAT(run.output, HasSubstr(name));
}

TEST(CommandLine, WrongUsageIsTwo)
{
    EXPECT_EQ(runProgram({}).exit_code, kWrongUsage);
    EXPECT_EQ(runProgram({"paint"}).exit_code, kWrongUsage);
    EXPECT_EQ(runProgram({"tonemap"}).exit_code, kWrongUsage);
    EXPECT_EQ(runProgram({"tonemap", "a.exr", "-o", "b.png", "--keys", "1"}).exit_code,
              kWrongUsage);
    EXPECT_EQ(runProgram({"tonemap", "a.exr", "-o", "b.png", "--key", "grey"}).exit_code,
              kWrongUsage);
    EXPECT_EQ(runProgram({"tonemap", "a.exr", "-o", "b.png", "--operator", "magic"}).exit_code,
              kWrongUsage);
    for (const std::string& command : kCommands) {
        const ProgramRun run = runProgram({command, "--no-such-flag"});
        EXPECT_EQ(run.exit_code, kWrongUsage) << command;
        EXPECT_THAT(run.messages, Not(testing::IsEmpty())) << command;
        EXPECT_EQ(run.output, "") << command;
    }
}

TEST(CommandLine, MissingFileIsOneAndNamed)
{
    const TemporaryFolder folder;
    const ProgramRun run =
        runProgram({"tonemap", (folder / "no.exr").string(), "-o", (folder / "out.png").string()});
    EXPECT_EQ(run.exit_code, kFailed);
    EXPECT_THAT(run.messages, HasSubstr("no.exr: no such file"));
    EXPECT_EQ(folder.size(), 0u);
}

TEST(CommandLine, FullDeviceIsAFailure)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "a.png", grey(4, 4, 100));
    const std::string picture = (folder / "a.png").string();
    const std::string command =
        "'" INSITU_PROGRAM "' compare '" + picture + "' '" + picture + "' >/dev/full 2>&1";
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), kFailed);
}

TEST(Tonemap, MakesAPictureAndOverwritesOnlyWhenForced)
{
    const TemporaryFolder folder;
    writeRadiance(folder / "in.exr", Image<Rgb>(6, 5, Rgb(3.0f)));
    const std::vector<std::string> arguments = {"tonemap",
                                                (folder / "in.exr").string(),
                                                "-o",
                                                (folder / "out.png").string(),
                                                "--white",
                                                "1e9"};
    EXPECT_EQ(runProgram(arguments).exit_code, kDone);
    // Key 0.18: 0.18 / 1.18 = 0.1525, sRGB code 109.
    EXPECT_EQ(readPhoto(folder / "out.png").image.codes(2, 2), glm::u16vec3(109));

    writeText(folder / "out.png", "mine");
    const ProgramRun refused = runProgram(arguments);
    EXPECT_EQ(refused.exit_code, kFailed);
    EXPECT_THAT(refused.messages, HasSubstr("--force"));
    EXPECT_EQ(fileBytes(folder / "out.png"), "mine");

    std::vector<std::string> forced = arguments;
    forced.push_back("--force");
    EXPECT_EQ(runProgram(forced).exit_code, kDone);
    EXPECT_EQ(readPhoto(folder / "out.png").image.codes(2, 2), glm::u16vec3(109));
    EXPECT_EQ(folder.size(), 2u);
}

// A run that fails late must leave neither a half picture nor a temporary file, and an older
// picture as it was.
TEST(Tonemap, FailedRunLeavesNothingBehind)
{
    const TemporaryFolder folder;
    writeRadiance(folder / "in.exr", Image<Rgb>(6, 5, Rgb(3.0f)));
    const std::string good = fileBytes(folder / "in.exr");
    writeText(folder / "broken.exr", good.substr(0, good.size() / 2));
    writeText(folder / "out.png", "mine");
    const ProgramRun run = runProgram({"tonemap",
                                       (folder / "broken.exr").string(),
                                       "-o",
                                       (folder / "out.png").string(),
                                       "--force"});
    EXPECT_EQ(run.exit_code, kFailed);
    EXPECT_THAT(run.messages, HasSubstr("broken.exr"));
    EXPECT_EQ(fileBytes(folder / "out.png"), "mine");

    const ProgramRun odd =
        runProgram({"tonemap", (folder / "in.exr").string(), "-o", (folder / "out.docx").string()});
    EXPECT_EQ(odd.exit_code, kFailed);
    EXPECT_THAT(odd.messages, HasSubstr("out.docx"));
    EXPECT_EQ(folder.size(), 3u);
}

TEST(Tonemap, ChoosesOperatorsAndRefusesForeignFlags)
{
    const TemporaryFolder folder;
    writeRadiance(folder / "in.exr", Image<Rgb>(6, 5, Rgb(3.0f)));
    const std::string input = (folder / "in.exr").string();
    const std::string output = (folder / "out.png").string();
    const auto run = [&](std::vector<std::string> flags) {
        std::vector<std::string> arguments = {"tonemap", input, "-o", output, "--force"};
        arguments.insert(arguments.end(), flags.begin(), flags.end());
        return runProgram(arguments);
    };
    // A scene without range becomes middle grey: 0.18 is sRGB code 118.
    EXPECT_EQ(run({"--operator", "ashikhmin"}).exit_code, kDone);
    EXPECT_EQ(readPhoto(output).image.codes(2, 2), glm::u16vec3(118));
    EXPECT_EQ(run({"--operator", "selective", "--contrast-threshold", "0.4"}).exit_code, kDone);

    EXPECT_EQ(run({"--operator", "histogram", "--no-veil", "--field-of-view-deg", "150"}).exit_code,
              kDone);
    EXPECT_EQ(
        run({"--operator", "histogram", "--scene-white-cd-m2", "9", "--display-black-cd-m2", "2"})
            .exit_code,
        kDone);
    EXPECT_EQ(run({"--operator", "histogram", "--same-curve"}).exit_code, kWrongUsage);
    EXPECT_EQ(run({"--operator", "ashikhmin", "--no-veil"}).exit_code, kWrongUsage);

    const ProgramRun foreign = run({"--operator", "ashikhmin", "--key", "0.2"});
    EXPECT_EQ(foreign.exit_code, kWrongUsage);
    EXPECT_THAT(foreign.messages, HasSubstr("--key"));

    writeEncoded(folder / "map.png", grey(5, 6, 255));
    const ProgramRun unfit =
        run({"--operator", "selective", "--always", (folder / "map.png").string()});
    EXPECT_EQ(unfit.exit_code, kFailed);
    EXPECT_THAT(unfit.messages, HasSubstr("5x6"));
}

TEST(Tonemap, HasTheOperatorsThatItNames)
{
    const TemporaryFolder folder;
    Image<Rgb> scene(24, 16);
    for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 24; ++x)
            scene(x, y) = Rgb(std::exp2(0.5f * static_cast<float>(x)));
    writeRadiance(folder / "in.exr", scene);
    const auto run = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments = {"tonemap",
                                              (folder / "in.exr").string(),
                                              "-o",
                                              (folder / "out.png").string(),
                                              "--force"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return runProgram(arguments);
    };
    std::set<std::string> pictures;
    const std::vector<std::string> operators = {"reinhard",
                                                "drago",
                                                "reinhard-devlin",
                                                "reinhard-local",
                                                "ashikhmin",
                                                "durand",
                                                "histogram"};
    for (const std::string& name : operators) {
        const ProgramRun mapped = run({"--operator", name, "-q"});
        EXPECT_EQ(mapped.exit_code, kDone) << mapped.messages;
        EXPECT_EQ(mapped.messages, "") << name;
        pictures.insert(fileBytes(folder / "out.png"));
    }
    EXPECT_EQ(pictures.size(), operators.size()) << "each its own picture";
    EXPECT_EQ(run({"--operator", "selective", "--select", "reinhard-local"}).exit_code, kDone);
    EXPECT_EQ(run({"--operator", "durand", "--base-contrast", "20"}).exit_code, kDone);
    // Flags of another operator, and one curve for operators that make their own.
    EXPECT_EQ(run({"--operator", "drago", "--base-contrast", "20"}).exit_code, kWrongUsage);
    const ProgramRun shared = run({"--operator", "durand", "--same-curve"});
    EXPECT_EQ(shared.exit_code, kWrongUsage);
    EXPECT_THAT(shared.messages, HasSubstr("durand"));
}

// The light goes up twentyfold from one frame to the next: the look follows later.
TEST(Tonemap, FramesOfAFilmFollowTheLightSlowly)
{
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder / "film");
    writeRadiance(folder / "a.exr", Image<Rgb>(16, 16, Rgb(1.0f)));
    writeRadiance(folder / "b.exr", Image<Rgb>(16, 16, Rgb(20.0f)));
    const auto secondFrame = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments = {"tonemap",
                                              (folder / "a.exr").string(),
                                              (folder / "b.exr").string(),
                                              "-o",
                                              (folder / "film").string(),
                                              "--force"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const ProgramRun run = runProgram(arguments);
        EXPECT_EQ(run.exit_code, kDone) << run.messages;
        return readPhoto(folder / "film" / "b.png").image.codes(3, 3).g;
    };
    const int by_itself = secondFrame({"--white", "1e6"});
    const int slowly = secondFrame({"--white", "1e6", "--frames-per-second", "25"});
    const int at_once =
        secondFrame({"--white", "1e6", "--frames-per-second", "25", "--adaptation-seconds", "0"});
    EXPECT_EQ(at_once, by_itself);
    EXPECT_GT(slowly, by_itself + 50);
    EXPECT_EQ(runProgram({"tonemap",
                          (folder / "a.exr").string(),
                          "-o",
                          (folder / "film").string(),
                          "--same-curve",
                          "--frames-per-second",
                          "25"})
                  .exit_code,
              kWrongUsage);
}

TEST(Compare, JudgesEncodedPicturesAsTheyAreSeen)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "a.png", grey(16, 16, 100));
    writeEncoded(folder / "b.png", grey(16, 16, 120));
    writeRadiance(folder / "a.exr", Image<Rgb>(16, 16, Rgb(1.0f)));
    const auto run = [&](const std::string& name, const std::string& other) {
        return runProgram({"compare",
                           (folder / name).string(),
                           (folder / other).string(),
                           "--vdp",
                           "--json",
                           (folder / "out.json").string(),
                           "--force"});
    };
    EXPECT_EQ(run("a.png", "b.png").exit_code, kDone);
    const auto json = nlohmann::json::parse(fileBytes(folder / "out.json"));
    // Plain pictures: (2ab + C1) / (a² + b² + C1) with a, b in codes, C1 = (0.01·255)².
    EXPECT_NEAR(json.at("ssim").get<double>(), 24006.5 / 24406.5, 1e-4);
    EXPECT_EQ(json.at("vdp_percent").get<double>(), 0.0);  // the mean level is not judged
    const ProgramRun radiance = run("a.exr", "a.exr");
    EXPECT_EQ(radiance.exit_code, kFailed);
    EXPECT_THAT(radiance.messages, HasSubstr("--vdp"));
}

TEST(Tonemap, ManyPicturesGoIntoAFolderUnderOneCurve)
{
    const TemporaryFolder folder;
    writeRadiance(folder / "a.exr", Image<Rgb>(6, 5, Rgb(1.0f)));
    writeRadiance(folder / "b.exr", Image<Rgb>(6, 5, Rgb(4.0f)));
    const std::vector<std::string> arguments = {"tonemap",
                                                (folder / "a.exr").string(),
                                                (folder / "b.exr").string(),
                                                "-o",
                                                (folder / "out").string(),
                                                "--white",
                                                "1e9",
                                                "--same-curve"};
    const ProgramRun missing = runProgram(arguments);
    EXPECT_EQ(missing.exit_code, kFailed);
    EXPECT_THAT(missing.messages, HasSubstr("folder"));

    std::filesystem::create_directory(folder / "out");
    EXPECT_EQ(runProgram(arguments).exit_code, kDone);
    // Their common log average is 2: L = 0.09 and 0.36, Ld = L / (1 + L), in sRGB.
    EXPECT_EQ(readPhoto(folder / "out" / "a.png").image.codes(0, 0), glm::u16vec3(81));
    EXPECT_EQ(readPhoto(folder / "out" / "b.png").image.codes(0, 0), glm::u16vec3(141));
}

TEST(Tonemap, RefusesAnEncodedPicture)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "in.png", grey(4, 4, 100));
    const ProgramRun run =
        runProgram({"tonemap", (folder / "in.png").string(), "-o", (folder / "out.png").string()});
    EXPECT_EQ(run.exit_code, kFailed);
    EXPECT_THAT(run.messages, HasSubstr("not a radiance image"));
}

// Radiance 1 and 4 shown as 1.5 and 3, in all channels: NRMSE sqrt((0.25 + 1) / 2) / 3, mean
// (50 + 25) / 2 %.
TEST(Compare, GivesTheNumbersAsTextAndJson)
{
    const TemporaryFolder folder;
    Image<Rgb> reference(2, 1, Rgb(1.0f));
    Image<Rgb> picture(2, 1, Rgb(1.5f));
    reference(1, 0) = Rgb(4.0f);
    picture(1, 0) = Rgb(3.0f);
    writeRadiance(folder / "a.exr", reference);
    writeRadiance(folder / "b.exr", picture);
    const ProgramRun run = runProgram({"compare",
                                       (folder / "a.exr").string(),
                                       (folder / "b.exr").string(),
                                       "--json",
                                       (folder / "errors.json").string()});
    EXPECT_EQ(run.exit_code, kDone);
    EXPECT_THAT(run.output, HasSubstr("mean %        37.5\n"));
    const Json json = readJson(folder / "errors.json");
    EXPECT_NEAR(json["nrmse"].get<double>(), std::sqrt(0.625) / 3.0, tolerance::kDouble);
    EXPECT_NEAR(json["mean_percent"].get<double>(), 37.5, 37.5 * tolerance::kFloat);
    EXPECT_EQ(json["pixels"].get<int>(), 2);
    EXPECT_FALSE(json.contains("differing_pixels"));
}

TEST(Compare, CountsCodesOfEncodedPicturesInsideTheMask)
{
    const TemporaryFolder folder;
    EncodedImage picture = grey(4, 1, 100);
    picture.codes(0, 0).r = 90;
    picture.codes(3, 0).g = 103;
    EncodedImage mask = grey(4, 1, 0);
    mask.codes(2, 0) = mask.codes(3, 0) = glm::u16vec3(255);
    writeEncoded(folder / "a.png", grey(4, 1, 100));
    writeEncoded(folder / "b.png", picture);
    writeEncoded(folder / "mask.png", mask);
    const std::vector<std::string> arguments = {
        "compare", (folder / "a.png").string(), (folder / "b.png").string()};
    EXPECT_THAT(runProgram(arguments).output, HasSubstr("2 pixels, at most by 10 codes"));
    std::vector<std::string> masked = arguments;
    masked.insert(masked.end(), {"--mask", (folder / "mask.png").string()});
    EXPECT_THAT(runProgram(masked).output, HasSubstr("1 pixels, at most by 3 codes"));
}

TEST(Compare, BlackMaskAdmitsNoAnswer)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "a.png", grey(3, 3, 100));
    writeEncoded(folder / "black.png", grey(3, 3, 0));
    const std::string picture = (folder / "a.png").string();
    const ProgramRun run =
        runProgram({"compare", picture, picture, "--mask", (folder / "black.png").string()});
    EXPECT_EQ(run.exit_code, kNoAnswer);
    EXPECT_THAT(run.messages, HasSubstr("black.png"));
}

TEST(Compare, RefusesSizesAndKindsThatDiffer)
{
    const TemporaryFolder folder;
    writeEncoded(folder / "a.png", grey(3, 3, 100));
    writeEncoded(folder / "wide.png", grey(4, 3, 100));
    writeRadiance(folder / "a.exr", Image<Rgb>(3, 3, Rgb(1.0f)));
    const std::string picture = (folder / "a.png").string();
    const ProgramRun sizes = runProgram({"compare", picture, (folder / "wide.png").string()});
    EXPECT_EQ(sizes.exit_code, kFailed);
    EXPECT_THAT(sizes.messages, HasSubstr("4x3"));
    const ProgramRun kinds = runProgram({"compare", picture, (folder / "a.exr").string()});
    EXPECT_EQ(kinds.exit_code, kFailed);
    EXPECT_THAT(kinds.messages, HasSubstr("no common unit"));
    const ProgramRun mask =
        runProgram({"compare", picture, picture, "--mask", (folder / "wide.png").string()});
    EXPECT_EQ(mask.exit_code, kFailed);
}

}  // namespace
}  // namespace insitu::cli
