#include "tests/cli/json_file.h"
#include "tests/cli/run_program.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace insitu {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using testing::HasSubstr;

const fs::path kSample = fs::path(INSITU_SOURCE_DIR) / "samples" / "simulated-room";

/// The shipped sample: its camera as solved from its lines, its scene.
class ReconstructSample : public testing::Test {
protected:
    void SetUp() override
    {
        const ProgramRun run = runProgram({"calibrate",
                                           (kSample / "plate.jpg").string(),
                                           "--lines",
                                           (kSample / "lines.json").string(),
                                           "-o",
                                           (folder_ / "camera.json").string()});
        ASSERT_EQ(run.exit_code, 0) << run.messages;
    }
    [[nodiscard]] ProgramRun reconstruct(const fs::path& scene,
                                         std::vector<std::string> more = {}) const
    {
        std::vector<std::string> arguments = {"reconstruct",
                                              scene.string(),
                                              "--camera",
                                              (folder_ / "camera.json").string(),
                                              "-o",
                                              (folder_ / "room.json").string()};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return runProgram(arguments);
    }

    TemporaryFolder folder_;
};

TEST_F(ReconstructSample, FindsTheFurnitureWhereItStands)
{
    const ProgramRun run = reconstruct(kSample / "scene.json",
                                       {"--photo",
                                        (kSample / "plate.jpg").string(),
                                        "--overlay",
                                        (folder_ / "edges.png").string()});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_TRUE(fs::exists(folder_ / "edges.png"));
    const Json found = readJsonFile(folder_ / "room.json");
    const Json truth = readJsonFile(kSample / "project.json");
    for (const Json& box : found["room"]) {
        if (!box.contains("solid") || !box["solid"].get<bool>()) continue;
        for (const Json& other : truth["room"]) {
            if (!other.contains("name") || other["name"] != box["name"]) continue;
            for (const char* corner : {"min_m", "max_m"})
                for (int axis = 0; axis < 3; ++axis)
                    // The camera, 1 to 2 cm off, and marks to whole pixels.
                    EXPECT_NEAR(
                        box[corner][axis].get<double>(), other[corner][axis].get<double>(), 0.05)
                        << box["name"] << " " << corner << " " << axis;
        }
    }
    EXPECT_EQ(reconstruct(kSample / "scene.json").exit_code, 1);  // room.json is there
}

TEST_F(ReconstructSample, AProjectGivesPhotographAndCamera)
{
    const auto fromProject = [&](const char* name, std::vector<std::string> more) {
        std::vector<std::string> arguments = {"reconstruct",
                                              (kSample / "scene.json").string(),
                                              "--project",
                                              (kSample / "project.json").string(),
                                              "-o",
                                              (folder_ / name).string()};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return runProgram(arguments);
    };
    const std::string edges = (folder_ / "edges.png").string();
    const ProgramRun run = fromProject("by_project.json", {"--overlay", edges});
    ASSERT_EQ(run.exit_code, 0) << run.messages;
    EXPECT_TRUE(fs::exists(edges));
    ASSERT_EQ(reconstruct(kSample / "scene.json").exit_code, 0);
    const Json by_project = readJsonFile(folder_ / "by_project.json");
    const Json by_camera = readJsonFile(folder_ / "room.json");
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k)  // a camera file holds rounded numbers
            EXPECT_NEAR(by_project["room"][i]["max_m"][k].get<double>(),
                        by_camera["room"][i]["max_m"][k].get<double>(),
                        tolerance::kDouble * 1e3);
    // The camera's own errors are in the sizes': with an exact one they are less.
    Json exact = readJsonFile(folder_ / "camera.json");
    for (const char* key : {"covariance",
                            "focal_px_sigma",
                            "principal_point_px_sigma",
                            "position_m_sigma",
                            "rotation_sigma_deg",
                            "turn_sigma_deg"})
        exact.erase(key);
    folder_.add("camera.json", exact.dump());
    ASSERT_EQ(reconstruct(kSample / "scene.json", {"--force"}).exit_code, 0);
    const Json without = readJsonFile(folder_ / "room.json");
    const auto sigma = [](const Json& room) {
        return room["primitives"][1]["position_m_sigma"][2].get<double>();
    };
    EXPECT_LT(1.05 * sigma(without), sigma(by_project));
    EXPECT_GT(sigma(without), 0.0);

    EXPECT_EQ(fromProject("x.json", {"--camera", (folder_ / "camera.json").string()}).exit_code, 2);
    EXPECT_EQ(
        runProgram(
            {"reconstruct", (kSample / "scene.json").string(), "-o", (folder_ / "y.json").string()})
            .exit_code,
        2);
}

TEST_F(ReconstructSample, BadScenesEndWithTheirPlaceAndCause)
{
    Json scene = readJsonFile(kSample / "scene.json");
    scene["primitives"][1]["stands_on"] = "rom.floor";
    const ProgramRun run = reconstruct(folder_.add("scene.json", scene.dump()));
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.messages, HasSubstr("did you mean \"room\"?"));
    EXPECT_FALSE(fs::exists(folder_ / "room.json"));
}

TEST_F(ReconstructSample, AContradictionIsAWarning)
{
    Json scene = readJsonFile(kSample / "scene.json");
    scene["constraints"][3]["at_px"] = {941, 640};
    const ProgramRun run =
        reconstruct(folder_.add("scene.json", scene.dump()), {"--strict", "--force"});
    EXPECT_EQ(run.exit_code, 4);
    EXPECT_THAT(run.messages, HasSubstr("reconstruct-conflict"));
}

TEST(Reconstruct, PrintsItsPrimitives)
{
    const ProgramRun run = runProgram({"reconstruct", "--print-primitives"});
    EXPECT_EQ(run.exit_code, 0);
    EXPECT_TRUE(Json::parse(run.output)["primitives"].size() == 6);
    EXPECT_EQ(runProgram({"reconstruct"}).exit_code, 2);
}

}  // namespace
}  // namespace insitu
