#include "tests/cli/json_file.h"
#include "tests/cli/run_program.h"
#include "tests/support/file_bytes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;

const fs::path kSample = fs::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";

/// The shipped sample, with its paths made absolute and one thing changed.
class InsertProject : public ::testing::Test {
protected:
    void SetUp() override
    {
        project_ = readJsonFile(kSample / "project.json");
        const auto absolute = [](Json& name) {
            name = (kSample / name.get<std::string>()).string();
        };
        absolute(project_["photo"]["image"]);
        absolute(project_["camera"]["lines"]);
        for (Json& image : project_["light"]["probe"]["images"])
            absolute(image);
        for (Json& object : project_["objects"])
            absolute(object["model"]);
    }

    ProgramRun insert(const std::vector<std::string>& more = {})
    {
        const fs::path file = folder_.add("project.json", project_.dump(1));
        std::vector<std::string> arguments = {
            "insert", file.string(), "-o", picture().string(), "--samples", "1", "--seed", "7"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return runProgram(arguments);
    }
    [[nodiscard]] fs::path picture() const { return folder_ / "final.png"; }
    /// No picture, and no temporary one either.
    [[nodiscard]] bool leftNothing() const
    {
        for (const auto& entry : fs::directory_iterator(folder_.path()))
            if (entry.path().extension() == ".png") return false;
        return true;
    }

    TemporaryFolder folder_;
    Json project_;
};

TEST_F(InsertProject, WritesPictureReportLayersAndRefusesToOverwrite)
{
    const fs::path report = folder_ / "report.json";
    const fs::path layers = folder_ / "layers.exr";
    const fs::path mapped = folder_ / "mapped.jpg";
    const ProgramRun run = insert({"--report",
                                   report.string(),
                                   "--layers",
                                   layers.string(),
                                   "--tonemapped",
                                   mapped.string(),
                                   "--operator",
                                   "selective",
                                   "--strict"});
    // Whatever is told of the sample, none of it is a warning.
    EXPECT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_TRUE(fs::exists(picture()));
    EXPECT_GT(fs::file_size(layers), 1000u);
    EXPECT_GT(fs::file_size(mapped), 1000u);
    const Json told = readJsonFile(report);
    EXPECT_EQ(told["format"], "insitu-report");
    EXPECT_GT(told["composite"]["influence_fraction"].get<double>(), 0.0);

    const ProgramRun again = insert();
    EXPECT_EQ(again.exit_code, 1);
    EXPECT_THAT(again.messages, HasSubstr("--force"));
}

// Told before the work: no picture is there yet.
TEST_F(InsertProject, RefusesToneMappingFlagsThatDoNotFit)
{
    const ProgramRun run = insert({"--tonemapped",
                                   (folder_ / "mapped.jpg").string(),
                                   "--operator",
                                   "ashikhmin",
                                   "--key",
                                   "1"});
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_THAT(run.messages, HasSubstr("--key"));
    EXPECT_TRUE(leftNothing());
}

TEST_F(InsertProject, ASecondRunFindsTheStagesOfTheFirst)
{
    const fs::path report = folder_ / "report.json";
    const std::vector<std::string> more = {
        "--cache", (folder_ / "cache").string(), "--report", report.string(), "--force"};
    ASSERT_EQ(insert(more).exit_code, 0);
    EXPECT_EQ(readJsonFile(report)["from_cache"], Json::array());
    const fs::path first = folder_ / "first.png";
    fs::rename(picture(), first);

    ASSERT_EQ(insert(more).exit_code, 0);
    EXPECT_EQ(readJsonFile(report)["from_cache"], Json({"probe", "render"}));
    EXPECT_EQ(fileBytes(picture()), fileBytes(first));

    // Another place for the object: the light is the same, the picture is not.
    project_["objects"][0]["rotation_y_deg"] = 12.0;
    ASSERT_EQ(insert(more).exit_code, 0);
    EXPECT_EQ(readJsonFile(report)["from_cache"], Json({"probe"}));
    EXPECT_NE(fileBytes(picture()), fileBytes(first));
    const std::string turned = fileBytes(picture());

    // What the photograph's camera does to the objects can be left out; it is no part of the
    // render.
    std::vector<std::string> plain = more;
    plain.insert(plain.end(), {"--no-match", "grain,blur", "--composite", "mixed"});
    ASSERT_EQ(insert(plain).exit_code, 0);
    const Json told = readJsonFile(report);
    EXPECT_EQ(told["from_cache"], Json({"probe", "render"}));
    EXPECT_EQ(told["camera_match"]["grain_codes_at_middle_grey"], Json({0.0, 0.0, 0.0}));
    EXPECT_EQ(told["camera_match"]["blur_px"], 0.0);
    EXPECT_EQ(told["composite"]["form"], "mixed");
    EXPECT_NE(fileBytes(picture()), turned);
}

TEST_F(InsertProject, ABadProjectEndsWithItsPlaceCauseAndExitCode)
{
    const struct {
        const char* what;
        std::function<void(Json&)> change;
        int exit_code;
        const char* message;
    } cases[] = {
        {"misspelt key",
         [](Json& p) {
             p["objects"][0]["positon_m"] = {0, 0, 0};
         },
         1,
         "position_m"},
        {"wrong type", [](Json& p) { p["objects"][0]["scale"] = "big"; }, 1, "objects[0].scale"},
        {"missing photograph",
         [](Json& p) { p["photo"]["image"] = "nowhere.jpg"; },
         1,
         "nowhere.jpg"},
        {"focus behind the camera",
         [](Json& p) { p["photo"]["focus_m"] = -2.0; },
         1,
         "photo.focus_m"},
        {"vignetting beyond a lens",
         [](Json& p) { p["photo"]["vignetting"] = 5.0; },
         1,
         "photo.vignetting"},
        {"vignetting in words", [](Json& p) { p["photo"]["vignetting"] = "some"; }, 1, "auto"},
        {"missing model",
         [](Json& p) { p["objects"][0]["model"] = "nowhere.obj"; },
         1,
         "nowhere.obj"},
        {"object outside",
         [](Json& p) {
             p["objects"][0]["position_m"] = {50, 0, 0};
         },
         1,
         "position_m"},
        {"brackets of unequal size",
         [](Json& p) { p["light"]["probe"]["images"].push_back(p["photo"]["image"]); },
         1,
         "plate.jpg"},
    };
    const Json good = project_;
    for (const auto& c : cases) {
        project_ = good;
        c.change(project_);
        const ProgramRun run = insert();
        EXPECT_EQ(run.exit_code, c.exit_code) << c.what << ": " << run.messages;
        EXPECT_THAT(run.messages, HasSubstr(c.message)) << c.what;
        EXPECT_TRUE(leftNothing()) << c.what;
    }
}

TEST_F(InsertProject, MissingProjectFile)
{
    const ProgramRun run =
        runProgram({"insert", (folder_ / "none.json").string(), "-o", picture().string()});
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.messages, HasSubstr("none.json"));
}

TEST_F(InsertProject, ASingleAxisIsNoAnswer)
{
    Json lines = readJsonFile(kSample / "lines.json");
    Json kept = Json::array();
    for (const Json& segment : lines["segments"])
        if (segment["axis"] == "x") kept.push_back(segment);
    lines["segments"] = kept;
    project_["camera"]["lines"] = folder_.add("lines.json", lines.dump()).string();
    const ProgramRun run = insert();
    EXPECT_EQ(run.exit_code, 3) << run.messages;
    EXPECT_TRUE(leftNothing());
}

TEST_F(InsertProject, AModelWithoutTrianglesOrWithAnUnknownExtension)
{
    project_["objects"][0]["model"] = folder_.add("empty.obj", "v 0 0 0\nv 1 0 0\n").string();
    const ProgramRun empty = insert();
    EXPECT_EQ(empty.exit_code, 1);
    EXPECT_THAT(empty.messages, HasSubstr("empty.obj"));
    project_["objects"][0]["model"] =
        folder_
            .add("odd.gltf",
                 R"({"asset": {"version": "2.0"}, "extensionsUsed": ["ACME_odd"],)"
                 R"( "extensionsRequired": ["ACME_odd"]})")
            .string();
    const ProgramRun odd = insert();
    EXPECT_EQ(odd.exit_code, 1);
    EXPECT_THAT(odd.messages, HasSubstr("ACME_odd"));
}

TEST_F(InsertProject, OneExposureIsToldAndTheTechniqueTaken)
{
    Json& images = project_["light"]["probe"]["images"];
    images = Json::array({images[2]});
    // And which technique was asked for, and which made the picture: 1 is a bound that fiv keeps.
    const fs::path report = folder_ / "report.json";
    const ProgramRun run = insert(
        {"--strict", "--technique", "auto", "--max-error", "1", "--report", report.string()});
    EXPECT_EQ(run.exit_code, 4) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("bracket-single-exposure"));
    EXPECT_THAT(run.messages, HasSubstr("photo-response-assumed-srgb"));
    const Json render = readJsonFile(report)["render"];
    EXPECT_EQ(render["technique_asked"], "auto");
    EXPECT_EQ(render["technique"], "fiv");
    EXPECT_GT(render["fiv_error"]["pixels"].get<int>(), 0);
    EXPECT_TRUE(render["interreflection"].get<bool>());
    EXPECT_TRUE(render["no_interreflection_error"].is_null());
}

TEST_F(InsertProject, WhatNoInterreflectionCostsIsTold)
{
    const fs::path report = folder_ / "report.json";
    const ProgramRun run =
        insert({"--technique", "fiv", "--no-interreflection", "--report", report.string()});
    EXPECT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_THAT(run.messages, HasSubstr("no-interreflection"));
    const Json render = readJsonFile(report)["render"];
    EXPECT_FALSE(render["interreflection"].get<bool>());
    EXPECT_GT(render["no_interreflection_error"]["rms"].get<double>(), 0.0);
}

TEST_F(InsertProject, WrongUsage)
{
    EXPECT_EQ(runProgram({"insert"}).exit_code, 2);
    EXPECT_EQ(insert({"--technique", "magic"}).exit_code, 2);
    EXPECT_EQ(insert({"--no-match", "colour"}).exit_code, 2);
    EXPECT_EQ(insert({"--composite", "sum"}).exit_code, 2);
    EXPECT_EQ(runProgram({"insert", "--help"}).exit_code, 0);
}

}  // namespace
}  // namespace insitu
